"""Conventions: each conversion against the library that owns the convention."""

import numpy as np
import pytest
import torch

from toonset import frames
from toonset.camera import Camera, rotation_from_angles
from toonset.projection import CameraTensors, project, project_with_jacobian, rotate

POINTS = np.random.default_rng(0).uniform(-0.8, 0.8, (60, 3))


def camera(k=0.2, yaw=2.2):
    rotation = rotation_from_angles(yaw, 0.3, -0.1)
    return Camera(rotation, np.array([0.1, 0.5, 0.0]), 120.0, np.array([80.0, 90.0]), (160, 180), k)


def test_opengl_conversion_is_its_own_inverse_and_flips_y_and_z():
    pose = camera().world_from_camera
    there = frames.opengl_pose_from_opencv(pose)
    np.testing.assert_allclose(frames.opencv_pose_from_opengl(there), pose)
    np.testing.assert_allclose(there[:3, 2], -pose[:3, 2])  # OpenGL looks along -z
    np.testing.assert_allclose(there[:3, 3], pose[:3, 3])


def cameras():
    return [camera(k, yaw) for k, yaw in ((0.0, 0.3), (0.2, 2.0), (1e-6, -1.0))]


@pytest.mark.parametrize("device", ["cpu", *(["cuda"] if torch.cuda.is_available() else [])])
def test_torch_projects_the_same_pixels(device):
    pixels = project(cameras(), torch.from_numpy(POINTS)[None].to(device))
    assert pixels.device.type == device
    for found, view in zip(pixels.cpu(), cameras(), strict=True):
        np.testing.assert_allclose(found, view.project(POINTS)[0], atol=1e-9)


def test_torch_projection_has_no_pixel_behind_a_pinhole():
    behind = camera().target - 8 * camera().rotation[2]
    assert torch.isnan(project([camera()], torch.from_numpy(behind)[None, None])).all()


def test_torch_projection_is_differentiable_in_cameras_and_points_through_k_zero():
    held = CameraTensors.of(cameras())

    def pixels(turn, target, center, scale_uv, k, points):
        return project(
            CameraTensors(rotate(held.rotation, turn), target, center, scale_uv, k), points
        )

    parts = [torch.zeros(3, 3), held.target, held.center, held.scale_uv, held.k]
    parts += [torch.rand(1, 5, 3, generator=torch.Generator().manual_seed(0))]
    free = [part.double().clone().requires_grad_() for part in parts]
    assert torch.autograd.gradcheck(pixels, tuple(free), atol=1e-5)


def test_torch_jacobian_is_the_derivative_by_turn_centre_log_scale_and_k():
    held, points = CameraTensors.of(cameras()), torch.from_numpy(POINTS)[None].expand(3, -1, -1)

    def pixels(step):
        turned, moved = rotate(held.rotation, step[:, :3]), held.center + step[:, 3:5]
        scales = held.scale_uv * step[:, 5:6].exp()
        return project(
            CameraTensors(turned, held.target, moved, scales, held.k + step[:, 6]), points
        )

    expected = torch.func.jacfwd(pixels)(torch.zeros(3, 7, dtype=torch.float64))
    seen, slopes = project_with_jacobian(held, points)
    assert torch.equal(seen, project(held, points))
    own = torch.stack([expected[view, ..., view, :] for view in range(3)])
    torch.testing.assert_close(slopes, own)
