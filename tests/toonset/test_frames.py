"""Conventions: each conversion against the library that owns the convention."""

import cv2
import numpy as np
import pycolmap
import pytest
import torch
from kornia.geometry.camera import PinholeCamera

from toonset import frames
from toonset.camera import Camera, rotation_from_angles
from toonset.projection import project_offsets, rotate

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


def test_opencv_projects_the_same_pixels():
    view = camera()
    rotation = view.camera_from_world[:3, :3]
    rvec, tvec = cv2.Rodrigues(rotation)[0], view.camera_from_world[:3, 3]
    K = view.K.copy()
    K[:2, 2] = frames.opencv_from_pixels(K[:2, 2])
    projected = cv2.projectPoints(POINTS, rvec, tvec, K, None)[0][:, 0]
    np.testing.assert_allclose(
        frames.pixels_from_opencv(projected), view.project(POINTS)[0], atol=1e-6
    )


@pytest.mark.parametrize("yaw", [0.0, 1.0, 2.2, np.pi, -3.0])
def test_colmap_projects_the_same_pixels(yaw):
    view = camera(yaw=yaw)
    rotation, translation = view.camera_from_world[:3, :3], view.camera_from_world[:3, 3]
    rigid = pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), translation)
    K = view.K
    lens = pycolmap.Camera(
        model="PINHOLE", width=160, height=180, params=[K[0, 0], K[1, 1], K[0, 2], K[1, 2]]
    )
    pixels = np.array([lens.img_from_cam(rigid * point) for point in POINTS], dtype=float)
    np.testing.assert_allclose(pixels.reshape(-1, 2), view.project(POINTS)[0], atol=1e-6)


def batch(views):
    return (
        torch.from_numpy(np.stack([v.rotation for v in views])),
        torch.from_numpy(np.stack([v.center for v in views])),
        torch.tensor([[v.scale, v.scale * v.pixel_aspect] for v in views], dtype=torch.float64),
        torch.tensor([v.k for v in views], dtype=torch.float64),
        torch.from_numpy(np.stack([POINTS - v.target for v in views])),
    )


def test_torch_projection_equals_numpy():
    views = [camera(k) for k in (0.0, 1e-6, 0.2)]
    rotation, center, scale, k, offsets = batch(views)
    pixels = project_offsets(rotation, center, scale, k, offsets)
    for i, view in enumerate(views):
        np.testing.assert_allclose(pixels[i], view.project(POINTS)[0], atol=1e-9)


def test_torch_projection_has_no_pixel_behind_a_pinhole():
    rotation, center, scale, k, offsets = batch([camera(0.2)])
    behind = offsets - 8.0 * rotation[:, 2][:, None]
    assert torch.isnan(project_offsets(rotation, center, scale, k, behind)).all()


def test_torch_projection_is_differentiable_through_k_zero():
    rotation, center, scale, k, offsets = batch([camera(0.0)])

    def pixels(turn, shift, log_scale, depth_k):
        turned = rotate(rotation, turn)
        return project_offsets(
            turned, center + shift, scale * log_scale.exp(), k + depth_k, offsets[:, :5]
        )

    zeros = [torch.zeros(s, dtype=torch.float64, requires_grad=True) for s in ((1, 3), (1, 2))]
    zeros += [torch.zeros(s, dtype=torch.float64, requires_grad=True) for s in ((1, 1), (1,))]
    assert torch.autograd.gradcheck(pixels, tuple(zeros), atol=1e-5)


def test_kornia_cameras_project_the_same_pixels():
    views = [camera(0.2), camera(0.05, yaw=-1.0)]
    points = torch.from_numpy(POINTS)[None].repeat(2, 1, 1)
    intrinsics = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    intrinsics[:, :3, :3] = torch.from_numpy(np.stack([view.K for view in views]))
    extrinsics = torch.from_numpy(np.stack([view.camera_from_world for view in views]))
    size = torch.tensor([float(n) for n in views[0].size_wh]).repeat(2, 1)
    pinholes = PinholeCamera(intrinsics, extrinsics, size[:, 1], size[:, 0])
    pixels = pinholes.project(points)
    for i, view in enumerate(views):
        np.testing.assert_allclose(pixels[i], view.project(POINTS)[0], atol=1e-5)
