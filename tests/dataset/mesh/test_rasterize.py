"""A mesh as a camera sees it: depth and normals at pixel centres."""

import math

import numpy as np
import pytest

from toonset.camera import Camera
from toonset.dataset.mesh.rasterize import depth_and_normals, depth_map, face_numbers

SIZE = (120, 90)


def looking(yaw: float, k: float, elevation: float = 0.0, shift: float = 0.0) -> Camera:
    middle = np.array(SIZE) / 2 + shift
    return Camera.looking_at(np.zeros(3), yaw, elevation, 40.0, SIZE, 0.0, middle, k)


def square(z: float, half: float) -> tuple[np.ndarray, np.ndarray]:
    x, y = half * np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]])
    return np.stack([x, y, np.full(4, z)], axis=1), np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("k", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("yaw", [0.0, 0.5, -1.1])
@pytest.mark.parametrize("shift", [0.0, 7.3])  # the principal point off the picture's middle
def test_depth_of_a_tilted_square_is_exact(k: float, yaw: float, shift: float) -> None:
    camera = looking(yaw, k, 0.2, shift)
    vertices, faces = square(0.2, 0.6)
    depth = depth_map(vertices, faces, camera)
    row, column = np.nonzero(np.isfinite(depth))
    pixels = np.stack([column, row], axis=1) + 0.5
    points = camera.unproject(pixels, depth[row, column])
    np.testing.assert_allclose(points[:, 2], 0.2, atol=1e-3)
    assert np.abs(points[:, :2]).max() == pytest.approx(0.6, abs=0.04)
    if k == 0:
        covered = (1.2 * 40) ** 2 * abs(float(camera.rotation[2, 2]))
        assert len(row) == pytest.approx(covered, rel=0.05)


@pytest.mark.parametrize("k", [0.0, 0.2])
def test_the_nearer_surface_hides_the_other(k: float) -> None:
    near, far = square(0.5, 0.3), square(-0.5, 0.6)
    vertices = np.concatenate([near[0], far[0]])
    faces = np.concatenate([far[1] + 4, near[1]])  # whichever comes first
    depth = depth_map(vertices, faces, looking(0.0, k))
    middle, beside = depth[45, 60], depth[45, 60 + 16]
    assert middle == pytest.approx(-0.5, abs=2e-3)
    assert beside == pytest.approx(0.5, abs=2e-3)
    assert np.isinf(depth[0, 0])


@pytest.mark.parametrize("k", [0.0, 0.2])
@pytest.mark.parametrize("yaw", [0.0, 0.6, math.pi])
def test_normals_point_towards_the_viewer_however_faces_are_wound(k: float, yaw: float) -> None:
    camera = looking(yaw, k)
    vertices, faces = square(0.0, 0.5)
    turned = np.concatenate([faces[:1], faces[1:, ::-1]])
    depth, normal = depth_and_normals(vertices, turned, camera)
    seen = np.isfinite(depth)
    np.testing.assert_array_equal(depth, depth_map(vertices, turned, camera))
    side = camera.rotation @ np.array([0, 0, 1.0])
    np.testing.assert_allclose(
        normal[seen], np.broadcast_to(side, (seen.sum(), 3)) * -np.sign(side[2]), atol=1e-6
    )
    assert not normal[~seen].any()


def test_points_that_coincide_in_depth_are_seen() -> None:
    vertices, faces = square(0.0, 0.5)
    depth = depth_map(vertices, faces, looking(0.0, 0.0))
    assert np.isfinite(depth).sum() == 1600
    np.testing.assert_allclose(depth[np.isfinite(depth)], 0, atol=1e-6)


def test_a_camera_sees_nothing_of_what_is_behind_it() -> None:
    vertices, faces = square(20.0, 0.6)  # yaw 0 looks from +Z: behind a pinhole at 5
    camera = looking(0.0, 0.2)
    assert np.isinf(depth_map(vertices, faces, camera)).all()
    assert not depth_and_normals(vertices, faces, camera)[1].any()


@pytest.mark.parametrize("distance", [1e3, 1e4, 1e6, 1e8])
def test_far_pinholes_keep_their_depth(distance: float) -> None:
    vertices, faces = square(0.2, 0.6)
    depth = depth_map(vertices, faces, looking(0.0, 1 / distance))
    seen = np.isfinite(depth)
    assert seen.sum() == pytest.approx((1.2 * 40) ** 2, rel=0.05)
    np.testing.assert_allclose(depth[seen], -0.2, atol=2e-3)


def test_pixels_have_the_number_of_the_triangle_that_their_centre_lies_in() -> None:
    size, middle = (23, 17), np.array([8.3, 7.1])
    across, down = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    around = np.linspace(0, 2 * np.pi, 10)
    rim = middle + 6.7 * np.stack([np.cos(around), np.sin(around)], axis=-1)
    corners = np.stack([np.tile(middle, (9, 1)), rim[:-1], rim[1:]], axis=1)
    wanted = np.full(across.shape, -1)
    for number, (a, b, c) in enumerate(corners):
        sides = [
            (q[0] - p[0]) * (down - p[1]) - (q[1] - p[1]) * (across - p[0])
            for p, q in ((a, b), (b, c), (c, a))
        ]
        wanted[np.min(sides, axis=0) > 0] = number
    np.testing.assert_array_equal(face_numbers(corners, size), wanted)
