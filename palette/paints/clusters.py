"""Cluster flat colours into paints by quick shift: one per colour that a painter would name.

Flat pixels are counted in small cells of RGB. Every cell points to the nearest cell that is denser
than itself, if that lies within a just-noticeable distance; cells that point nowhere are peaks,
each with its shades. Peaks whose shades touch (gradients, noise) are one paint unless two have the
shorter description. Nothing depends on the order of pixels.
Source: A. Vedaldi, S. Soatto, "Quick shift and kernel methods for mode seeking" (2008).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.palette.colors import JUST_NOTICEABLE, even_oklab_from_rgb
from toonset.palette.paints.blends import LEAST_FLAT, false_paints
from toonset.palette.paints.histogram import Histogram, distinct
from toonset.palette.paints.line_color import EXACT, Ink, find_ink, rounded
from toonset.palette.paints.mdl import evidence_for, merge_peaks
from toonset.palette.palette import Evidence

CELL = 4  # levels per side of a counting cell
MOST_CELLS = 4096  # the fullest; the others, of noisy pictures, join the nearest paint
TOUCHING = 1.5 * JUST_NOTICEABLE  # shades with a wider gap between them are not of one paint
LEAST_PEAK = 0.002  # of the flat pixels; less is not a paint, but joins the nearest
UNLIKE = 4 * JUST_NOTICEABLE  # from all paints' shades: nobody takes it for one of them
FEW = 4  # flat pixels: a block of 2 x 2

Owners = Int[np.ndarray, " cells"]


@dataclass(frozen=True, eq=False)
class Paint:
    """One colour with its shades.

    Attributes:
        rgb: the flat paint if there is one, else the mean around the peak.
        members: positions in the histogram of the colours that are nearest to it.
        is_ink: thin dark strokes are drawn with it.
    """

    rgb: tuple[int, int, int]
    members: Int[np.ndarray, " members"]
    is_ink: bool = False


@dataclass(frozen=True, eq=False)
class Found:
    """The colours of a histogram.

    Attributes:
        paints: in no useful order; every colour of the histogram is a member of one.
        evidence: why there are so many.
        specks: positions in the histogram of colours alike that cover too little to be a paint, but
            are unlike all paints' shades.
    """

    paints: list[Paint]
    evidence: Evidence
    specks: list[Int[np.ndarray, " members"]]


def find_paints(histogram: Histogram) -> Found:
    """Return the paints, and rare colours that are unlike all of them."""
    ink = find_ink(histogram)
    cells, cell_of = _cells(histogram, ink)
    peaks = _peaks(cells)
    owner = _only(cells, peaks, _shares(cells, peaks) >= LEAST_PEAK)
    owner, dearest = merge_peaks(cells.places, cells.weights, owner, TOUCHING)
    paints, solid = _paints(histogram, cells, owner[cell_of], owner)
    rgb = np.array([paint.rgb for paint in paints], dtype=np.float64)
    false = false_paints(rgb, solid, histogram.noise, ink)
    keep = np.zeros(len(owner), dtype=bool)
    keep[np.unique(owner)[~false]] = True
    specks = _specks(histogram, cells, cell_of, peaks, keep[owner])
    if false.any():
        owner = _only(cells, owner, keep)
        paints, _ = _paints(histogram, cells, owner[cell_of], owner)
    return Found(paints, evidence_for(cells.places, cells.weights, owner, dearest), specks)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Counting cells: where their flat pixels' mean colour lies in OKLab, and shares.

    The ink, where there is one, is a cell of its own, the last.
    """

    places: Float[np.ndarray, "cells 3"]
    weights: Float[np.ndarray, " cells"]
    ink: Ink | None


