"""Encode depth as a 16-bit picture, with the scale back to world units.

    depth = nearest + unit (level - 1),   level 0: nothing is seen

All pictures of a rendering share one scale, so that a turn can be compared with itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, UInt16

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
