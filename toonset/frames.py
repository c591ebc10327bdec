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

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])  # camera axes; its own inverse
OPENGL_FROM_OPENCV.setflags(write=False)


def opencv_pose_from_opengl(transform_matrix: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
    """Return world_from_camera (OpenCV axes) of a NeRF `transform_matrix` (OpenGL axes)."""
    return np.asarray(transform_matrix, dtype=np.float64) @ OPENGL_FROM_OPENCV


def opengl_pose_from_opencv(
    world_from_camera: Float[np.ndarray, "4 4"],
) -> Float[np.ndarray, "4 4"]:
    """Return the NeRF `transform_matrix` (OpenGL axes) of a pose with OpenCV axes."""
    return np.asarray(world_from_camera, dtype=np.float64) @ OPENGL_FROM_OPENCV
