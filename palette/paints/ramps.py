"""Find the paints of shaded drawings: patches of one hue in more or less light.

A paint's colours lie near a line in OKLab, its ramp: lightness L as the light falls, a and b along
with it, about a / L and b / L times as much. What a paint's patches cost, in squares of deviations:

    sum n (c - line(L))^2 / HUE_SPREAD^2 + (slope - ray)^2 / SLOPE_SPREAD^2
    + sum n (L - mean L)^2 / LIGHT_SPREAD^2

Two paints become one while that costs less than `PRICE`, what a paint costs to describe. Hue is
told fine, light is not: every part of a paint may be lit as it likes. A price is paid by pixels: of
a large paint, two halves that nobody can tell apart would each be worth theirs. So two paints are
one, too, whose ramps differ by less than `SAME` half-way between their middles, each unit of
lightness between these counted `SAME_LIGHT` times.

Sources: J. H. Ward, "Hierarchical grouping to optimize an objective function" (1963); J. Rissanen,
"Modeling by shortest data description" (1978); G. D. Finlayson and others, "Entropy minimization
for shadow removal" (2009): shading moves a colour along one line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.palette.pixels.patches import DARKEST, Patches

HUE_SPREAD = 0.014  # in OKLab: off its ramp a patch of a paint lies by so much
LIGHT_SPREAD = 0.6  # lightness of a paint's patches
SLOPE_SPREAD = 0.1  # of a ramp off the ray through black
UNIT_PX = 16.0  # pixels that count as one: neighbours are copies of each other
RIM = 0.1  # weight of a patch's pixels next to another patch
LEAST, MOST = 0.01, 60.0  # weights of patches: a large one's pixels are copies of each other
PRICE = 50.0
SAME, SAME_LIGHT = 0.01, 0.1  # in OKLab; of lightness: ramps nearer to each other are one

Weights = Float[np.ndarray, " n"]
Sums = Float[np.ndarray, "n 3"]
Squares = Float[np.ndarray, "n 3 3"]


@dataclass(frozen=True, eq=False)
class Moments:
    """Weights, sums and sums of products of colours, one row per paint."""

    weight: Weights
    total: Sums
    square: Squares

    def at(self, rows: Int[np.ndarray, " m"] | Bool[np.ndarray, " n"]) -> Moments:
        """Return some rows."""
        return Moments(self.weight[rows], self.total[rows], self.square[rows])

    @property
    def mean(self) -> Sums:
        """Return the mean colours."""
        return self.total / self.weight[:, None]

    @property
    def slope(self) -> Float[np.ndarray, "n 2"]:
        """Return how much a and b change with lightness."""
        return _slopes(self)[0]


def moments_of(patches: Sequence[Patches]) -> Moments:
    """Return the moments of patches, each a row."""
    pixels, inner, mean, spread = (
        np.concatenate([getattr(one, name) for one in patches])
        for name in ("pixels", "inner", "mean", "spread")
    )
    weight = np.minimum((inner + RIM * (pixels - inner)) / UNIT_PX, MOST) + LEAST
    product = mean[:, :, None] * mean[:, None, :] + spread
    return Moments(weight, weight[:, None] * mean, weight[:, None, None] * product)


def join_patches(patches: Moments) -> Int[np.ndarray, " patches"]:
    """Return the paint of every patch, numbered from 0.

    Time and memory grow with the square of the patches.
    """
    count = len(patches.weight)
    group = np.arange(count)
    if count < 2:
        return group
    weight, total, square = patches.weight.copy(), patches.total.copy(), patches.square.copy()
    own, alive = costs(patches), np.ones(count, dtype=bool)

    def joint(one: int) -> Weights:
        both = Moments(weight[one] + weight, total[one] + total, square[one] + square)
        cost = costs(both) - own[one] - own
        cost[one] = np.inf
        cost[~alive] = np.inf
        return cost

    table = np.stack([joint(one) for one in range(count)])
    best = table.argmin(axis=1)
    least = table[np.arange(count), best]
    while alive.sum() > 1:
        kept = int(least.argmin())
        gone = int(best[kept])
        if least[kept] > PRICE:
            break
        for part in (weight, total, square):
            part[kept] += part[gone]
        own[kept] = costs(Moments(weight, total, square).at(np.array([kept])))[0]
        alive[gone] = False
        group[group == gone] = kept
        table[gone], table[:, gone], least[gone] = np.inf, np.inf, np.inf
        table[kept] = table[:, kept] = joint(kept)
        stale = alive & ((best == kept) | (best == gone))
        stale[kept] = True
        closer = alive & (table[:, kept] < least)
        best[closer], least[closer] = kept, table[closer, kept]
        rows = np.flatnonzero(stale)
        best[rows] = table[rows].argmin(axis=1)
        least[rows] = table[rows, best[rows]]
    return _alike_united(patches, np.unique(group, return_inverse=True)[1])


def joined(patches: Moments, group: Int[np.ndarray, " patches"]) -> Moments:
    """Return the moments of groups of patches."""
    count = int(group.max(initial=-1)) + 1
    weight = np.bincount(group, patches.weight, count)
    total, square = np.zeros((count, 3)), np.zeros((count, 3, 3))
    np.add.at(total, group, patches.total)
    np.add.at(square, group, patches.square)
    return Moments(weight, total, square)


def _alike_united(
    patches: Moments, group: Int[np.ndarray, " patches"]
) -> Int[np.ndarray, " patches"]:
    """Return groups of patches, those as one that are the same ramp in the same light."""
    while True:
        paints = joined(patches, group)
        light, hue = paints.mean[:, 0], paints.mean[:, 1:]
        between = (light[None, :] - light[:, None]) / 2
        there = hue[:, None] + paints.slope[:, None] * between[..., None]
        apart = np.linalg.norm(there - there.transpose(1, 0, 2), axis=-1)
        apart += SAME_LIGHT * 2 * np.abs(between)
        np.fill_diagonal(apart, np.inf)
        one, other = np.unravel_index(int(apart.argmin()), apart.shape)
        if apart[one, other] > SAME:
            return group
        group = np.unique(np.where(group == other, one, group), return_inverse=True)[1]


def costs(paints: Moments) -> Weights:
    """Return what every paint's patches cost: see the module's equation."""
    _, hue, light = _slopes(paints)
    return light / LIGHT_SPREAD**2 + hue


def _slopes(paints: Moments) -> tuple[Float[np.ndarray, "n 2"], Weights, Weights]:
    """Return slopes of a and b against lightness, what they leave, and squares of lightness."""
    mean = paints.mean
    off = paints.square - paints.weight[:, None, None] * mean[:, :, None] * mean[:, None, :]
    light = np.maximum(off[:, 0, 0], 0)
    ray = mean[:, 1:] / np.maximum(mean[:, :1], DARKEST)
    known = light[:, None] / HUE_SPREAD**2 + 1 / SLOPE_SPREAD**2
    drawn = off[:, 0, 1:] / HUE_SPREAD**2 + ray / SLOPE_SPREAD**2
    across = np.stack([off[:, 1, 1], off[:, 2, 2]], axis=1)
    left = across / HUE_SPREAD**2 + ray**2 / SLOPE_SPREAD**2 - drawn**2 / known
    return drawn / known, np.maximum(left, 0).sum(axis=1), light