def _cells(histogram: Histogram, ink: Ink | None) -> tuple[_Cells, Int[np.ndarray, " n"]]:
    """Return the fullest cells of flat pixels, and which of them is nearest to every colour."""
    codes = (histogram.colors // CELL).astype(np.uint32) @ np.array([1, 1 << 8, 1 << 16], np.uint32)
    _, cell_of = distinct(codes)
    flat = np.bincount(cell_of, histogram.flat)
    weights = np.where(flat[cell_of] > 0, histogram.flat, histogram.counts)
    sums = np.stack([np.bincount(cell_of, weights * c) for c in histogram.colors.T], axis=1)
    means = np.rint(sums / np.bincount(cell_of, weights)[:, None]).astype(np.uint8)
    places = even_oklab_from_rgb(means)
    fullest = np.argsort(-flat, kind="stable")[: min(MOST_CELLS, int((flat > 0).sum()))]
    own, flat = places[np.sort(fullest)], flat[np.sort(fullest)]
    if ink is not None:
        own = np.concatenate([own, even_oklab_from_rgb(np.array([ink.rgb], dtype=np.uint8))])
        flat = np.append(flat, ink.pixels)
    return _Cells(own, flat / flat.sum(), ink), nearest_place(own, places)[0][cell_of]


def _peaks(cells: _Cells) -> Owners:
    """Return for every cell the peak that its chain of pointers ends at."""
    from scipy.spatial import KDTree

    pairs = KDTree(cells.places).query_pairs(JUST_NOTICEABLE, output_type="ndarray")
    length = np.linalg.norm(cells.places[pairs[:, 0]] - cells.places[pairs[:, 1]], axis=1)
    near = 1 - length / JUST_NOTICEABLE
    density = cells.weights.copy()
    np.add.at(density, pairs[:, 0], near * cells.weights[pairs[:, 1]])
    np.add.at(density, pairs[:, 1], near * cells.weights[pairs[:, 0]])
    rank = np.empty(len(density), dtype=np.int64)
    rank[np.lexsort((np.arange(len(density)), -density))] = np.arange(len(density))
    pairs, length = np.concatenate([pairs, pairs[:, ::-1]]), np.concatenate([length, length])
    upwards = rank[pairs[:, 1]] < rank[pairs[:, 0]]
    pairs, length = pairs[upwards], length[upwards]
    pairs = pairs[np.lexsort((rank[pairs[:, 1]], length))[::-1]]  # nearest last, so that it stays
    target = np.arange(len(density))
    target[pairs[:, 0]] = pairs[:, 1]
    while not np.array_equal(target[target], target):
        target = target[target]
    return target


def _shares(cells: _Cells, owner: Owners) -> Float[np.ndarray, " cells"]:
    """Return the share of the flat pixels that every peak owns."""
    return np.bincount(owner, cells.weights, len(owner))


def _only(cells: _Cells, owner: Owners, kept: Bool[np.ndarray, " cells"]) -> Owners:
    """Return owners among the kept peaks: others' cells go to the owner of the nearest cell."""
    own = kept[owner]
    if not own.any():
        return owner
    return owner[own][nearest_place(cells.places[own], cells.places)[0]]


def _specks(
    histogram: Histogram,
    cells: _Cells,
    cell_of: Int[np.ndarray, " n"],
    peaks: Owners,
    kept: Bool[np.ndarray, " cells"],
) -> list[Int[np.ndarray, " members"]]:
    """Return the colours of every small peak whose cells are unlike those of all paints.

    Args:
        histogram: of the character.
        cells: its cells.
        cell_of: every colour's cell.
        peaks: every cell's peak.
        kept: whether the paint that a cell is given to is one.
    """
    peak_of = peaks[cell_of]
    flat = np.bincount(peak_of, histogram.flat, len(peaks))
    large = (_shares(cells, peaks) >= LEAST_PEAK)[peaks]
    known, small = large & kept, np.flatnonzero(~large & (flat[peaks] >= FEW))
    if not len(small) or not known.any():
        return []
    away = nearest_place(cells.places[known], cells.places[small])[1]
    unlike = np.setdiff1d(peaks[small], peaks[small[away < UNLIKE]])
    return [np.flatnonzero(peak_of == peak) for peak in unlike]


def nearest_place(
    known: Float[np.ndarray, "m 3"], wanted: Float[np.ndarray, "n 3"]
) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return which of the known colours is nearest to each of others, and how far it is."""
    from scipy.spatial import KDTree

    away, number = KDTree(known).query(wanted)
    return np.asarray(number), np.asarray(away)


def _paints(
    histogram: Histogram, cells: _Cells, owner_of: Int[np.ndarray, " n"], owner: Owners
) -> tuple[list[Paint], Bool[np.ndarray, " paints"]]:
    """Return the paints in the order of their peaks, and which are drawn flat or as ink."""
    paints, solid = [], []
    for peak in np.unique(owner):
        members = np.flatnonzero(owner_of == peak)
        flat, count = histogram.flat[members], int(histogram.counts[members].sum())
        is_ink = cells.ink is not None and peak == owner[-1]
        if cells.ink is not None and is_ink and flat.sum() < cells.ink.pixels:
            rgb = cells.ink.rgb
        else:
            rgb = _rgb(histogram.colors[members], flat, cells.places[peak])
        paints.append(Paint(rgb, members, is_ink))
        solid.append(is_ink or flat.sum() >= LEAST_FLAT * count)
    return paints, np.array(solid)


def _rgb(
    colors: UInt8[np.ndarray, "n 3"], flat: Int[np.ndarray, " n"], peak: Float[np.ndarray, " 3"]
) -> tuple[int, int, int]:
    """Return a paint's own colour from those of its pixels."""
    best = int(flat.argmax())
    if flat[best] >= EXACT * flat.sum():
        return rounded(colors[best])
    colors, flat = colors[flat > 0], flat[flat > 0]
    core = np.linalg.norm(even_oklab_from_rgb(colors) - peak, axis=1) <= JUST_NOTICEABLE
    return rounded(np.array([_level(channel, flat[core]) for channel in colors[core].T]))


def _level(levels: UInt8[np.ndarray, " n"], weights: Int[np.ndarray, " n"]) -> float:
    """Return a channel's mean; its limit where noise was cut off there, which drags the mean."""
    most = int(np.bincount(levels, weights).argmax())
    return float(most) if most in (0, 255) else float(np.average(levels, weights=weights))
