"""Cameras from landmarks alone: what they are called, and when."""

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from toonset.calib.from_landmarks import calibrate_by_landmarks
from toonset.calib.result import Calibration
from toonset.camera import Camera, rotation_distance, rotation_from_angles
from toonset.dataset.mannequin.landmark_file import Landmarks
from toonset.dataset.mesh.rasterize import silhouette_mask
from toonset.errors import LandmarkError
from toonset.mesh import Mesh
from toonset.view import View

SIZE = (160, 160)
HEIGHT_PX = 120.0


@pytest.fixture(scope="module")
def body() -> Mesh:
    return random_body(4)


def camera_at(body: Mesh, yaw_deg: float, k: float = 0.0) -> Camera:
    rotation = rotation_from_angles(np.radians(yaw_deg), 0.15, 0.0)
    return Camera(rotation, body.middle, HEIGHT_PX / body.height, np.full(2, 80.0), SIZE, k)


def drawn(body: Mesh, camera: Camera, number: int) -> View:
    pixels, faces = camera.project(body.vertices)[0], body.faces.astype(np.int32)
    alpha = np.where(silhouette_mask(pixels, faces, SIZE), 255, 0).astype(np.uint8)
    rgba = np.dstack([np.zeros((*SIZE, 3), np.uint8), alpha])
    return View(rgba, (0, 0, *SIZE), 0.0, f"{number:03d}.png")


def points_of(body: Mesh, count: int) -> np.ndarray:
    rng = np.random.default_rng(count)
    return body.vertices[[int((body.vertices @ w).argmax()) for w in rng.normal(size=(count, 3))]]


def solved(
    body: Mesh, camera: Camera, points: np.ndarray, off: float | np.ndarray = 0.0
) -> Calibration:
    names = tuple(f"p{i}" for i in range(len(points)))
    marks = Landmarks("000.png", names, points, camera.project(points)[0] + off)
    return calibrate_by_landmarks([drawn(body, camera, 0)], body, [marks])


@pytest.mark.parametrize("k", [0.0, 0.15])
@pytest.mark.parametrize("yaw", [0.0, 130.0, 270.0])
def test_exact_clicks_give_the_exact_camera(body, yaw, k):
    camera = camera_at(body, yaw, k)
    found = solved(body, camera, points_of(body, 10))
    view = found.views[0]
    assert (found.verdict, view.verdict, view.reason) == ("ok", "ok", "")
    assert rotation_distance(view.camera.rotation, camera.rotation) < 1e-4
    assert view.camera.scale == pytest.approx(camera.scale, rel=1e-4)
    assert view.camera.k == pytest.approx(k, abs=1e-5)
    assert view.coverage > 0.95  # measured, though not fitted
    assert found.model.is_perspective is (k > 0)
    np.testing.assert_array_equal(found.mannequin, body.vertices)


@pytest.mark.parametrize("seed", range(3))
def test_sigmas_are_those_of_repeated_clicks(body, seed):
    """Noise of 1 % of the height, which is also what is expected before looking."""
    rng = np.random.default_rng(seed)
    camera, points = camera_at(body, 30.0), points_of(body, 12)
    scores = []
    for _ in range(12):
        view = solved(body, camera, points, rng.normal(0, 1.2, (12, 2))).views[0]
        off = np.array(view.camera.angles) - np.array(camera.angles)
        scores += [off[0] / view.sigmas.yaw, off[1] / view.sigmas.elevation]
    assert 0.5 < float(np.std(scores)) < 1.6


def test_points_in_a_plane_are_ambiguous(body):
    flat = points_of(body, 8)
    flat[:, 2] = 0.0
    found = solved(body, camera_at(body, 35.0), flat)
    view = found.views[0]
    assert (found.verdict, view.verdict) == ("ambiguous", "ambiguous")
    assert "fits as well" in view.reason
    assert len(view.alternatives) == 1
    assert view.alternatives[0].probability == pytest.approx(0.5, abs=0.05)


def test_a_misplaced_pair_is_weak_and_named(body):
    off = np.zeros((10, 2))
    off[3] = 30.0
    view = solved(body, camera_at(body, 35.0), points_of(body, 10), off).views[0]
    assert view.verdict == "weak"
    assert view.reason == "landmarks that do not fit the others: p3"


def test_pixels_of_another_figure_fail(body):
    rng = np.random.default_rng(1)
    off = rng.normal(0, 25.0, (5, 2))
    view = solved(body, camera_at(body, 35.0), points_of(body, 5), off).views[0]
    assert view.verdict == "failed"
    assert "do not fit" in view.reason


def test_points_close_together_are_weak(body):
    rng = np.random.default_rng(2)
    near = body.middle + 0.05 * body.height * rng.normal(size=(6, 3))
    view = solved(body, camera_at(body, 35.0), near).views[0]
    assert view.verdict == "weak"
    assert "hardly tell" in view.reason


def test_views_without_landmarks_are_named(body):
    camera = camera_at(body, 0.0)
    views = [drawn(body, camera, i) for i in range(3)]
    points = points_of(body, 6)
    marks = Landmarks("001.png", tuple("abcdef"), points, camera.project(points)[0])
    with pytest.raises(LandmarkError, match=r"no landmarks for 000\.png, 002\.png; give three"):
        calibrate_by_landmarks(views, body, [None, marks, None])
