"""Laws of the camera: inverse pairs, composition, nesting, twins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toonset.camera import Camera, angles_from_rotation, rotation_distance, rotation_from_angles
from toonset.errors import CameraError

ANGLE = st.floats(-math.pi + 1e-3, math.pi - 1e-3)
ELEVATION = st.floats(-1.4, 1.4)
K = st.sampled_from([0.0, 1e-9, 1e-4, 0.02, 0.2])


def make(yaw=0.3, elevation=0.1, roll=0.05, k=0.0, aspect=1.0) -> Camera:
    rotation = rotation_from_angles(yaw, elevation, roll)
    return Camera(
        rotation, np.array([0.1, 0.9, -0.2]), 140.0, np.array([101.5, 148.0]), (200, 300), k, aspect
    )


@settings(max_examples=60, deadline=None)
@given(yaw=ANGLE, elevation=ELEVATION, roll=ANGLE, k=K, aspect=st.sampled_from([1.0, 0.8]))
def test_project_inverts_unproject(yaw, elevation, roll, k, aspect):
    camera = make(yaw, elevation, roll, k, aspect)
    rng = np.random.default_rng(0)
    pixels, depth = rng.uniform(-50, 350, (40, 2)), rng.uniform(-1.5, 1.5, 40)
    again, again_depth, in_front = camera.project(camera.unproject(pixels, depth))
    assert in_front.all()
    np.testing.assert_allclose(again, pixels, atol=1e-6)
    np.testing.assert_allclose(again_depth, depth, atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(yaw=ANGLE, elevation=ELEVATION, k=K, aspect=st.sampled_from([1.0, 0.8]))
def test_whole_pictures_are_projected_as_single_points_are(yaw, elevation, k, aspect):
    camera, other = make(yaw, elevation, 0.1, k, aspect), make(yaw + 2.5, 0.2, 0.0, 0.3, aspect)
    depth = np.random.default_rng(0).uniform(-1.5, 4.5, camera.size_wh[::-1])
    points = camera.unproject(camera.pixel_grid(), depth)
    np.testing.assert_allclose(camera.unproject_grid(depth), points, atol=1e-9)
    for one in (camera, other):  # of the other some lie behind
        pixels, own_depth, front = one.project(points)
        found, its_depth, its_front = one.project_grid(points)
        np.testing.assert_array_equal(its_front, front)
        np.testing.assert_allclose(np.moveaxis(found, 0, -1), pixels, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(its_depth, own_depth, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(yaw=ANGLE, elevation=ELEVATION, roll=st.floats(-1.5, 1.5))
def test_angles_invert_rotation(yaw, elevation, roll):
    found = angles_from_rotation(rotation_from_angles(yaw, elevation, roll))
    np.testing.assert_allclose(found, (yaw, elevation, roll), atol=1e-7)


def test_yaw_elevation_and_roll_mean_what_the_convention_says():
    def sees(camera, point):
        return camera.project(np.array(point))[0]

    front = Camera.looking_at(np.zeros(3), 0.0, 0.0, 10.0, (100, 100))
    np.testing.assert_allclose(sees(front, [1.0, 0, 0]), [60, 50])  # left hand: right in the image
    np.testing.assert_allclose(sees(front, [0.0, 1, 0]), [50, 40])  # up is up
    left = Camera.looking_at(np.zeros(3), math.pi / 2, 0.0, 10.0, (100, 100), k=0.1)
    np.testing.assert_allclose(left.world_from_camera[:3, 3], [10, 0, 0], atol=1e-12)
    above = Camera.looking_at(np.zeros(3), 0.0, 0.5, 10.0, (100, 100), k=0.1)
    assert above.world_from_camera[1, 3] > 0
    rolled = Camera.looking_at(np.zeros(3), 0.0, 0.0, 10.0, (100, 100), roll=math.pi / 2)
    np.testing.assert_allclose(sees(rolled, [0.0, 1, 0]), [60, 50], atol=1e-9)  # clockwise


def test_pinhole_agrees_with_its_matrices():
    camera = make(k=0.15, aspect=0.9)
    points = np.random.default_rng(1).uniform(-1, 1, (30, 3))
    homogeneous = np.c_[points, np.ones(30)] @ camera.camera_from_world.T
    image = homogeneous[:, :3] @ camera.K.T
    np.testing.assert_allclose(camera.project(points)[0], image[:, :2] / image[:, 2:], atol=1e-9)
    again = Camera.from_pinhole(camera.world_from_camera, camera.K, camera.size_wh)
    np.testing.assert_allclose(again.project(points)[0], camera.project(points)[0], atol=1e-8)


@pytest.mark.parametrize("k", [1e-3, 1e-6, 1e-9])
def test_k_to_zero_is_continuous(k):
    points = np.random.default_rng(2).uniform(-1, 1, (50, 3))
    flat, near = make(k=0.0).project(points)[0], make(k=k).project(points)[0]
    assert np.abs(near - flat).max() <= 140 * 3 * 2 * k  # scale * |x| * |z| * k


def test_behind_the_camera_is_said_and_has_no_pixel():
    camera = Camera.looking_at(np.zeros(3), 0.0, 0.0, 10.0, (100, 100), k=0.5)  # centre at z = 2
    pixels, _, in_front = camera.project(np.array([[0.0, 0, 1.9], [0, 0, 2.0], [0.3, 0, 5]]))
    assert in_front.tolist() == [True, False, False]
    assert np.isfinite(pixels[0]).all()
    assert np.isnan(pixels[1:]).all()


@pytest.mark.parametrize("k", [0.0, 0.2])
def test_rays_pass_through_what_is_seen(k):
    camera = make(k=k)
    points = np.random.default_rng(3).uniform(-1, 1, (20, 3))
    origins, directions = camera.rays(camera.project(points)[0])
    along = ((points - origins) * directions).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(origins + along * directions, points, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)


def test_far_pinhole_stays_within_its_bound():
    camera = make()
    points = camera.target + np.random.default_rng(4).uniform(-0.7, 0.7, (500, 3))
    radius = float(np.linalg.norm(points - camera.target, axis=1).max())
    error = np.abs(camera.as_pinhole(80).project(points)[0] - camera.project(points)[0])
    bound = camera.pinhole_error_px(80, radius)
    assert error.max() <= bound
    assert bound < 10 * np.linalg.norm(error, axis=1).max()  # and the bound says something


@pytest.mark.parametrize("k", [0.0, 0.1])
def test_crop_and_resize_move_pixels_as_they_should(k):
    camera = make(k=k)
    points = np.random.default_rng(5).uniform(-1, 1, (20, 3))
    pixels = camera.project(points)[0]
    np.testing.assert_allclose(
        camera.moved((12, -5), (90, 80)).project(points)[0], pixels - [12, -5]
    )
    np.testing.assert_allclose(camera.resized(0.5).project(points)[0], pixels * 0.5)


def test_twin_gives_a_symmetric_body_the_same_outline_points():
    camera = make(yaw=0.7, elevation=0.3)
    rng = np.random.default_rng(6)
    half = rng.uniform(-1, 1, (40, 3))
    body = np.concatenate([half, half * [-1, 1, 1]])
    pixels, twin_pixels = camera.project(body)[0], camera.twin().project(body)[0]
    swapped = np.roll(twin_pixels, 40, axis=0)  # x -> -x exchanges the halves
    np.testing.assert_allclose(swapped, pixels, atol=1e-9)
    yaw, elevation, _ = camera.twin().angles
    np.testing.assert_allclose((yaw, elevation), (math.pi - 0.7, -0.3), atol=1e-9)
    assert rotation_distance(camera.twin().twin().rotation, camera.rotation) < 1e-7


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rotation": 2 * np.eye(3)}, "not orthonormal"),
        ({"rotation": np.diag([1.0, 1, -1])}, "mirrors"),
        ({"scale": 0.0}, "must be positive"),
        ({"scale": math.nan}, "not finite"),
        ({"k": -0.1}, "not negative"),
        ({"size_wh": (0, 3)}, "must be positive"),
        ({"target": np.zeros(2)}, "shapes"),
    ],
)
def test_impossible_cameras_are_refused(change, words):
    values = {
        "rotation": np.eye(3),
        "target": np.zeros(3),
        "scale": 1.0,
        "center": np.zeros(2),
        "size_wh": (4, 4),
    }
    with pytest.raises(CameraError, match=words):
        Camera(**(values | change))


def test_an_orthographic_camera_has_no_k_matrix():
    with pytest.raises(CameraError, match="as_pinhole"):
        _ = make().K
