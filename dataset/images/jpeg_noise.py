"""Detect JPEG compression of a sheet, and how far its ripples reach.

They end at the borders of 8 x 8 blocks, in columns and rows that repeat; nothing drawn does that.
Source: Z. Fan, R. L. de Queiroz, "Identification of bitmap compression history: JPEG detection and
quantizer estimation" (2003), for the idea: differences across block borders against those within.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

BLOCK = 8  # pixels
ROUNDING = 1.0  # levels
RIPPLE = 12  # levels above the grain: ripples, no edges
CLEARLY = 3.5  # standard deviations of chance, along both axes: about one sheet in 10^5 by chance
WITHIN = 0.15  # of the count at block borders: ripples change within blocks, enlarged pixels do not
STRAIGHT = 4.0  # times the mean count of a column: more is a straight edge of the drawing
MOST_PIXELS = 2**22  # that are looked at
HALO_WIDTH = 8  # levels: noise of the file falls off within about so many
CLEAR_HALO = 4.0  # times as many pixels as a little farther from the background: noise at all
HALO = 1.4  # times as many pixels as a little farther: still noise
SLOPE_RIPPLE = 1  # levels from the mean of the surroundings: rounding of a smooth slope


def has_jpeg_grid(away: UInt8[np.ndarray, "height width"], grain: float) -> bool:
    """Return whether small differences from the background end at the borders of blocks.

    Args:
        away: difference of every pixel from the background, in levels.
        grain: noise all over the background, in levels.
    """
    grain = max(grain, ROUNDING)  # whose pattern on a gradient repeats, too
    faint, near = away > grain, away <= grain + RIPPLE
    step = max(1, away.size // MOST_PIXELS)
    return _repeats(faint[::step], near[::step]) and _repeats(faint.T[::step], near.T[::step])


def halo_levels(
    away: UInt8[np.ndarray, "height width"], most: int, *, ripples: bool = False
) -> int:
    """Return how far, in levels, compression has spread the background's colour near figures.

    A soft edge passes all differences from the background equally often; ringing around edges
    (JPEG) adds small ones, the smaller the more. The level is where that decay ends. Slopes without
    ripples are shadows or shading, not noise.

    Args:
        away: difference of every pixel from the background, in levels.
        most: levels; it reaches no farther.
        ripples: the sheet is known to have them, and the decay begins where they are commonest;
            else it begins at once, and clearly, for chance makes small surpluses.
    """
    rippled = cv2.absdiff(away, cv2.blur(away, (5, 5))) > SLOPE_RIPPLE
    often = cv2.calcHist([away], [0], rippled.view(np.uint8), [256], [0, 256]).ravel()
    often = often.astype(np.float64)
    first = 1 + int(often[1 : HALO_WIDTH + 1].argmax()) if ripples else 1
    for level in range(first, most):
        here = often[level : level + 3].mean()
        beyond = np.median(often[level + HALO_WIDTH : level + 3 * HALO_WIDTH])
        surplus = CLEAR_HALO if level == 1 and not ripples else HALO
        if here <= surplus * beyond + 3 * np.sqrt(beyond) + 1:
            return level
    return most


def _repeats(
    faint: Bool[np.ndarray, "rows columns"], near: Bool[np.ndarray, "rows columns"]
) -> bool:
    """Return whether ripples begin or end at one column of every eight more often."""
    ends = (faint[:, 1:] != faint[:, :-1]) & near[:, 1:] & near[:, :-1]
    counts = np.count_nonzero(ends, axis=0).astype(np.float64)
    counts = np.minimum(counts, STRAIGHT * counts.mean()) if len(counts) else counts
    phases = np.sort([counts[phase::BLOCK].sum() for phase in range(BLOCK)])
    elsewhere = phases[:-1].mean()
    clear = phases[-1] - elsewhere > CLEARLY * np.sqrt(elsewhere + phases[-1] / BLOCK + 1)
    return bool(clear and np.median(phases[:-1]) >= WITHIN * phases[-1])
