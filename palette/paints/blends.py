"""Reject colours that are only blends of two others, along edges and in thin strokes."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float

from toonset.palette.paints.line_color import Ink

LEAST_FLAT = 0.3  # of a paint's pixels are flat; of a blend's, next to none
NEAREST_END = 0.1  # of the way between two paints: nearer to one of them it is that one
LEAST_REACH = 4.0  # levels from the straight line between two colours: rounding, gamma


def false_paints(
    rgb: Float[np.ndarray, "paints 3"],
    solid: Bool[np.ndarray, " paints"],
    noise: int,
    ink: Ink | None,
) -> Bool[np.ndarray, " paints"]:
    """Return which paints are not solid and lie between two solid ones, or are as dark as strokes.

    Args:
        rgb: 0 to 255.
        solid: drawn flat, or as the ink of strokes: never false.
        noise: levels; of the picture.
        ink: of the strokes.
    """
    reach = reach_of(noise)
    false = rgb.mean(axis=1) <= (-1 if ink is None else ink.dark)
    for first, second in combinations(np.flatnonzero(solid), 2):
        way = rgb[second] - rgb[first]
        along = (rgb - rgb[first]) @ way / max(float(way @ way), 1e-9)
        beside = np.linalg.norm(rgb - rgb[first] - along[:, None] * way, axis=1)
        inside = (along > NEAREST_END) & (along < 1 - NEAREST_END)
        false |= inside & (beside <= reach)
    return false & ~solid


def reach_of(noise: int) -> float:
    """Return how many levels from the straight line between two colours their blends may lie."""
    return max(LEAST_REACH, 1.5 * noise)
