"""Compare the side profiles of a sheet's figures.

The views of a turnaround show one character: what a cut leaves should look from the cut's side as
some figure of the sheet does from its left or its right. Opposite views are mirror images of each
other, so left and right sides are compared alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Bool, Float

ROWS = 96  # at which a figure's side is measured, from its top to its feet
CAP = 0.08  # of the height: a larger difference counts no more
SHIFTS = (30, 50, 70)  # percentiles of the differences: how far one side is laid over the other


def right_flank(mask: Bool[np.ndarray, "height width"]) -> Float[np.ndarray, " rows"]:
    """Return how far right a figure reaches, row by row, in heights; NaN in empty rows."""
    filled = np.flatnonzero(mask.any(axis=1))
    figure = mask[filled[0] : filled[-1] + 1]
    height, width = figure.shape
    reach = np.where(figure.any(axis=1), width - np.argmax(figure[:, ::-1], axis=1), np.nan)
    rows = ((np.arange(ROWS) + 0.5) / ROWS * height).astype(int)
    return reach[rows] / height


def flanks(mask: Bool[np.ndarray, "height width"]) -> tuple[np.ndarray, np.ndarray]:
    """Return a figure's right side and its left one as if it were the right one."""
    return right_flank(mask), right_flank(mask[:, ::-1])


def largest_piece(mask: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """Return the largest connected piece of a mask, which is not empty."""
    _, found, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    piece: Bool[np.ndarray, "height width"] = found == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
    return piece


def unlikeness(
    flank: Float[np.ndarray, " rows"], others: Sequence[Float[np.ndarray, " rows"]]
) -> float:
    """Return how far a side is from the most similar of others, in heights; `CAP` at most."""
    return min((_difference(flank, other) for other in others), default=CAP)


def _difference(a: Float[np.ndarray, " rows"], b: Float[np.ndarray, " rows"]) -> float:
    apart = a - b
    apart = apart[np.isfinite(apart)]
    if len(apart) < ROWS / 2:
        return CAP
    shifts = np.percentile(apart, SHIFTS)
    return float(np.minimum(np.abs(apart - shifts[:, None]), CAP).mean(axis=1).min())
