"""Drawings and mannequins that are taller or lower than their width asks for."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from lab.bench.stability.damage import stretched
from toonset.calib.find_cameras import find_cameras
from toonset.calib.fit.model_selection import BIC_MARGIN, STRETCHED, TALLER
from toonset.calib.flaws.stretched import Stretches, as_drawn, stretch_mannequin, unstretch
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.result import Calibration, CutOff, FlatSide
from toonset.camera import rotation_distance
from toonset.dataset.silhouettes.contour import drawn_contour
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.view import View

OPTIONS = SynthOptions(views=5, cell_px=200, outline_px=0, elevation_deg=6)
TALL, LOW = 0.08, -0.06  # of `stretched`: 1.08^2 and 0.94^2 times the height over width


@pytest.fixture(scope="module")
def made() -> Turnaround:
    return make_turnaround(random_body(5), OPTIONS, 5)


def proven(found: Calibration) -> set[str]:
    return {model_test.name for model_test in found.model.tried if model_test.is_proven} & {
        STRETCHED,
        TALLER,
    }


def test_each_drawing_is_seen_through_pixels_of_its_own(made: Turnaround) -> None:
    growth = {1: TALL, 3: LOW}
    pairs = [
        stretched(view, camera, growth[i]) if i in growth else (view, camera)
        for i, (view, camera) in enumerate(zip(made.views, made.cameras, strict=True))
    ]
    found = find_cameras([view for view, _ in pairs], made.mesh)
    assert proven(found) == {STRETCHED}
    assert found.verdict == "ok"
    points = made.mesh.vertices[::50]
    for fit, (view, camera) in zip(found.views, pairs, strict=True):
        assert fit.camera.size_wh == (view.rgba.shape[1], view.rgba.shape[0])
        assert fit.camera.pixel_aspect == pytest.approx(camera.pixel_aspect, rel=0.01)
        assert rotation_distance(fit.camera.rotation, camera.rotation) < np.radians(1.0)
        assert np.abs(fit.camera.project(points)[0] - camera.project(points)[0]).max() < 1.5
        assert fit.twin.pixel_aspect == fit.camera.pixel_aspect


@pytest.mark.parametrize(("seed", "looks"), [(6, STRETCHED), (12, TALLER)])
def test_drawing_error_is_no_stretch(seed: int, looks: str) -> None:
    drawn = replace(OPTIONS, outline_px=2, warp_percent=1.2)
    made = make_turnaround(random_body(seed), drawn, seed)
    found = find_cameras(made.views, made.mesh)
    gains = {model_test.name: model_test.bic_gain for model_test in found.model.tried}
    assert gains[looks] > BIC_MARGIN  # strong evidence by itself
    assert not proven(found)
    assert {view.camera.pixel_aspect for view in found.views} == {1.0}


def test_a_lower_mannequin_is_made_as_tall_as_the_drawings(made: Turnaround) -> None:
    low = stretch_mannequin(made.mesh, Stretches((), np.log(0.85), ()))
    found = find_cameras(made.views, low)
    assert proven(found) == {TALLER}
    assert found.verdict == "ok"
    assert {view.camera.pixel_aspect for view in found.views} == {1.0}
    tall, lower = np.ptp(found.mannequin[:, 1]), np.ptp(low.vertices[:, 1])
    assert tall / lower == pytest.approx(1 / 0.85, rel=0.01)
    assert found.mannequin[:, 1].min() == pytest.approx(low.vertices[:, 1].min(), abs=1e-6)
    for fit, camera in zip(found.views, made.cameras, strict=True):
        assert rotation_distance(fit.camera.rotation, camera.rotation) < np.radians(1.0)


def test_an_outline_without_its_stretch_is_that_of_the_drawing_without_it(made: Turnaround) -> None:
    view = made.views[0]
    tall, _ = stretched(view, made.cameras[0], TALL)
    across, down = np.array(tall.rgba.shape[1::-1]) / view.rgba.shape[1::-1]
    drawing = Drawing(drawn_contour(tall), 200.0, 400)
    straight = drawing.unstretched(float(np.log(down / across)))
    true = drawn_contour(view)
    middle = np.array(drawing.size_wh) / 2
    there = (straight.points - middle) / np.sqrt(across * down) / drawing.factor
    there += (middle + drawing.offset) / drawing.factor / (across, down)
    away = np.linalg.norm(there[:, None] - true.points[None], axis=2)
    assert np.quantile(away.min(axis=1), 0.95) < 0.6
    facing = (straight.normals * true.normals[away.argmin(axis=1)]).sum(axis=1)
    assert np.median(facing) > 0.99


def test_a_picture_without_its_stretch_loses_nothing() -> None:
    rgba = np.zeros((40, 30, 4), np.uint8)
    rgba[10:30, 5:25] = (200, 40, 40, 255)
    view = View(rgba, (3, 4, 30, 40), 0.0, "000.png", (-np.inf, -np.inf, np.inf, 30.0))
    for stretch, size_wh in ((np.log(1.5), (45, 40)), (-np.log(1.5), (30, 60))):
        longer = unstretch(view, stretch)
        assert longer.rgba.shape[1::-1] == size_wh
        assert longer.box == (3, 4, *size_wh)
        assert longer.ends[3] == 30 * size_wh[1] / 40
        _, _, width, height = cv2.boundingRect(longer.mask.astype(np.uint8))
        wanted = (20 * size_wh[0] / 30, 20 * size_wh[1] / 40)
        assert (width, height) == pytest.approx(wanted, abs=1)
        seen = longer.rgba[longer.rgba[..., 3] > 0]
        np.testing.assert_allclose(seen[:, :3], np.broadcast_to((200, 40, 40), (len(seen), 3)))
    assert unstretch(view, 0.0) is view


def test_cuts_are_told_in_the_drawings_own_pixels(made: Turnaround) -> None:
    found = find_cameras(made.views, made.mesh)
    shown = [unstretch(view, np.log(1.25)) for view in made.views]
    width, height = shown[0].rgba.shape[1::-1]
    side = FlatSide("right", width, ((40, 60),), at_edge=True)
    cut = CutOff(made.views[0].name, side, 10.0)
    told = as_drawn(replace(found, cuts=(cut,)), shown, made.views).cuts[0]
    own = made.views[0].rgba.shape[1]
    assert (told.flat.at, told.flat.spans) == (own, ((40, 60),))
    assert told.lost_px == pytest.approx(10 * own / width)
    assert height == made.views[0].rgba.shape[0]
