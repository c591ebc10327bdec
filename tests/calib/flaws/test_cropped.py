"""Figures that a frame cuts off, in the picture or before it: told from soles, and no outline."""

from dataclasses import replace

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from tests.figures import boxes
from toonset.calib.find_cameras import find_cameras
from toonset.calib.flaws.cropped import at_cuts, ending_at, flat_sides
from toonset.calib.outline.correspondences import Drawing
from toonset.camera import Camera
from toonset.dataset.images.picture import encode_png, load_rgba
from toonset.dataset.mesh.load import save_obj
from toonset.dataset.silhouettes.contour import drawn_contour
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.mesh import Mesh
from toonset.view import View
from toonset.write import write_bytes

OPTIONS = SynthOptions(views=5, cell_px=220, outline_px=0, elevation_deg=8)
LOST = 14  # px of the figures' feet, of about 190


def disc(*, hard: bool = False, cut: int = 0, paper: int = 20) -> View:
    """Return a disc of radius 40; with `cut` its lowest rows are missing, with `paper` beyond."""
    v, u = np.mgrid[:120, :120] + 0.5
    alpha = np.clip(40.5 - np.hypot(u - 60.3, v - 60.3), 0, 1)
    rgba = np.zeros((120, 120, 4), np.uint8)
    rgba[..., 3] = np.round(255 * (alpha > 0.5 if hard else alpha))
    if cut:
        rgba[100 - cut :] = 0
        rgba = rgba[: 100 - cut + paper]
    return View(rgba, (7, 9, 120, len(rgba)), 0.0, "000.png")


def test_a_smooth_figure_that_ends_in_a_ruled_line_may_be_cut_off():
    (flat,) = flat_sides(disc(cut=10))
    assert (flat.side, flat.at, flat.at_edge) == ("bottom", 90, False)
    ((first, last),) = flat.spans
    assert last - first == pytest.approx(2 * np.sqrt(40**2 - 29.7**2), abs=3)


@pytest.mark.parametrize("turns", range(4))
def test_every_side_is_looked_at(turns):
    view = disc(cut=10)
    rgba = np.rot90(view.rgba, turns)
    turned = replace(view, rgba=rgba, box=(0, 0, rgba.shape[1], rgba.shape[0]))
    (flat,) = flat_sides(turned)
    assert flat.side == ("bottom", "right", "top", "left")[turns]
    along = rgba[..., 3] if flat.axis == 1 else rgba[..., 3].T
    ends = along[flat.at :] if flat.side in ("bottom", "right") else along[: flat.at]
    assert not ends.any()
    assert drawn_contour(ending_at(turned, flat)).free.mean() < 0.85
    assert drawn_contour(turned).free.all()


def test_round_figures_and_hard_pixels_say_nothing():
    assert flat_sides(disc()) == ()
    assert flat_sides(disc(hard=True, cut=10)) == ()


def test_at_the_pictures_edge_a_figure_may_be_cut_off_or_closely_cropped():
    (flat,) = flat_sides(disc(cut=10, paper=0))
    assert flat.at_edge
    close = disc(cut=10, paper=0)
    close = replace(close, rgba=close.rgba[24:])
    assert flat_sides(close) == ()  # it touches the opposite edge, too


def test_nothing_is_matched_beyond_a_cut():
    view = disc(cut=10)
    (flat,) = flat_sides(view)
    drawing = Drawing(drawn_contour(ending_at(view, flat)), 70.0, 100)
    end = 90 * drawing.factor - drawing.offset[1]
    shown = drawing.shows(np.array([[30.0, end - 1], [30.0, end + 1]]))
    assert shown.tolist() == [True, False]
    assert Drawing(drawn_contour(view), 70.0, 100).shows(np.array([[30.0, 1e6]])).all()


@pytest.fixture(scope="module")
def made():
    return make_turnaround(random_body(11), OPTIONS, 11)


