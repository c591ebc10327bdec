"""Which pixels are mixtures: the soft pixels between two colours, which are nobody's colour."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, UInt8

OPAQUE = 250  # of 255: less alpha is an edge of the figure
LEAST_STEP = 24.0  # levels (L2 over channels) between two colours for a blend to matter
ON_PATH = 1.1  # detour over the pixel, as a multiple of the straight way: more is no blend
DIRECTIONS = ((0, 1), (1, 0), (1, 1), (1, -1))


def opaque_pixels(rgba: UInt8[np.ndarray, "height width 4"]) -> Bool[np.ndarray, "height width"]:
    """Return the pixels that the figure covers wholly."""
    return rgba[..., 3] >= OPAQUE


def mixed_pixels(rgba: UInt8[np.ndarray, "height width 4"]) -> Bool[np.ndarray, "height width"]:
    """Return the pixels whose colour lies between those of two opposite neighbours.

    Neighbours that are not opaque say nothing. A line's core is no mixture: it lies at the end,
    not between; nor is a shade within a slow gradient, whose neighbours hardly differ.
    """
    opaque = np.pad(opaque_pixels(rgba), 1)
    colors = np.pad(rgba[..., :3], ((1, 1), (1, 1), (0, 0))).astype(np.float32)
    height, width = rgba.shape[:2]
    here = colors[1:-1, 1:-1]
    mixed = np.zeros((height, width), dtype=bool)
    for down, right in DIRECTIONS:
        before = (slice(1 - down, height + 1 - down), slice(1 - right, width + 1 - right))
        after = (slice(1 + down, height + 1 + down), slice(1 + right, width + 1 + right))
        way = _distance(colors[before], colors[after])
        first, second = _distance(here, colors[before]), _distance(here, colors[after])
        between = (first + second <= ON_PATH * way) & (np.minimum(first, second) > 0.1 * way)
        mixed |= between & (way > LEAST_STEP) & opaque[before] & opaque[after]
    return mixed & opaque[1:-1, 1:-1]


def _distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    difference = a - b
    return np.sqrt(np.einsum("hwc,hwc->hw", difference, difference))
