"""Where one ray per pixel is not enough, and where more of them go."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

RAYS_PER_SIDE = 2  # of a pixel on a border
TOLERANCE = 0.15  # difference of neighbours that makes a border
CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=np.uint8)


def borders(
    values: Float[np.ndarray, "channels height width"],
    labels: Int[np.ndarray, "height width"],
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels that differ from one of their four neighbours.

    Args:
        values: what is seen at the pixels' centres, in [0, 1]: colour, opacity.
        labels: differ or not.
    """
    found = _range(labels.astype(np.float32)) > 0
    for channel in values:
        found |= _range(channel) > TOLERANCE
    return found


def _range(values: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    return cv2.dilate(values, CROSS) - cv2.erode(values, CROSS)


def places_within(
    chosen: Bool[np.ndarray, "height width"], side: int = RAYS_PER_SIDE
) -> Float[np.ndarray, "n rays 2"]:
    """Return where `side` x `side` rays go through each chosen pixel (first centre at 0.5)."""
    rows, columns = np.nonzero(chosen)
    part = (np.arange(side) + 0.5) / side
    down, right = (grid.reshape(-1) for grid in np.meshgrid(part, part, indexing="ij"))
    return np.stack([columns[:, None] + right, rows[:, None] + down], axis=-1)
