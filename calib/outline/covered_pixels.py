"""Rasterise a projected surface's coverage from its fold edges alone.

Give every triangle the same turning sense in the image. Over a pixel the number of triangles then
is the winding number of the sum of their borders. In that sum an edge between two triangles that
lie side by side cancels; what remains are the folds (two triangles on one side of their edge) and
the free borders. So a few hundred edges decide coverage, exactly, for closed and open surfaces.

Source of the sweep: accumulation of signed crossings along a row, as in scan conversion of glyphs.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int


def covered(
    start: Float[np.ndarray, "folds 2"],
    end: Float[np.ndarray, "folds 2"],
    layers: Int[np.ndarray, " folds"],
    size_wh: tuple[int, int],
) -> Bool[np.ndarray, "height width"]:
    """Return which pixel centres lie under at least one triangle.

    Args:
        start: one end of every fold, pixels.
        end: the other end.
        layers: triangles more on the side (-dv, du) of the direction start to end than on the
            other one.
        size_wh: of the picture; folds may leave it.
    """
    width, height = size_wh
    (u0, v0), (u1, v1) = start.T, end.T
    # rows whose centre r + 0.5 lies in [low, high): a corner shared by two edges counts once
    first = np.ceil(np.clip(np.minimum(v0, v1), 0, height) - 0.5).astype(np.intp)
    count = np.ceil(np.clip(np.maximum(v0, v1), 0, height) - 0.5).astype(np.intp) - first
    which = np.repeat(np.arange(len(count)), count)
    row = np.arange(len(which)) - np.repeat(np.cumsum(count) - count - first, count)
    slope = (u1 - u0)[which] / (v1 - v0)[which]
    crossing = u0[which] + (row + 0.5 - v0[which]) * slope
    column = np.ceil(np.clip(crossing, 0, width) - 0.5).astype(np.intp)
    # a fold that runs down the picture has the side (-dv, du) to its left
    step = np.where(v1 > v0, -layers, layers).astype(np.int32)[which]
    change = np.zeros((height, width + 1), dtype=np.int32)
    np.add.at(change.ravel(), row * (width + 1) + column, step)
    return change.cumsum(axis=1, dtype=np.int32)[:, :width] > 0
