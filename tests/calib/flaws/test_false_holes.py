"""Holes in drawings: the drawing from the other side says which of them are paint."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.calib.flaws.false_holes import fill_false_holes
from toonset.calib.result import ViewCalibration
from toonset.camera import Camera
from toonset.dataset.images.picture import encode_png, load_rgba
from toonset.dataset.mesh.load import save_obj
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.view import View
from toonset.write import write_bytes

SIZE = (60, 100)
WHITE, RED = (255, 255, 255), (200, 40, 30)
HOLE = (slice(45, 55), slice(24, 34))


def camera_at(yaw_deg: float, elevation: float = 0.0) -> Camera:
    return Camera.looking_at(np.zeros(3), np.radians(yaw_deg), elevation, 45.0, SIZE)


def slab() -> np.ndarray:
    """Return the corners of a flat body, 0.2 deep."""
    x, y, z = np.meshgrid((-0.4, 0.4), np.linspace(-1, 1, 9), (-0.1, 0.1))
    return np.stack([x, y, z], axis=-1).reshape(-1, 3)


def drawn(name: str, hole=None, patch=None, soft: bool = False) -> View:
    """Return a red slab with a see-through hole or a painted patch of paper."""
    rgba = np.zeros((*SIZE[::-1], 4), np.uint8)
    rgba[5:95, 12:48] = (*RED, 255)
    if patch is not None:
        rgba[patch] = (*WHITE, 255)
    if hole is not None:
        rgba[hole] = 0
        if soft:
            rgba[hole[0], hole[1].start - 1] = (*RED, 120)
    return View(rgba, (0, 0, *SIZE), 0.0, name)


def filled(views, yaws=(0, 180), papers=(WHITE, WHITE), verdict="ok", elevation=0.0):
    looks = [SimpleNamespace(camera=camera_at(y, elevation), verdict=verdict) for y in yaws]
    found = cast("list[ViewCalibration]", looks)
    views = [replace(view, paper=paper) for view, paper in zip(views, papers, strict=True)]
    return fill_false_holes(views, found, slab())


HOLED, PLAIN = drawn("0", HOLE), drawn("1")
PALE = replace(PLAIN, rgba=np.where(PLAIN.rgba > 0, 255, 0).astype(np.uint8))


def test_a_hole_that_the_back_does_not_show_is_paint():
    views, holes = filled([HOLED, PLAIN])
    assert [(h.view, h.box, h.by) for h in holes] == [("0", (24, 45, 10, 10), "1")]
    assert views[0].mask[HOLE].all()
    assert (views[0].rgba[HOLE][..., :3] == WHITE).all()
    assert np.array_equal(views[1].rgba, PLAIN.rgba)
    assert "0: the hole at 24, 45 (10 x 10 px) is paint: 1" in str(holes[0])
    assert filled([HOLED, PLAIN], elevation=np.radians(15))[1]


def test_a_filled_hole_is_the_sheet_again_where_its_edge_was_mixed():
    (after, _), _ = filled([drawn("0", HOLE, soft=True), PLAIN])
    edge = after.rgba[50, HOLE[1].start - 1]
    share = 120 / 255
    assert edge[3] == 255
    assert np.allclose(edge[:3], share * np.array(RED) + (1 - share) * 255, atol=1)
    assert np.array_equal(after.rgba[..., 3] == 0, PLAIN.rgba[..., 3] == 0)  # nothing else


@pytest.mark.parametrize(
    ("hole", "other", "given"),
    [
        (HOLE, drawn("1", (slice(45, 55), slice(26, 36))), {}),  # the same gap, seen from behind
        (HOLE, drawn("1", patch=(slice(46, 56), slice(27, 37))), {}),  # taken for paint there
        (HOLE, PALE, {}),  # paint in the paper's colour proves nothing
        (HOLE, PLAIN, {"yaws": (0, 90)}),  # a side view sees no gap between arm and body
        (HOLE, PLAIN, {"yaws": (0, 0)}),  # the same side, drawn another time
        (HOLE, PLAIN, {"elevation": np.radians(25)}),  # they do not look against each other
        (HOLE, PLAIN, {"verdict": "failed"}),
        (HOLE, PLAIN, {"papers": (WHITE, None)}),
        (HOLE, PLAIN, {"papers": (None, WHITE)}),
        ((slice(45, 55), slice(13, 17)), PLAIN, {}),  # near the outline
    ],
)
def test_a_hole_stays_unless_it_is_contradicted(hole, other, given):
    views, holes = filled([drawn("0", hole), other], **given)
    assert holes == ()
    assert not views[0].mask[hole].any()


def test_calibrate_fills_a_white_buckle_and_says_so(toonset, tmp_path):
    options = SynthOptions(views=4, cell_px=200, outline_px=0, elevation_deg=8)
    made = make_turnaround(random_body(11), options, 11)
    sheet = made.sheet.copy()
    front = split_picture(sheet).views[0]
    x, y, width, height = front.figure_box
    row, column = y + round(0.38 * height), x + width // 2
    sheet[row - 6 : row + 6, column - 6 : column + 6, :3] = 20
    sheet[row - 4 : row + 4, column - 4 : column + 4, :3] = 255
    cut = split_picture(sheet).views[0]
    assert not cut.mask[row - cut.box[1], column - cut.box[0]]  # taken for a hole
    write_bytes(tmp_path / "sheet.png", encode_png(sheet))
    write_bytes(tmp_path / "body.obj", save_obj(made.mesh))
    given = (tmp_path / "sheet.png", "--mesh", tmp_path / "body.obj", "-o", tmp_path / "bundle")
    outcome = toonset("calibrate", *given, "--json")
    (hole,) = outcome.json["filled_holes"]
    assert hole["view"] == "000.png"
    assert "000.png: the hole at" in outcome.err
    x, y, width, height = hole["box"]
    picture = load_rgba(tmp_path / "bundle/images/000.png")
    assert (picture[y : y + height, x : x + width, 3] == 255).all()
    assert (picture[y + height // 2, x + width // 2] == 255).all()
    toonset("split", tmp_path / "sheet.png", "-o", tmp_path / "views")
    outcome = toonset("calibrate", tmp_path / "views", *given[1:], "--force", "--json")
    assert outcome.json["filled_holes"] == []  # a split folder has been looked at
