"""Sheets as most artists make them: few drawings of one side, another body in each, and no less."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.camera import Camera
from toonset.dataset.bundle.transforms_read import read_cameras
from toonset.dataset.mesh.load import save_obj
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.artist_options import BodyErrors
from toonset.dataset.synthetic.directions import HALF_TURNS, directions_deg
from toonset.dataset.synthetic.files import write_turnaround
from toonset.dataset.synthetic.options import CONDITIONS, STUDIO, SynthOptions
from toonset.dataset.synthetic.paper import RULE
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.errors import SheetError
from toonset.mesh import Mesh

SMALL = replace(CONDITIONS["studio"], cell_px=120, outline_px=1.5, supersample=2)


@pytest.fixture(scope="module")
def body() -> Mesh:
    return random_body(3)


@pytest.fixture(scope="module")
def made(body: Mesh) -> Turnaround:
    return make_turnaround(body, SMALL, 1)


def differing(times: float, **changes: object) -> SynthOptions:
    """Return the small sheet's options with bodies that differ by `times` as much."""
    artist = replace(STUDIO, body=STUDIO.body.scaled(times))
    return replace(SMALL, artist=artist, **changes)


def test_more_drawings_show_more_of_the_first_side_and_then_the_other() -> None:
    assert directions_deg("half", 2) == (0, 180)
    for count in range(3, 9):
        fewer, yaws = set(directions_deg("half", count - 1)), directions_deg("half", count)
        assert len(set(yaws)) == count
        assert fewer < set(yaws)
        assert list(yaws) == sorted(yaws)
    assert max(yaw for count in range(1, 6) for yaw in HALF_TURNS[count]) == 180
    assert set(directions_deg("even", 8)) == set(directions_deg("half", 8))
    between = np.add.outer(directions_deg("between", 8), [0, 22.5, -22.5])
    assert not set(between[:, 0]) & set(directions_deg("even", 8))
    assert set(between.ravel() % 360) >= set(directions_deg("even", 8))


def test_seeds_draw_either_side_from_a_front_that_is_the_front(body: Mesh) -> None:
    sides = set()
    for seed in range(6):
        sheet = make_turnaround(body, SMALL, seed)
        front, quarter, side, back = (camera.angles for camera in sheet.cameras)
        assert front == pytest.approx((0, 0, 0))
        assert abs(back[0]) == pytest.approx(math.pi)
        assert math.degrees(abs(quarter[0])) == pytest.approx(45, abs=SMALL.yaw_jitter_deg)
        assert math.degrees(abs(side[0])) == pytest.approx(90, abs=SMALL.yaw_jitter_deg)
        assert quarter[0] * side[0] > 0
        sides.add(side[0] > 0)
        exact = make_turnaround(body, replace(SMALL, cell_px=24).without_error(16), seed)
        drawn, other = np.split(np.sin([c.angles[0] for c in exact.cameras]), 2)
        assert (drawn * side[0] > 0).all()
        assert (other * side[0] < 0).all()
    assert sides == {True, False}


@pytest.mark.parametrize("views", [2, 3, 5, 8])
def test_cameras_are_true_of_a_body_that_stays_the_same(body: Mesh, views: int) -> None:
    sheet = make_turnaround(body, differing(0, views=views, warp_percent=0.0), 2)
    assert len(sheet.views) == len(sheet.cameras) == views
    for view, camera in zip(sheet.views, sheet.cameras, strict=True):
        assert off_px(body, view.rgba, camera) < SMALL.outline_px + 1


def test_bodies_differ_as_much_as_asked(body: Mesh) -> None:
    off = {}
    for times in (0, 1, 3):
        sheet = make_turnaround(body, differing(times, warp_percent=0.0), 4)
        pairs = zip(sheet.views, sheet.cameras, strict=True)
        off[times] = np.mean([off_px(body, view.rgba, camera) for view, camera in pairs])
        still = make_turnaround(body, differing(0, warp_percent=0.0), 4)
        for one, other in zip(sheet.cameras, still.cameras, strict=True):
            np.testing.assert_array_equal(one.rotation, other.rotation)
    assert off[0] + 0.5 < off[1] < off[3] - 1
    assert off[1] < 0.08 * SMALL.cell_px  # still the character


