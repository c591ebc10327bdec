"""Convert between OpenCV and OpenGL conventions: the only place that knows them.

Inside toonset: OpenCV camera axes (x right, y down, z forward), first pixel's centre (0.5, 0.5).

| format                          | pose                    | camera axes | first pixel's centre |
|---------------------------------|-------------------------|-------------|----------------------|
| nerfstudio, instant-ngp, Blender| world_from_camera       | OpenGL      | (0.5, 0.5)           |
| COLMAP                          | camera_from_world, wxyz | OpenCV      | (0.5, 0.5)           |
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from toonset.errors import CameraError

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])  # camera axes; its own inverse
OPENGL_FROM_OPENCV.setflags(write=False)
EXACT = 1e-5  # of R R^T, as cameras need it
MOST_SCALE, MOST_SPREAD = 2e-3, 2.5e-4  # of R's stretch from 1, and between its axes: 4 decimals


def opencv_pose_from_opengl(transform_matrix: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
    """Return world_from_camera (OpenCV axes) of a NeRF `transform_matrix` (OpenGL axes)."""
    return np.asarray(transform_matrix, dtype=np.float64) @ OPENGL_FROM_OPENCV


def opengl_pose_from_opencv(
    world_from_camera: Float[np.ndarray, "4 4"],
) -> Float[np.ndarray, "4 4"]:
    """Return the NeRF `transform_matrix` (OpenGL axes) of a pose with OpenCV axes."""
    return np.asarray(world_from_camera, dtype=np.float64) @ OPENGL_FROM_OPENCV


def nearest_rotation(matrix: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the rotation that a rounded or slightly scaled matrix means.

    One that is a rotation already is returned as it is. Of a matrix of four decimals the rotation
    is off by at most 0.004 degrees; a scale of all three axes moves it not at all.

    Raises:
        CameraError: no rotation is near (a scaled, sheared or coarsely rounded matrix).

    Source: the orthogonal Procrustes problem (Schoenemann 1966).
    """
    if np.abs(matrix @ matrix.T - np.eye(3)).max() <= EXACT:
        return matrix
    left, stretch, right = np.linalg.svd(matrix)
    if abs(stretch.mean() - 1) > MOST_SCALE or np.ptp(stretch) > MOST_SPREAD:
        raise CameraError(
            f"camera: rotation is not orthonormal (it scales by {stretch.min():.5g} to "
            f"{stretch.max():.5g}); write rotations with 4 decimals or more and no scale"
        )
    return left @ right
