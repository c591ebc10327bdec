"""Sheets that are no turnaround: a verdict with the reason, never an exception, never ok."""

import io
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from lab.bench.cases.bodies import random_body
from toonset.calib.calibrate import calibrate
from toonset.calib.find_cameras import find_cameras
from toonset.calib.options import Hints
from toonset.calib.result import Calibration
from toonset.calib.verdict.one_character import other_character
from toonset.calib.verdict.repeated import repeated_drawings
from toonset.calib.verdict.report import undrawn_line
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.split_folder.view_labels import front_label
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.errors import UsageError
from toonset.options import Body
from toonset.view import View

VIEWS = 4
RING = np.arange(VIEWS) * 2 * np.pi / VIEWS


@pytest.fixture(scope="module")
def made() -> Turnaround:
    options = SynthOptions(views=VIEWS, cell_px=96, outline_px=0, elevation_deg=8)
    return make_turnaround(random_body(11), options, 11)


@pytest.fixture(scope="module")
def views(made: Turnaround) -> list[View]:
    found = list(split_picture(made.sheet).views)
    assert len(found) == VIEWS
    return found


def repainted(view: View) -> View:
    """Return a drawing in other colours."""
    rgba = view.rgba.copy()
    rgba[..., :3] = 255 - rgba[..., [1, 2, 0]]
    return replace(view, rgba=rgba)


def resized(view: View, factor: float) -> View:
    height, width = view.rgba.shape[:2]
    picture = Image.fromarray(view.rgba).resize((round(factor * width), round(factor * height)))
    return replace(view, rgba=np.array(picture), box=(0, 0, *picture.size))


def as_jpeg(view: View) -> View:
    """Return a drawing whose colours have been through a JPEG file."""
    file = io.BytesIO()
    Image.fromarray(view.rgba[..., :3]).save(file, "JPEG", quality=80)
    colors = np.array(Image.open(file))
    return replace(view, rgba=np.dstack([colors, view.rgba[..., 3]]))


def alone(views: Sequence[View], labels: str = front_label(0, VIEWS)) -> Calibration:
    named = [replace(view, name=f"{i:03d}.png") for i, view in enumerate(views)]
    return calibrate(named, Body.NONE, Hints(labels=labels))


def off_ring(found: Calibration, ring: np.ndarray = RING) -> float:
    turned = np.array([view.camera.angles[0] for view in found.views])
    return float(np.abs((turned - ring + np.pi) % (2 * np.pi) - np.pi).max())


def test_the_sheet_itself_is_fine(views: list[View]) -> None:
    """Every refusal below has another cause than the drawings."""
    found = alone(views)
    assert found.is_certain
    assert off_ring(found) < np.radians(5)
    assert repeated_drawings(views) == []
    assert other_character(views) == []


def test_views_of_two_characters_are_not_ok(views: list[View]) -> None:
    two = [*views[:2], *map(repainted, views[2:])]
    found = alone(two)
    assert all(view.verdict != "ok" for view in found.views)
    assert "views 2, 3 have other colours than views 0, 1" in found.views[0].reason


def test_with_a_mannequin_views_of_two_characters_are_not_ok(made, views):
    found = find_cameras([*views[:2], *map(repainted, views[2:])], made.mesh)
    assert {view.verdict for view in found.views} == {"weak"}
    assert "other colours" in found.views[0].reason


def test_one_drawing_for_all_views_is_no_turn(made: Turnaround, views: list[View]) -> None:
    labelled = alone([views[0]] * VIEWS, "front,left,back,right")
    assert (labelled.verdict, {view.verdict for view in labelled.views}) == ("failed", {"failed"})
    assert "views 0 and 1 are the same drawing: remove one" in labelled.views[0].reason
    fitted = find_cameras([views[0]] * VIEWS, made.mesh)
    assert all(view.verdict != "ok" for view in fitted.views)
    assert "all 4 views are the same drawing" in fitted.views[0].reason


def test_a_drawing_that_comes_twice_is_named(views: list[View]) -> None:
    twice = [*views[:2], resized(as_jpeg(views[1]), 0.9), views[3]]
    found = alone(twice)
    assert [view.verdict == "failed" for view in found.views] == [False, True, True, False]
    assert all(view.verdict != "ok" for view in found.views)
    assert {view.reason for view in found.views} == {
        "views 1 and 2 are the same drawing: remove one of them (--drop)"
    }


def test_with_a_mannequin_a_drawing_may_come_twice(made: Turnaround, views: list[View]) -> None:
    found = find_cameras([*views[:2], views[1], *views[2:]], made.mesh)
    assert found.is_certain
    assert off_ring(found, np.insert(RING, 2, RING[1])) < np.radians(5)


