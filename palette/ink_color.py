"""The colour of thin dark strokes, which soft edges leave next to no flat pixel of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.palette.pixels import Histogram

LEAST_SHARE = 0.02  # of the pixels are middles of strokes, or there are no lines worth a colour
EXACT = 0.2  # of the middles: so frequent an exact colour is the ink itself
CORE = 0.25  # of the middles, the darkest: the others hold some of what lies beside the stroke
DARKEST = 0.1  # of the middles: if these are black but for the noise, so is the ink
PAINTS = 0.05  # of the flat pixels, the darkest: the darkest paint is among them


@dataclass(frozen=True)
class Ink:
    """The colour that thin dark strokes are drawn with, and its pixels in their middles."""

    rgb: tuple[int, int, int]
    pixels: int


def find_ink(histogram: Histogram) -> Ink | None:
    """Return the strokes' ink; None without strokes, or if they are no darker than the paints.

    In a clean picture it is the colour that most middles share. Noise, and chroma stored at half
    size, leave no such colour: there it is the mean of the darkest middles.
    """
    thin = histogram.thin
    total = int(thin.sum())
    if total < LEAST_SHARE * histogram.counts.sum():
        return None
    best = int(thin.argmax())
    if thin[best] >= EXACT * total:
        return Ink(rounded(histogram.colors[best]), total)
    light = histogram.colors.astype(np.int64).mean(axis=1)
    core = light <= _quantile(light, thin, CORE)
    rgb = np.average(histogram.colors[core], axis=0, weights=thin[core])
    if rgb.mean() + 2 * histogram.noise >= _quantile(light, histogram.flat, PAINTS):
        return None
    if _quantile(light, thin, DARKEST) <= histogram.noise:
        return Ink((0, 0, 0), total)
    return Ink(rounded(rgb), total)


def _quantile(
    values: Float[np.ndarray, " n"], weights: Int[np.ndarray, " n"], share: float
) -> float:
    """Return the value below which `share` of the weights lies."""
    order = np.argsort(values)
    reached = np.searchsorted(np.cumsum(weights[order]), share * weights.sum())
    return float(values[order][min(int(reached), len(values) - 1)])


def rounded(rgb: Float[np.ndarray, " 3"] | UInt8[np.ndarray, " 3"]) -> tuple[int, int, int]:
    """Return a colour as whole 8-bit numbers."""
    red, green, blue = (round(float(channel)) for channel in rgb)
    return red, green, blue