def without_feet(view: View, camera: Camera, paper: int) -> tuple[View, Camera]:
    _, y, _, height = view.figure_box
    end = y - view.box[1] + height - LOST
    rgba = view.rgba.copy()
    rgba[end:] = 0
    kept = rgba[: end + paper]
    return replace(view, rgba=kept), camera.moved((0, 0), (kept.shape[1], kept.shape[0]))


@pytest.mark.parametrize("paper", [8, 0])
def test_feet_that_are_missing_do_not_shrink_the_figure(made, paper):
    cut = [
        without_feet(view, camera, paper) if i in (1, 3) else (view, camera)
        for i, (view, camera) in enumerate(zip(made.views, made.cameras, strict=True))
    ]
    found = find_cameras([view for view, _ in cut], made.mesh)
    assert [c.view for c in found.cuts] == [made.views[1].name, made.views[3].name]
    assert all(c.lost_px == pytest.approx(LOST, abs=5) for c in found.cuts)
    assert found.verdict == "ok"
    points = made.mesh.vertices[::50]
    for fit, (_, camera) in zip(found.views, cut, strict=True):
        assert np.abs(fit.camera.project(points)[0] - camera.project(points)[0]).max() < 1.5

    views, ended = at_cuts([view for view, _ in cut], found)
    for before, after, view, fit in zip(found.views, ended.views, views, cut, strict=True):
        assert view.rgba.shape[:2] == after.camera.size_wh[::-1]
        moved = np.array(view.box[:2]) - fit[0].box[:2]
        shift = before.camera.project(points)[0] - after.camera.project(points)[0]
        np.testing.assert_allclose(shift, np.broadcast_to(moved, shift.shape), atol=1e-9)
    assert views[1].mask[-1].any()
    assert views[0] is cut[0][0]


def test_a_closely_cropped_figure_is_whole(made):
    pairs = []
    for view, camera in zip(made.views, made.cameras, strict=True):
        rows = np.flatnonzero(view.mask.any(axis=1))
        kept = view.rgba[: rows[-1] + 1]  # paper above, none below
        size = (kept.shape[1], kept.shape[0])
        pairs.append((replace(view, rgba=kept), camera.moved((0, 0), size)))
    found = find_cameras([view for view, _ in pairs], made.mesh)
    assert found.cuts == ()
    assert found.verdict == "ok"


@pytest.mark.parametrize("elevation", [0, 8])
def test_longer_legs_than_the_characters_are_no_cut(elevation):
    """Flat soles on whole pixels, in one view or in all, and a mannequin that reaches below."""

    def figure(leg: float) -> Mesh:
        legs = [((0.35, leg, 0.4), (side, leg / 2, 0)) for side in (-0.25, 0.25)]
        return boxes(((1, 1, 1), (0, leg + 1.5, 0)), ((0.9, 1, 0.5), (0, leg + 0.5, 0)), *legs)

    options = replace(OPTIONS, views=4, cell_px=200, elevation_deg=elevation)
    views = split_picture(make_turnaround(figure(1.0), options, 0).sheet).views
    assert any(side.side == "bottom" for view in views for side in flat_sides(view))
    assert find_cameras(views, figure(1.3)).cuts == ()


def test_calibrate_ends_the_picture_at_the_cut_and_says_so(toonset, made, tmp_path):
    sheet = made.sheet.copy()
    view = made.views[2]
    x, y, width, height = view.figure_box
    end = y + height - LOST
    sheet[end : y + height, x : x + width] = sheet[0, 0]
    write_bytes(tmp_path / "sheet.png", encode_png(sheet))
    write_bytes(tmp_path / "body.obj", save_obj(made.mesh))
    given = (tmp_path / "sheet.png", "--mesh", tmp_path / "body.obj", "-o", tmp_path / "bundle")
    outcome = toonset("calibrate", *given, "--json")
    (cut,) = outcome.json["cut_off"]
    assert (cut["view"], cut["side"]) == ("002.png", "bottom")
    assert "002.png: the figure is cut off at the bottom" in outcome.err
    picture = load_rgba(tmp_path / "bundle/images/002.png")
    assert (picture[-1, :, 3] == 255).any()
    assert toonset("check", tmp_path / "bundle").code == 0
