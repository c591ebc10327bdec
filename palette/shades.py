"""From all colours that occur to families of shades: one family per colour a painter would name.

Colours are counted in small cells of RGB. Every cell points to the nearest cell that is denser
than itself, if that lies within the merging distance in OKLab; cells that point nowhere are the
families' peaks. So noise and gradients run together to their peak, while two separate peaks never
merge, however many stray pixels lie between them. Nothing depends on the order of pixels.
Source: A. Vedaldi, S. Soatto, "Quick shift and kernel methods for mode seeking" (2008).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int, UInt8

from toonset.palette.oklab import oklab_from_rgb

CELL = 4  # levels per side of a counting cell
FLAT = 0.2  # of a family: so frequent an exact colour is its flat paint


@dataclass(frozen=True, eq=False)
class Histogram:
    """How often every colour occurs.

    Attributes:
        colors: (n, 3) sRGB, each once, sorted by their code.
        counts: (n,) pixels.
    """

    colors: UInt8[np.ndarray, "n 3"]
    counts: Int[np.ndarray, " n"]


@dataclass(frozen=True, eq=False)
class Family:
    """Shades of one colour.

    Attributes:
        rgb: the flat paint if there is one, else the mean around the peak.
        members: positions in the histogram.
        count: pixels.
    """

    rgb: tuple[int, int, int]
    members: Int[np.ndarray, " members"]
    count: int


def count_colors(pixels: Iterable[UInt8[np.ndarray, "_ 3"]]) -> Histogram:
    """Return how often every colour occurs in several pictures' pixels."""
    codes, counts = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    for colors in pixels:
        red, green, blue = colors.astype(np.int64).T
        new, how_many = np.unique(red << 16 | green << 8 | blue, return_counts=True)
        both, place = np.unique(np.concatenate([codes, new]), return_inverse=True)
        counts = np.bincount(place, np.concatenate([counts, how_many]), len(both)).astype(np.int64)
        codes = both
    rgb = np.stack([codes >> 16, codes >> 8 & 255, codes & 255], axis=1).astype(np.uint8)
    return Histogram(rgb, counts)


def find_families(histogram: Histogram, merge_distance: float) -> list[Family]:
    """Return the families of shades, the largest first.

    Args:
        histogram: the colours that occur.
        merge_distance: in OKLab; a peak this near to a higher one belongs to it.
    """
    cell_of, colors, counts = _cells(histogram)
    peaks = _peaks(oklab_from_rgb(colors), counts, merge_distance)
    family_of = peaks[cell_of]
    families = []
    for peak in np.unique(peaks):
        members = np.flatnonzero(family_of == peak)
        rgb = _paint(histogram, members, cell_of[members] == peak)
        families.append(Family(rgb, members, int(histogram.counts[members].sum())))
    return sorted(families, key=lambda family: (-family.count, family.rgb))


def _cells(histogram: Histogram) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return every colour's cell, and the cells' mean colours and counts."""
    codes = (histogram.colors // CELL).astype(np.int64) @ np.array([1 << 16, 1 << 8, 1])
    _, cell_of = np.unique(codes, return_inverse=True)
    counts = np.bincount(cell_of, histogram.counts)
    sums = [np.bincount(cell_of, histogram.counts * channel) for channel in histogram.colors.T]
    return cell_of, np.rint(np.stack(sums, axis=1) / counts[:, None]).astype(np.uint8), counts


def _peaks(places: np.ndarray, counts: np.ndarray, reach: float) -> np.ndarray:
    """Return for every cell the peak that its chain of pointers ends at."""
    from scipy.spatial import KDTree

    tree = KDTree(places)
    near = tree.query_pairs(reach / 2, output_type="ndarray")
    density = counts.astype(np.float64)
    np.add.at(density, near[:, 0], counts[near[:, 1]])
    np.add.at(density, near[:, 1], counts[near[:, 0]])
    rank = np.empty(len(places), dtype=np.int64)
    rank[np.lexsort((np.arange(len(places)), -density))] = np.arange(len(places))
    pairs = tree.query_pairs(reach, output_type="ndarray")
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    pairs = pairs[rank[pairs[:, 1]] < rank[pairs[:, 0]]]  # from each cell to denser ones
    length = np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)
    pairs = pairs[np.lexsort((rank[pairs[:, 1]], length))[::-1]]  # nearest last, so that it stays
    target = np.arange(len(places))
    target[pairs[:, 0]] = pairs[:, 1]
    while True:
        further = target[target]
        if np.array_equal(further, target):
            return target
        target = further


def _paint(histogram: Histogram, members: np.ndarray, in_peak: np.ndarray) -> tuple[int, int, int]:
    counts = histogram.counts[members]
    best = int(counts.argmax())
    if counts[best] >= FLAT * counts.sum():
        color = histogram.colors[members[best]].astype(np.float64)
    else:
        core = members[in_peak]
        color = np.average(histogram.colors[core], axis=0, weights=histogram.counts[core])
    red, green, blue = (round(float(channel)) for channel in color)
    return red, green, blue
