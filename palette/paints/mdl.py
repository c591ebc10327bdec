"""Choose the number of paints by minimum description length.

Two touching clouds of shades are one paint if a single hump describes them about as well as two. A
cloud is described by the best one-humped density (isotonic regression) along the line that parts
both best, to a quarter of a just-noticeable distance. Two humps cost one more colour, 24 bits and
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

from toonset.palette.colors import JUST_NOTICEABLE
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

    The most superfluous pair goes first. And the bits that undoing the last merge would cost, or
    one more colour for nothing.

    Args:
        places: in OKLab.
        weights: shares of the flat pixels; their sum is 1.
        owner: every cell's peak, itself a cell.
        touching: only clouds with cells this near are ever merged.
    """
    owner, dearest = owner.copy(), PRICE_BITS
    bits = {
        pair: saved_bits(places, weights, owner, *pair)
        for pair in _touching(places, owner, touching)
    }
    while bits and min(bits.values()) < 0:
        pair = min(bits, key=lambda pair: (bits[pair], pair))
        dearest = -bits[pair]
        kept, gone = sorted(pair, key=lambda peak: (-weights[owner == peak].sum(), peak))
        owner[owner == gone] = kept
        met = {other for known in bits if {kept, gone} & set(known) for other in known}
        bits = {known: saved for known, saved in bits.items() if not {kept, gone} & set(known)}
        for other in met - {kept, gone}:
            new = (min(kept, other), max(kept, other))
            bits[new] = saved_bits(places, weights, owner, *new)
    return owner, dearest


def evidence_for(places: Places, weights: Weights, owner: Owners, one_more: float) -> Evidence:
    """Return how many paints pay for themselves, and what one of them less would cost.

    Paints apart from all others stay, however small; those that do not pay are not counted.
    """
    peaks, shares = np.unique(owner), np.bincount(owner, weights)
    bits = _neighbours(places, weights, owner)
    unpaid = {min(pair, key=lambda peak: shares[peak]) for pair, saved in bits.items() if saved < 0}
    in_full = PIXELS * 24 - PRICE_BITS  # without any colour to name: every pixel's own
    one_less = min((saved for saved in bits.values() if saved >= 0), default=in_full)
    return Evidence(len(peaks) - len(unpaid), one_less, one_more)


def _neighbours(places: Places, weights: Weights, owner: Owners) -> dict[tuple[int, int], float]:
    """Return the bits that every peak saves against joining the nearest peak."""
    peaks = np.unique(owner)
    away = np.linalg.norm(places[peaks][:, None] - places[peaks], axis=2)
    np.fill_diagonal(away, np.inf)
    nearest = peaks[away.argmin(axis=1)]
    pairs = {
        (int(min(p, n)), int(max(p, n))) for p, n in zip(peaks, nearest, strict=True) if p != n
    }
    return {pair: saved_bits(places, weights, owner, *pair) for pair in pairs}


def saved_bits(places: Places, weights: Weights, owner: Owners, first: int, second: int) -> float:
    """Return the bits that two paints save against one for both peaks' cells."""
    parts = [np.flatnonzero(owner == peak) for peak in (first, second)]
    axis = _axis([places[part] for part in parts], [weights[part] for part in parts])
    at = [np.rint(places[part] @ axis / BIN).astype(int) for part in parts]
    low = min(int(one.min()) for one in at) - 2  # the smoothing reaches so far
    length = max(int(one.max()) for one in at) - low + 3
    humps = [
        np.convolve(np.bincount(one - low, PIXELS * weights[part], length), SMOOTHING, "same")
        for one, part in zip(at, parts, strict=True)
    ]
    tops = [round(float(places[peak] @ axis / BIN)) - low for peak in (first, second)]
    apart = sum(_hump_bits(hump, (top,)) for hump, top in zip(humps, tops, strict=True))
    amounts = [float(hump.sum()) for hump in humps]
    which = sum(amount * np.log2(sum(amounts) / amount) for amount in amounts)
    return _hump_bits(humps[0] + humps[1], tops) - apart - float(which) - PRICE_BITS


def _axis(places: list[Places], weights: list[Weights]) -> Float[np.ndarray, " 3"]:
    """Return the unit direction along which two clouds lie farthest apart for their widths.

    Source: R. A. Fisher, "The use of multiple measurements in taxonomic problems" (1936).
    """
    spread = BIN**2 * np.eye(3)
    middles = []
    for own, weight in zip(places, weights, strict=True):
        middle = np.average(own, axis=0, weights=weight)
        spread += (own - middle).T @ ((own - middle) * weight[:, None]) / weight.sum()
        middles.append(middle)
    axis = np.linalg.solve(spread, middles[1] - middles[0])
    return axis / max(float(np.linalg.norm(axis)), 1e-9)


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
