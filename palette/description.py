"""How many paints there are: as many as make the shortest description of the pixels.

Two touching clouds of shades are one paint if a single hump describes them about as well as two. A
cloud is described by the best one-humped density along the line between the two peaks (isotonic
regression), to a quarter of a just-noticeable distance. Two humps cost one more colour, 24 bits and
its share; they save

    bits(one hump for both) - bits(a hump each) - bits(which of both)

A gradient is flat between its ends and noise has one peak: neither saves anything. Two flat paints
have a valley between them that one hump must fill. Neighbouring pixels are copies of each other, so
bits are counted for 4,096 independent pixels, however large the drawing: scaling changes nothing.
Source: J. Rissanen, "Modeling by shortest data description" (1978); colours' share: half a log.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float, Int

from toonset.palette.oklab import JUST_NOTICEABLE
from toonset.palette.palette import Evidence

PIXELS = 4096  # independent ones
PRICE_BITS = 24 + 0.5 * float(np.log2(PIXELS))  # of a colour: its red, green and blue, its share
BIN = JUST_NOTICEABLE / 4
SMOOTHING = np.array([1, 2, 3, 2, 1]) / 9  # 8-bit levels of dark colours lie two bins apart

Places = Float[np.ndarray, "cells 3"]
Weights = Float[np.ndarray, " cells"]
Owners = Int[np.ndarray, " cells"]


def merge_peaks(
    places: Places, weights: Weights, owner: Owners, touching: float
) -> tuple[Owners, float]:
    """Return every cell's peak after all merges that shorten the description.

    And the bits that undoing the last of them would cost, or one more colour for nothing.

    Args:
        places: in OKLab.
        weights: shares of the flat pixels; their sum is 1.
        owner: every cell's peak, itself a cell.
        touching: only clouds with cells this near are ever merged.
    """
    owner = owner.copy()
    savings = {
        pair: saved_bits(places, weights, owner, *pair)
        for pair in _touching(places, owner, touching)
    }
    last = PRICE_BITS
    while savings:
        pair = min(savings, key=lambda pair: (savings[pair], pair))
        if savings[pair] >= 0:
            break
        last = -savings.pop(pair)
        kept, gone = sorted(pair, key=lambda peak: (-weights[owner == peak].sum(), peak))
        owner[owner == gone] = kept
        met = {other for known in savings for other in known if {kept, gone} & set(known)}
        savings = {known: bits for known, bits in savings.items() if not {kept, gone} & set(known)}
        for other in met - {kept, gone}:
            new = (min(kept, other), max(kept, other))
            savings[new] = saved_bits(places, weights, owner, *new)
    return owner, last


def evidence_for(places: Places, weights: Weights, owner: Owners, one_more: float) -> Evidence:
    """Return what one paint less would cost: of all pairs of neighbours, the cheapest joined."""
    peaks = np.unique(owner)
    if len(peaks) < 2:
        return Evidence(1, PIXELS * 24 - PRICE_BITS, one_more)  # each pixel's colour in full
    away = np.linalg.norm(places[peaks][:, None] - places[peaks], axis=2)
    np.fill_diagonal(away, np.inf)
    pairs = np.unique(np.sort([(peaks, peaks[away.argmin(axis=1)])], axis=1)[0], axis=1).T
    one_less = min(saved_bits(places, weights, owner, int(a), int(b)) for a, b in pairs)
    return Evidence(len(peaks), one_less, one_more)


def saved_bits(places: Places, weights: Weights, owner: Owners, first: int, second: int) -> float:
    """Return the bits that two paints save against one for both peaks' cells."""
    a, b = owner == first, owner == second
    axis = places[second] - places[first]
    axis = axis / max(float(np.linalg.norm(axis)), 1e-9)
    along = (places[a | b] @ axis - places[first] @ axis) / BIN
    at = np.rint(along).astype(int)
    low, length = at.min() - 2, int(np.ptp(at)) + 5
    counts = PIXELS * weights[a | b]
    humps = [
        np.convolve(
            np.bincount(at[mask[a | b]] - low, counts[mask[a | b]], length), SMOOTHING, "same"
        )
        for mask in (a, b)
    ]
    ends = [0 - low, round(float((places[second] - places[first]) @ axis / BIN)) - low]
    apart = sum(_hump_bits(h, (end,)) for h, end in zip(humps, ends, strict=True))
    total = [float(h.sum()) for h in humps]
    which = sum(n * np.log2(sum(total) / n) for n in total)
    return _hump_bits(humps[0] + humps[1], ends) - apart - float(which) - PRICE_BITS


def _hump_bits(counts: Float[np.ndarray, " bins"], peaks: Iterable[int]) -> float:
    """Return the bits of samples under the best density that rises to one peak and then falls."""
    from scipy.optimize import isotonic_regression

    best = np.inf
    for peak in peaks:
        rising = isotonic_regression(counts[: peak + 1]).x
        falling = isotonic_regression(counts[peak:], increasing=False).x
        hump = np.concatenate([rising[:-1], [max(rising[-1], falling[0])], falling[1:]])
        some = counts > 0
        bits = -float((counts[some] * np.log2(hump[some] / hump.sum())).sum())
        best = min(best, bits)
    return best


def _touching(places: Places, owner: Owners, reach: float) -> set[tuple[int, int]]:
    from scipy.spatial import KDTree

    near = KDTree(places).query_pairs(reach, output_type="ndarray")
    pairs = np.sort(owner[near], axis=1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    return {(int(first), int(second)) for first, second in pairs}
