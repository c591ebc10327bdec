"""Depth without gaps, and without the mixtures of near and far that lie on steps."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float

from toonset.raster import nearest, taken

SQUARE = np.ones((3, 3), dtype=np.uint8)


def filled(depth: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return depth with every gap as deep as the nearest pixel that has one; 0 without any."""
    seen = np.isfinite(depth)
    if not seen.any():
        return np.zeros(depth.shape, dtype=np.float32)
    return taken(depth, nearest(seen)).astype(np.float32)


def crisp_depth(depth: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return depth without gaps and without mixtures of near and far."""
    return crisp(filled(depth))


def crisp(depth: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return depth, which has no gaps, without mixtures of near and far.

    A pixel on a step shows the mean of both sides; it goes to the side that it is nearer to.
    """
    low, high = cv2.erode(depth, SQUARE), cv2.dilate(depth, SQUARE)
    nearer = np.minimum(depth, (depth + low) / 2)
    farther = np.maximum(depth, (depth + high) / 2)
    return np.where(depth - low < high - depth, nearer, farther)
