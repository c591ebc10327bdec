"""Place cameras that turn round a trained figure."""

from __future__ import annotations

import math

import numpy as np

from toonset.camera import Camera
from toonset.errors import UsageError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import Hull

FILL = 0.94  # of the picture's side that the figure may take


def turntable(
    trained: TrainedField, count: int, elevation: float = 0.0, size: int | None = None
) -> tuple[Camera, ...]:
    """Return `count` cameras at equal turns, the first in front, all at one scale.

    Args:
        trained: the figure; cameras see as far (or as parallel) as its training cameras.
        count: number of views, yaw rising.
        elevation: radians, > 0 looks down.
        size: side of the square pictures, px; None: as the training pictures.

    Raises:
        UsageError: no view, or pictures without a pixel.
    """
    if count < 1 or (size is not None and size < 1):
        raise UsageError(f"turntable: {count} views of {size} px; 1 or more of each are needed")
    side = size or trained.size_px
    low, high = filled_box(trained.hull)
    target = (low + high) / 2
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    corners = low + corners * (high - low)
    yaws = [2 * math.pi * i / count for i in range(count)]
    unit = [
        Camera.looking_at(target, yaw, elevation, 1.0, (side, side), k=trained.k) for yaw in yaws
    ]
    reach = max(float(np.abs(c.project(corners)[0] - c.center).max()) for c in unit)
    scale = FILL * side / 2 / reach
    return tuple(
        Camera.looking_at(target, yaw, elevation, scale, (side, side), k=trained.k) for yaw in yaws
    )


def filled_box(hull: Hull) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest corner of what is inside the hull."""
    cells = np.argwhere(hull.inside.numpy())
    return hull.low + hull.voxel * cells.min(axis=0), hull.low + hull.voxel * (
        cells.max(axis=0) + 1
    )
