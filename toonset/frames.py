"""Conversions between OpenCV, OpenGL and COLMAP conventions: the only place that knows them.

Inside toonset: OpenCV camera axes (x right, y down, z forward), first pixel's centre (0.5, 0.5).

| format                          | pose                    | camera axes | first pixel's centre |
|---------------------------------|-------------------------|-------------|----------------------|
| OpenCV (`cv2.solvePnP`)         | camera_from_world       | OpenCV      | (0, 0)               |
| nerfstudio, instant-ngp, Blender| world_from_camera       | OpenGL      | (0.5, 0.5)           |
| COLMAP                          | camera_from_world, wxyz | OpenCV      | (0.5, 0.5)           |
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])  # camera axes; its own inverse
OPENGL_FROM_OPENCV.setflags(write=False)
OPENCV_PIXEL_OFFSET = 0.5  # ours = OpenCV's + 0.5


def opencv_pose_from_opengl(
    transform_matrix: Float[np.ndarray, "4 4"],
) -> Float[np.ndarray, "4 4"]:
    """Return world_from_camera (OpenCV axes) of a NeRF `transform_matrix` (OpenGL axes)."""
    return np.asarray(transform_matrix, dtype=np.float64) @ OPENGL_FROM_OPENCV


def opengl_pose_from_opencv(
    world_from_camera: Float[np.ndarray, "4 4"],
) -> Float[np.ndarray, "4 4"]:
    """Return the NeRF `transform_matrix` (OpenGL axes) of a pose with OpenCV axes."""
    return np.asarray(world_from_camera, dtype=np.float64) @ OPENGL_FROM_OPENCV


def pixels_from_opencv(pixels_opencv: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
    """Return pixels with (0.5, 0.5) centres from OpenCV's integer centres."""
    return np.asarray(pixels_opencv, dtype=np.float64) + OPENCV_PIXEL_OFFSET


def opencv_from_pixels(pixels: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
    """Return OpenCV's integer-centred pixels from ours."""
    return np.asarray(pixels, dtype=np.float64) - OPENCV_PIXEL_OFFSET


def colmap_from_pose(
    world_from_camera: Float[np.ndarray, "4 4"],
) -> tuple[Float[np.ndarray, " 4"], Float[np.ndarray, " 3"]]:
    """Return COLMAP's (quaternion_wxyz with w >= 0, translation) of cam_from_world."""
    rotation = np.asarray(world_from_camera, dtype=np.float64)[:3, :3].T
    translation = -rotation @ world_from_camera[:3, 3]
    return _quaternion_wxyz(rotation), translation


def pose_from_colmap(
    quaternion_wxyz: Float[np.ndarray, " 4"], translation: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "4 4"]:
    """Return world_from_camera (OpenCV axes) of COLMAP's cam_from_world."""
    w, x, y, z = np.asarray(quaternion_wxyz, dtype=np.float64) / np.linalg.norm(quaternion_wxyz)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    pose = np.eye(4)
    pose[:3, :3] = rotation.T
    pose[:3, 3] = -rotation.T @ translation
    return pose


def _quaternion_wxyz(rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 4"]:
    """Return the unit quaternion with w >= 0 (largest-component branch, stable at 180 degrees).

    Source: Bar-Itzhack 2000, eigenvector of the symmetric 4x4 matrix of the rotation.
    """
    m = rotation
    k = np.array(
        [
            [m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [0, m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [0, 0, m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1]],
            [0, 0, 0, m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    quaternion = np.linalg.eigh(k.T)[1][:, -1]
    return quaternion if quaternion[0] >= 0 else -quaternion
