"""Encode depth as a 16-bit picture, with the scale back to world units; compute normals from it.

    depth = nearest + unit (level - 1),   level 0: nothing is seen

All pictures of a rendering share one scale, so that a turn can be compared with itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8, UInt16

from toonset.camera import Camera
from toonset.nerf.hull.hull import Hull

LEVELS = 65534  # that say a depth


@dataclass(frozen=True)
class DepthLevels:
    """A scale of levels.

    Attributes:
        nearest: depth of level 1, world units past the plane through the camera's target.
        unit: world units per level.
    """

    nearest: float
    unit: float

    @classmethod
    def of(cls, hull: Hull, cameras: Sequence[Camera]) -> DepthLevels:
        """Return the scale that holds whatever the cameras see of a hull."""
        box = hull.box
        corners = np.stack(np.meshgrid(*zip(box.low, box.high, strict=True)), axis=-1)
        depths = [camera.project(corners.reshape(-1, 3))[1] for camera in cameras]
        nearest, farthest = float(np.min(depths)), float(np.max(depths))
        return cls(nearest, (farthest - nearest) / (LEVELS - 1))

    def picture(
        self, depth: Float[np.ndarray, "height width"]
    ) -> UInt16[np.ndarray, "height width"]:
        """Return the levels of a depth map, which is nan where nothing is seen."""
        level = np.rint((depth - self.nearest) / self.unit).clip(0, LEVELS - 1) + 1
        return np.nan_to_num(level, nan=0).astype(np.uint16)

    def depth(
        self, levels: UInt16[np.ndarray, "height width"]
    ) -> Float[np.ndarray, "height width"]:
        """Return the depth map of a picture, nan where nothing is seen."""
        return np.where(levels > 0, self.nearest + self.unit * (levels - 1.0), np.nan)

    def to_json(self, files: Sequence[str]) -> dict[str, Any]:
        """Return what a program needs to read the pictures `files`."""
        return {
            "depth": "nearest + unit * (level - 1), world units past the plane through the "
            "camera's target; level 0: nothing is seen",
            "nearest": self.nearest,
            "unit": self.unit,
            "files": list(files),
        }


def normals_of(
    depth: Float[np.ndarray, "height width"], camera: Camera
) -> Float[np.ndarray, "height width 3"]:
    """Return unit normals in the world, towards the viewer; nan where no neighbour is seen.

    Each is the cross product of the surface's ways right and down, each way over the nearer of the
    two neighbours in depth, so that it does not reach across an edge.
    """
    points = np.moveaxis(camera.unproject(camera.pixel_grid(), depth), -1, 0).copy()
    (a, b, c), (d, e, f) = (_nearer_difference(points, depth, axis) for axis in (0, 1))
    # down x right: axes are right, down, forward, so that this points back at the viewer
    normal = np.stack([b * f - c * e, c * d - a * f, a * e - b * d])
    length = np.sqrt((normal**2).sum(axis=0))
    return np.moveaxis(normal / np.where(length > 0, length, np.nan), 0, -1)


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
    picture = np.full((*depth.shape, 4), (128, 128, 128, 0), np.uint8)
    rows, columns = (np.flatnonzero(np.isfinite(depth).any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return picture
    box = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    size = (int(columns[-1] - columns[0]) + 1, int(rows[-1] - rows[0]) + 1)
    normal = normals_of(depth[box], camera.moved((columns[0], rows[0]), size))
    if in_camera:
        normal = normal @ camera.rotation.T * np.array([1.0, -1.0, -1.0])
    known = np.asarray(np.isfinite(normal).all(axis=-1))
    color = np.where(known[..., None], normal, 0) / 2 + 0.5
    seen = np.where(known, alpha[box], 0)
    picture[box] = (np.dstack([color, seen]).clip(0, 1) * 255 + 0.5).astype(np.uint8)
    return picture


def _nearer_difference(
    points: Float[np.ndarray, "3 height width"], depth: Float[np.ndarray, "height width"], axis: int
) -> Float[np.ndarray, "3 height width"]:
    """Return the way to the next place along an axis, or from the one before, if that is nearer."""
    step = np.diff(points, axis=axis + 1, append=np.nan)
    leap = np.nan_to_num(np.abs(np.diff(depth, axis=axis, append=np.nan)), nan=np.inf)
    return np.where(leap <= np.roll(leap, 1, axis), step, np.roll(step, 1, axis + 1))
