"""Estimate the colour of thin dark strokes, which have next to no flat pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.palette.paints.histogram import Histogram

LEAST_SHARE = 0.03  # of the pixels are middles of strokes, or there are no lines worth a colour
EXACT = 0.2  # of an ink or a paint: so frequent an exact colour is that itself
CORE = 0.25  # of the middles, the darkest: the others hold some of what lies beside the stroke
DARKEST = 0.1  # of the middles: if these are black but for the noise, so is the ink
MOST_FLAT = 0.3  # of the pixels as dark as middles; more of them are a dark paint, not strokes


@dataclass(frozen=True)
class Ink:
    """The colour that thin dark strokes are drawn with.

    Attributes:
        rgb: 8-bit sRGB.
        pixels: in the strokes' middles.
        dark: levels, mean over channels; half of the middles are no lighter.
    """

    rgb: tuple[int, int, int]
    pixels: int
    dark: float


def find_ink(histogram: Histogram) -> Ink | None:
    """Return the strokes' ink; None without strokes, or if a dark paint looks the same.

    In a clean picture it is the colour that most middles share. Noise, and chroma stored at half
    size, leave no such colour: there it is the mean of the darkest middles.
    """
    thin = histogram.thin
    total = int(thin.sum())
    if total < LEAST_SHARE * histogram.counts.sum():
        return None
    light = histogram.colors.astype(np.float64).mean(axis=1)
    dark = _quantile(light, thin, 0.5)
    best = int(thin.argmax())
    if thin[best] >= EXACT * total:
        return Ink(rounded(histogram.colors[best]), total, dark)
    alike = light <= dark + histogram.noise
    if histogram.flat[alike].sum() > MOST_FLAT * histogram.counts[alike].sum():
        return None
    if _quantile(light, thin, DARKEST) <= histogram.noise:
        return Ink((0, 0, 0), total, dark)
    core = light <= _quantile(light, thin, CORE)
    return Ink(rounded(np.average(histogram.colors[core], axis=0, weights=thin[core])), total, dark)


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
