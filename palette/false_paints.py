"""Which paints are none: colours that only blends of two others have, along long straight edges."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float

LEAST_FLAT = 0.3  # of a paint's pixels are flat; of a blend's, next to none
NEAREST_END = 0.1  # of the way between two paints: nearer to one of them it is that one
LEAST_REACH = 4.0  # levels from the straight line between two colours: rounding, gamma


def false_paints(
    rgb: Float[np.ndarray, "paints 3"], solid: Bool[np.ndarray, " paints"], noise: int
) -> Bool[np.ndarray, " paints"]:
    """Return which paints lie between two solid ones without being solid.

    Args:
        rgb: 0 to 255.
        solid: drawn flat, or as the ink of strokes: never a blend.
        noise: levels; of the picture.
    """
    reach = max(LEAST_REACH, 1.5 * noise)
    between = np.zeros(len(rgb), dtype=bool)
    for first, second in combinations(np.flatnonzero(solid), 2):
        way = rgb[second] - rgb[first]
        along = (rgb - rgb[first]) @ way / max(float(way @ way), 1e-9)
        beside = np.linalg.norm(rgb - rgb[first] - along[:, None] * way, axis=1)
        inside = (along > NEAREST_END) & (along < 1 - NEAREST_END)
        between |= inside & (beside <= reach)
    return between & ~solid