def off_px(body: Mesh, rgba: np.ndarray, camera: Camera) -> float:
    """Return how far the drawing's box is from that of the projected body, at most."""
    rows, columns = np.nonzero(rgba[..., 3] > 127)
    pixels, _, _ = camera.project(body.vertices)
    drawn = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    return float(np.abs([*pixels.min(axis=0), *pixels.max(axis=0)] - np.array(drawn)).max())


def test_title_and_height_lines_lie_behind_and_above_the_figures(made: Turnaround) -> None:
    assert made.sheet.shape[:2] == (120 + round(0.16 * 120), 4 * 120)
    rows = np.flatnonzero((made.sheet[:, 0, :3] == RULE).all(axis=1))
    tops, soles = zip(*((y, y + high) for _, y, _, high in made.figure_boxes), strict=True)
    assert len(rows) == STUDIO.height_lines
    assert (rows[0], rows[-1]) == (min(tops), max(soles))
    np.testing.assert_allclose(np.diff(rows), (max(soles) - min(tops)) / 5, atol=1)
    title = made.sheet[: round(0.16 * 120), :120, :3]
    assert 20 < (title < 160).all(axis=-1).sum() < 0.1 * title[..., 0].size
    for view in made.views:  # what is opaque in a cell covers the lines
        x, y, width, height = view.box
        there = view.rgba[..., 3] == 255
        cell = made.sheet[y : y + height, x : x + width]
        np.testing.assert_array_equal(cell[there], view.rgba[there])


def test_every_drawing_is_found_on_the_ruled_sheet(body: Mesh) -> None:
    sheet = make_turnaround(body, CONDITIONS["studio"], 0)
    found = split_picture(sheet.sheet).views
    assert len(found) == 4
    for view, box in zip(found, sheet.figure_boxes, strict=True):
        np.testing.assert_allclose(view.figure_box, box, atol=3)


def test_same_seed_same_bytes(body: Mesh, made: Turnaround, tmp_path: Path, snapshot) -> None:
    write_turnaround(made, tmp_path / "a")
    write_turnaround(make_turnaround(body, SMALL, 1), tmp_path / "b")
    assert snapshot(tmp_path / "a") == snapshot(tmp_path / "b")
    assert (make_turnaround(body, SMALL, 2).sheet != made.sheet).any()


def test_what_a_studio_cannot_draw_is_refused() -> None:
    with pytest.raises(SheetError, match="views: 9 is out of range; give 8 at most"):
        replace(SMALL, views=9)
    with pytest.raises(SheetError, match="need paper, the background is transparent"):
        replace(SMALL, background="transparent")
    assert BodyErrors() == STUDIO.body.scaled(0)


def test_the_command_draws_a_studios_sheet(tmp_path, monkeypatch, toonset, body) -> None:
    monkeypatch.setattr("toonset.cli.synth.TEST_VIEWS", 4)
    monkeypatch.chdir(tmp_path)
    Path("m.obj").write_bytes(save_obj(body))
    asked = ("synth", "m.obj", "-q", "--condition", "studio", "--cell", 64)
    assert toonset(*asked, "-o", "usual").code == 0
    truth = json.loads(Path("usual/truth.json").read_text())
    assert [len(truth["views"]), truth["options"]["turn"]] == [4, "half"]
    assert truth["options"]["artist"]["body"]["arm_swing_deg"] == STUDIO.body.arm_swing_deg
    assert len(read_cameras(Path("usual/test"))) == 4
    twice = ("--views", 3, "--pose-difference", 2)
    assert toonset(*asked, *twice, "-o", "twice").code == 0
    truth = json.loads(Path("twice/truth.json").read_text())
    assert len(truth["views"]) == 3
    assert truth["options"]["artist"]["body"]["arm_swing_deg"] == 2 * STUDIO.body.arm_swing_deg
    for wrong in (("--views", 9), ("--pose-difference", -1), ("--pose-difference", 50)):
        refused = toonset(*asked, *wrong, "-o", "no")
        assert refused.code == 2
        assert "is out of range; " in refused.reason
    assert not Path("no").exists()