def test_a_mirrored_copy_and_plain_silhouettes_are_other_drawings(views: list[View]) -> None:
    front = views[0]
    mirrored = replace(front, rgba=np.ascontiguousarray(front.rgba[:, ::-1]))
    assert repeated_drawings([front, mirrored]) == []
    plain = replace(front, rgba=front.rgba.copy())
    plain.rgba[..., :3] = 90
    assert repeated_drawings([plain, plain]) == []
    assert repeated_drawings([front, plain, front]) == [(0, 2)]


@pytest.mark.parametrize(
    ("sizes", "verdict"), [((0.6, 1.6, 1.0, 1.3), "failed"), ((0.75, 1.35, 1.0, 1.0), "weak")]
)
def test_views_at_several_scales_are_not_ok(views, sizes, verdict):
    found = alone([resized(view, size) for view, size in zip(views, sizes, strict=True)])
    assert {view.verdict for view in found.views} == {verdict}
    assert "at one scale?" in found.views[0].reason
    assert "larger or smaller than the others" in found.views[0].reason


@pytest.mark.parametrize(("view", "side", "seen"), [(1, 0, True), (2, 1, True), (1, 1, False)])
def test_a_squashed_drawing_is_doubted_where_the_others_tell(views, view, side, seen):
    """Of heights all drawings tell, of widths the one from the opposite side."""
    size = list(views[view].rgba.shape[1::-1])
    size[1 - side] = round(0.7 * size[1 - side])
    picture = Image.fromarray(views[view].rgba).resize(tuple(size))
    squashed = replace(views[view], rgba=np.array(picture), box=(0, 0, *size))
    half_turn = [views[0], views[1], views[2]]
    half_turn[view] = squashed
    found = alone(half_turn, "front,left,back")
    assert found.is_certain != seen
    assert any("times" in own.reason or "disagrees" in own.reason for own in found.views) == seen


def test_nobody_drew_the_back(views: list[View]) -> None:
    found = alone([views[0], views[1]], "front,left")
    assert "nobody drew the back" in undrawn_line(found)
    assert undrawn_line(alone([views[0], views[2]], "front,back")) == ""


def test_views_without_feet_keep_their_directions_or_are_not_ok(views: list[View]) -> None:
    cropped = [
        replace(view, rgba=view.rgba[: int(0.85 * len(view.rgba))]) if i % 2 else view
        for i, view in enumerate(views)
    ]
    found = alone(cropped)
    assert not found.is_certain or off_ring(found) < np.radians(22.5)


def test_a_mirrored_sheet_is_the_mirrored_characters(made: Turnaround, views: list[View]) -> None:
    mirrored = [replace(view, rgba=np.ascontiguousarray(view.rgba[:, ::-1])) for view in views]
    found = alone(mirrored)
    assert off_ring(found, -RING) < np.radians(5)
    fitted = find_cameras(mirrored, made.mesh)  # its bag is on the other side
    assert all(view.verdict != "ok" for view in fitted.views)
    assert "is it mirrored" in fitted.views[0].reason


@pytest.mark.parametrize("count", [1, 2])
def test_too_few_drawings_say_what_is_missing(count: int, views: list[View]) -> None:
    bare = alone(views[:count], "")
    assert {view.verdict for view in bare.views} <= {"ambiguous", "weak"}
    assert "--front 0" in bare.reason
    labelled = alone(views[:count], front_label(0, count))
    assert {view.verdict for view in labelled.views} == {"weak"}
    assert "nothing confirms" in labelled.views[0].reason


def test_two_drawings_are_no_other_bodys(views: list[View]) -> None:
    """Without a mannequin two drawings got the default one's cameras, fitting or not."""
    found = calibrate([views[0], views[2]])
    assert not found.is_certain
    assert found.mesh is None
    assert off_ring(found, np.array([0, np.pi])) < np.radians(5)


@pytest.mark.parametrize("chosen", [[0, 1], [0, 2]])
def test_with_a_mannequin_two_drawings_are_enough(made, views, chosen):
    found = find_cameras([views[i] for i in chosen], made.mesh)
    assert off_ring(found, RING[chosen]) < np.radians(5)


def test_landmarks_without_their_mannequin_are_a_mistake(views: list[View]) -> None:
    with pytest.raises(UsageError, match="--lock elevation needs a mannequin"):
        calibrate(views, Body.NONE, Hints(lock=("elevation",)))
    with pytest.raises(UsageError, match="--landmarks needs a mannequin; drop it or --mesh none"):
        calibrate(views, Body.NONE, Hints(landmarks="points.json"))
