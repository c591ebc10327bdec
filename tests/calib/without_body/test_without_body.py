"""Cameras without a body: turns, labels, elevation, verdicts, and the bundle."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from toonset.calib.calibrate import calibrate
from toonset.calib.known import Known
from toonset.calib.options import Hints, VerdictThresholds
from toonset.calib.without_body import rival
from toonset.calib.without_body.find import calibrate_without_body
from toonset.calib.without_body.placing import Figures, place
from toonset.calib.without_body.posterior import label_doubt
from toonset.calib.without_body.rival import ASK_ALONE, REFUSED, with_body_or_without
from toonset.calib.without_body.turns import is_even, turn_hypotheses, wrapped
from toonset.calib.write_bundle import write_bundle
from toonset.camera import Camera
from toonset.dataset.split_folder.view_labels import front_label, parse_labels
from toonset.errors import SheetError
from toonset.mesh import Mesh
from toonset.options import Body
from toonset.view import View

SIDE = 120
RING = np.arange(8) * np.pi / 4
EYES = tuple(((s * 0.13, 0.62, 0.27), 0.06, (20, 20, 30)) for s in (-1, 1))
BALLS = (  # middle, radius, colour: body, head, a nose, shins that stand behind, eyes
    ((0.0, -0.1, 0.0), 0.45, (200, 40, 40)),
    ((0.0, 0.55, 0.0), 0.3, (240, 200, 160)),
    ((0.0, 0.5, 0.32), 0.09, (220, 150, 120)),
    ((0.2, -0.6, -0.12), 0.17, (60, 40, 30)),
    ((-0.2, -0.6, -0.12), 0.17, (60, 40, 30)),
    ((0.0, 0.0, -0.42), 0.2, (40, 80, 200)),
    *EYES,
)


def drawing(yaw: float, elevation: float, name: str = "000.png") -> View:
    """Return the balls, seen orthographically, nearer ones before farther ones."""
    camera = Camera.looking_at(np.zeros(3), yaw, elevation, 60.0, (SIDE, SIDE))
    grid = camera.pixel_grid()
    rgba, near = np.zeros((SIDE, SIDE, 4), np.uint8), np.full((SIDE, SIDE), np.inf)
    for middle, radius, color in BALLS:
        (pixel,), (depth,), _ = camera.project(np.array([middle]))
        off = np.linalg.norm(grid - pixel, axis=-1) / camera.scale
        here = off < radius
        front = depth - np.sqrt(np.maximum(radius**2 - off**2, 0))
        shown = here & (front < near)
        rgba[shown], near[shown] = (*color, 255), front[shown]
    return View(rgba, (0, 0, SIDE, SIDE), 0.0, name)


def sheet(yaws: Iterable[float], elevation: float = 0.17) -> list[View]:
    return [drawing(yaw, elevation, f"{i:03d}.png") for i, yaw in enumerate(yaws)]


def off_from(yaws: np.ndarray, views: Iterable[Any]) -> np.ndarray:
    return wrapped(np.array([view.camera.angles[0] for view in views]) - yaws)


@pytest.mark.parametrize("views", range(1, 10))
def test_turns_are_alternatives_and_labels_outweigh_them(views: int) -> None:
    turns = turn_hypotheses(views)
    assert np.exp(turns.log_prior).sum() == pytest.approx(1)
    assert turns.yaws.shape == (len(turns.log_prior), views)
    if views >= 6:
        assert is_even(turns.yaws[int(turns.log_prior.argmax())])
    labels = parse_labels(",".join(["?"] * (views - 1) + ["back"]), views)
    labelled = turn_hypotheses(views, labels)
    best = labelled.yaws[int(labelled.log_prior.argmax())]
    assert abs(wrapped(best[-1] - np.pi)) < 0.4


def test_sheets_are_read_from_the_left_or_from_the_right() -> None:
    turns = turn_hypotheses(8)
    odds = {}
    for name, yaws in {"left": RING, "right": RING[::-1], "side": RING + np.pi / 2}.items():
        same = np.abs(wrapped(turns.yaws - yaws)).max(axis=1) < 1e-6
        assert same.sum() == 1  # every turn once
        odds[name] = float(turns.log_prior[same][0])
    assert odds["left"] > odds["right"] > odds["side"]


def test_one_hint_settles_the_front_of_an_even_ring() -> None:
    hint = parse_labels(front_label(3, 8), 8)
    ring = np.roll(RING, 3)
    found = calibrate_without_body(sheet(ring), Known(labels=hint))
    np.testing.assert_allclose(off_from(ring, found.views), 0, atol=1e-6)
    assert all(view.verdict == "ok" for view in found.views)


def test_the_front_is_one_of_the_views() -> None:
    with pytest.raises(SheetError, match="--front 8: the views are numbered 0 to 7"):
        front_label(8, 8)


def test_odd_labels_are_read_as_they_are() -> None:
    labels = parse_labels("10,70,200", 3)
    turns = turn_hypotheses(3, labels)
    best = turns.yaws[int(turns.log_prior.argmax())]
    np.testing.assert_allclose(np.degrees(best), [10, 70, 200])


@pytest.mark.parametrize("elevation", [0.1, 0.35])
def test_the_elevation_is_the_one_under_which_outlines_cohere(elevation: float) -> None:
    placed = place(Figures(sheet(RING, elevation)), RING, np.zeros(len(RING)))
    assert placed.elevation == pytest.approx(elevation, abs=0.1)
    assert placed.apart < 0.01
    found = [camera.angles[0] for camera in placed.cameras]
    np.testing.assert_allclose(wrapped(np.array(found) - RING), 0, atol=1e-6)


@pytest.mark.parametrize(("start", "way"), [(3, 1), (6, -1)])
def test_a_turn_is_found_wherever_it_starts_and_whichever_way_it_goes(start: int, way: int) -> None:
    yaws = np.roll(RING[::way], start)
    found = calibrate_without_body(sheet(yaws), Known())
    assert np.abs(off_from(yaws, found.views)).max() < np.radians(22.5)
    assert found.is_certain  # its faces and shins tell the front, nobody needs to


def test_five_views_may_stand_anywhere_and_a_label_places_them() -> None:
    yaws = np.radians([125.0, 165.0, 225.0, 275.0, 0.0])
    alone = calibrate_without_body(sheet(yaws), Known())
    assert {view.verdict for view in alone.views} <= {"weak", "ambiguous"}
    off = np.degrees(off_from(yaws, alone.views))
    assert np.median(np.abs(off - np.median(off))) < 10
    labels = parse_labels(front_label(4, 5), 5)
    found = calibrate_without_body(sheet(yaws), Known(labels=labels))
    off = np.degrees(off_from(yaws, found.views))
    assert abs(off[-1]) < 22.5
    assert np.median(np.abs(off)) < 15
    assert found.views[0].sigmas.yaw > np.radians(5)  # no even turn: its yaws are fitted
    assert all(view.verdict != "ok" for view in found.views)


def test_rings_go_one_way_round() -> None:
    assert is_even(RING)
    assert is_even(-RING + 1)
    assert not is_even(np.array([0, 1, 0, 1]) * np.pi / 2)
    assert not is_even(np.array([0.0, np.pi]))


def test_labels_settle_what_is_in_doubt() -> None:
    labels = parse_labels(",".join(f"{yaw:.0f}" for yaw in np.degrees(RING)), 8)
    found = calibrate_without_body(sheet(RING), Known(labels=labels))
    assert found.is_certain
    assert found.reason == ""  # no doubt is worth a word
    turned = calibrate_without_body(sheet(np.roll(RING, 4)), Known(labels=labels))
    np.testing.assert_allclose(off_from(RING, turned.views), 0, atol=1e-6)
    assert not turned.is_certain  # the faces say otherwise
    assert "is a label wrong" in turned.views[0].reason


def test_drawings_that_are_no_turn_are_never_ok() -> None:
    one, view = drawing(0.0, 0.1), sheet([0.0])[0]
    pair = calibrate_without_body(sheet(RING[:3:2]), Known(labels=parse_labels("front,left", 2)))
    assert pair.verdict == "weak"
    alone = calibrate_without_body([view], Known())
    assert (alone.verdict, alone.views[0].verdict) == ("ambiguous", "ambiguous")
    same = calibrate_without_body([one] * 4, Known())
    assert not same.is_certain
    flat = np.zeros((SIDE, SIDE, 4), np.uint8)
    flat[60:100, 50:60] = (10, 200, 10, 255)
    pole = View(flat, (0, 0, SIDE, SIDE), 0.0, "pole.png")
    labels = parse_labels("front,left,back,right", 4)
    mixed = calibrate_without_body([one, pole, drawing(1.0, 0.1), pole], Known(labels=labels))
    assert mixed.verdict == "failed"
    quarters = sheet(RING[::2])
    half = np.pad(quarters[1].rgba[::2, ::2], ((0, SIDE // 2), (0, SIDE // 2), (0, 0)))
    quarters[1] = replace(quarters[1], rgba=half)
    unequal = calibrate_without_body(quarters, Known(labels=labels))
    assert unequal.verdict == "failed"
    assert "2.0 times larger or smaller than the others" in unequal.views[0].reason


def test_a_bundle_without_a_body_has_no_mannequin(tmp_path: Path) -> None:
    ring = RING[::2]
    found = calibrate(sheet(ring), Body.NONE, Hints(labels="front,?,?,?"))
    assert found.views[0].p_flip < 1 - VerdictThresholds().sure
    bundle = write_bundle(tmp_path / "bundle", found)
    assert bundle.mannequin is None
    names = sorted(path.name for path in (tmp_path / "bundle").iterdir())
    assert names == ["calibration.json", "images", "overlay.png", "transforms.json"]
    np.testing.assert_allclose(off_from(ring, bundle.scene.frames), 0, atol=1e-6)


def test_a_body_that_explains_nothing_loses_to_none() -> None:
    found = calibrate(sheet(RING))  # the plain body has legs and arms
    assert found.mesh is None
    assert found.verdict != "failed"
    assert np.abs(off_from(RING, found.views)).max() < np.radians(22.5)
    made = trimesh.creation.box((0.05, 2.0, 0.02))
    pole = Mesh(np.array(made.vertices), np.array(made.faces))  # no drawing resembles it
    given = calibrate(sheet(RING[::2]), pole, Hints(labels="front,left,back,right"))
    assert given.reason == REFUSED
    assert given.is_certain
    assert given.mesh is pole  # stays as reference, and the world is its own
    tops = [view.camera.project(np.array([[0.0, 1.0, 0.0]]))[0][0] for view in given.views]
    heads = [np.nonzero(view.mask)[0].min() for view in given.drawings]
    np.testing.assert_allclose([top[1] for top in tops], heads, atol=3)


@pytest.mark.parametrize("nats", [-2.0, 2.0, 4.0])
def test_a_given_mannequin_in_doubt_yields_to_drawings_that_are_clearly_likelier(
    nats: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    views = sheet(np.radians([0, 315, 270, 180]), 0.0)
    alone = calibrate_without_body(views, Known())
    found = replace(alone, verdict="weak", reason="1 of 4 weak")
    monkeypatch.setattr(rival, "_odds", lambda *_: nats)
    ask = partial(with_body_or_without, views, known=Known(), tell=lambda *_: None, alone=alone)
    better, has_no_body = ask(found, given=True)
    assert has_no_body == (nats > 3)
    assert better.reason == (REFUSED if has_no_body else f"{ASK_ALONE}; 1 of 4 weak")
    assert ask(found, given=False) == (alone, True)  # nobody chose it, and it is in doubt
    doubted = replace(alone, verdict="weak")
    asked = ask(found, given=False, alone=doubted)
    assert asked == ((doubted, True) if nats > 0 else (found, False))
    assert ask(alone, given=True) == (alone, False)  # certain: nothing is asked


@pytest.mark.parametrize("degrees", [(0, 90, 180), (0, 315, 270, 180), (0, 270, 90, 180)])
def test_what_artists_draw_is_ok_without_a_label_and_no_worse_with_it(degrees) -> None:
    yaws = np.radians(degrees)
    views = sheet(yaws, 0.0)
    found = calibrate_without_body(views, Known())
    np.testing.assert_allclose(off_from(yaws, found.views), 0, atol=1e-9)  # front 0, back 180
    labels = parse_labels(",".join(map(str, degrees)), len(yaws))
    labelled = calibrate_without_body(views, Known(labels=labels))
    assert found.is_certain
    assert labelled.is_certain
    for wrong in ([yaw + 180 for yaw in degrees], [-yaw for yaw in degrees]):
        turned = parse_labels(",".join(str(yaw % 360) for yaw in wrong), len(yaws))
        assert not calibrate_without_body(views, Known(labels=turned)).is_certain


def test_labels_are_doubted_together_and_only_where_the_doubt_moves_a_view() -> None:
    """Half a turn off at 3 to 1, mirrored likewise: front and back stay where they are, then."""
    labels = parse_labels("front,left,back", 3)
    yaws = np.radians([0.0, 90.0, 180.0])
    turns = turn_hypotheses(3, labels)

    def doubt(other: np.ndarray, nats: float) -> np.ndarray:
        there = np.abs(wrapped(turns.yaws - other)).max(axis=1) < 1e-6
        assert there.any()
        chosen = int((turns.log_prior - there * 100).argmax())
        assert np.abs(wrapped(turns.yaws[chosen] - yaws)).max() < 1e-6
        return label_doubt(turns, there * nats, chosen, labels) > 0.05

    assert doubt(yaws + np.pi, np.log(3)).tolist() == [True, True, True]
    assert doubt(-yaws, np.log(3)).tolist() == [False, True, False]
    assert not doubt(yaws + np.pi, 0.0).any()
    assert not label_doubt(turns, np.zeros(len(turns.yaws)), 0, ()).any()


def test_eye_level_and_orthography_unless_drawings_prove_more() -> None:
    yaws = np.radians([0, 90, 180])
    spread = [drawing(yaw, 0.0, f"{i}.png") for i, yaw in enumerate(yaws)]
    arms = spread[1].rgba.copy()
    arms[70:78, 20:100] = (200, 40, 40, 255)  # held out in the side drawing alone
    views = [spread[0], View(arms, (0, 0, SIDE, SIDE), 0.0, "1.png"), spread[2]]
    placed = place(Figures(views), yaws, np.zeros(3))
    assert placed.elevation < np.radians(1)
    assert all(camera.is_orthographic for camera in placed.cameras)


def test_labels_lock_yaws_without_a_mannequin() -> None:
    yaws = np.radians([0, 50, 90, 180])
    hints = Hints(labels="0,50,90,180", lock=("yaw",))
    found = calibrate(sheet(yaws, 0.0), Body.NONE, hints)
    np.testing.assert_allclose(off_from(yaws, found.views), 0, atol=1e-9)


def test_rows_that_repeat_their_directions_are_a_pattern() -> None:
    yaws = turn_hypotheses(15, in_row=5).yaws
    repeated = np.tile(np.radians([0, 45, 90, 135, 180]), 3)
    assert (np.abs(wrapped(yaws - repeated)).max(axis=1) < 1e-6).any()
