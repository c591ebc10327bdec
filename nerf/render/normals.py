"""Compute surface normals from a rendering's depth."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

from toonset.camera import Camera


def normals_of(
    depth: Float[np.ndarray, "height width"], camera: Camera
) -> Float[np.ndarray, "height width 3"]:
    """Return unit normals in the world, towards the viewer; nan where no neighbour is seen.

    Each is the cross product of the surface's ways right and down, each way over the nearer of the
    two neighbours in depth, so that it does not reach across an edge.
    """
    points = camera.unproject(camera.pixel_grid(), depth)
    right, down = (_nearer_difference(points, depth, axis) for axis in (1, 0))
    normal = np.cross(down, right)  # axes are right, down, forward: this points back at the viewer
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    return normal / np.where(length > 0, length, np.nan)


def normal_picture(
    depth: Float[np.ndarray, "height width"],
    alpha: Float[np.ndarray, "height width"],
    camera: Camera,
    *,
    in_camera: bool = False,
) -> UInt8[np.ndarray, "height width 4"]:
    """Return normals as RGB, (n + 1) / 2 with alpha.

    Args:
        depth: of a rendering.
        alpha: of the rendering.
        camera: it was rendered from.
        in_camera: red is right, green up, blue towards the viewer, as paint programs and engines
            read tangent space; else the world's x, y, z.
    """
    normal = normals_of(depth, camera)
    if in_camera:
        normal = normal @ camera.rotation.T * np.array([1.0, -1.0, -1.0])
    known = np.isfinite(normal).all(axis=-1)
    color = np.where(np.expand_dims(known, -1), normal, 0) / 2 + 0.5
    seen = np.where(known, alpha, 0)[..., None]
    return (np.concatenate([color, seen], axis=-1).clip(0, 1) * 255 + 0.5).astype(np.uint8)


def _nearer_difference(
    points: Float[np.ndarray, "height width 3"], depth: Float[np.ndarray, "height width"], axis: int
) -> Float[np.ndarray, "height width 3"]:
    step, leap = np.diff(points, axis=axis), np.abs(np.diff(depth, axis=axis))
    after, before = (_padded(step, axis, end) for end in (True, False))
    after_leap, before_leap = (_padded(leap, axis, end) for end in (True, False))
    nearer = np.nan_to_num(after_leap, nan=np.inf) <= np.nan_to_num(before_leap, nan=np.inf)
    return np.where(np.expand_dims(nearer, -1), after, before)


def _padded(values: np.ndarray, axis: int, end: bool) -> np.ndarray:
    sides = [(0, 0)] * values.ndim
    sides[axis] = (0, 1) if end else (1, 0)
    return np.pad(values, sides, constant_values=np.nan)
