"""Floating parts of two figures that touch: a hand apart that meets the neighbour's hand.

They are one patch between two figures, twice as large as the single parts that other figures have
at its level, and narrower where they meet. The views show one character, so its halves are about
equally large: the patch is cut across its long axis through its centre of mass.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from toonset.dataset.split.figures.blobs import Blobs, as_box
from toonset.dataset.split.figures.grouping import (
    FARTHEST,
    FEET,
    LEAST_PART,
    PART_AREA,
    SAME_LEVEL,
    Grouping,
)
from toonset.dataset.split.touching.cut import Cut, measured

TWICE = (1.4, 2.4)  # times a single part's area: two that overlap, two of different sizes
LEAST_SINGLES = 2  # parts apart that are like the halves
NECK = 0.9  # of the patch's thickness at most where two parts meet


@dataclass(frozen=True)
class _Place:
    """A patch between figures.

    Attributes:
        level: of its middle, in heights of the nearest figure from its top.
        left: number of the next body on its left; -1 = none.
        right: the same on its right.
        height: of the nearest body, in cells.
    """

    level: float
    left: int
    right: int
    height: int


def part_shared(
    blobs: Blobs, mains: Int[np.ndarray, " mains"], grouping: Grouping
) -> tuple[Blobs, dict[int, int], list[Cut]]:
    """Return the patches with shared parts apart, the body of each half, and the cuts.

    Args:
        blobs: the patches.
        mains: numbers of those that are bodies of views.
        grouping: what the patches are if they stay whole: the like of a half must be a part.
    """
    places = _places(blobs, mains, grouping)
    singles = {n: place for n, place in places.items() if grouping.figure_of_blob[n] >= 0}
    labels, count = blobs.labels.copy(), len(blobs.areas)
    bodies: dict[int, int] = {}
    cuts: list[Cut] = []
    for number, place in places.items():
        between = place.left >= 0 and place.right >= 0
        if not between or not _is_double(blobs, number, place, singles):
            continue
        right_half, neck = _halved(blobs.mask(number))
        if right_half is None:
            continue
        count += 1
        labels[blobs.window(number)][right_half] = count
        bodies |= {number: place.left, count - 1: place.right}
        cuts.append(Cut(as_box(blobs.boxes[number]), neck / place.height, 1.0))
    return (measured(labels, count) if cuts else blobs), bodies, cuts


def _places(
    blobs: Blobs, mains: Int[np.ndarray, " mains"], grouping: Grouping
) -> dict[int, _Place]:
    """Return where the patches lie that are parts, or drawings of a part's size and level."""
    typical = float(np.median(blobs.areas[mains])) if len(mains) else 0.0
    able = (blobs.areas >= LEAST_PART * typical) & (blobs.areas <= PART_AREA * typical)
    able &= ~np.isin(grouping.kinds, ("text", "swatch"))
    able[mains] = False
    places = {int(n): _place(blobs, mains, int(n)) for n in np.flatnonzero(able)}
    return {n: place for n, place in places.items() if -FARTHEST <= place.level <= FEET}


def _place(blobs: Blobs, mains: Int[np.ndarray, " mains"], number: int) -> _Place:
    """Return where a patch lies among the bodies of its row."""
    x, y, width, height = blobs.boxes[number]
    middle_x, middle_y = x + width / 2, y + height / 2
    lefts, tops, widths, heights = blobs.boxes[mains].T
    level = (middle_y - tops) / heights
    in_row = (level >= -FARTHEST) & (level <= FEET)
    aside = np.where(in_row, lefts + widths / 2 - middle_x, np.nan)
    if not in_row.any():
        return _Place(np.inf, -1, -1, 0)
    nearest = int(np.nanargmin(np.abs(aside)))
    left, right = np.where(aside < 0, aside, -np.inf), np.where(aside > 0, aside, np.inf)
    return _Place(
        float(level[nearest]),
        int(mains[left.argmax()]) if np.isfinite(left).any() else -1,
        int(mains[right.argmin()]) if np.isfinite(right).any() else -1,
        int(heights[nearest]),
    )


def _is_double(blobs: Blobs, number: int, own: _Place, singles: Mapping[int, _Place]) -> bool:
    """Return whether figures have parts of half its size at a patch's level."""
    area = blobs.areas[number]
    return LEAST_SINGLES <= sum(
        TWICE[0] <= area / blobs.areas[other] <= TWICE[1]
        and abs(place.level - own.level) <= SAME_LEVEL
        for other, place in singles.items()
    )


def _halved(
    mask: Bool[np.ndarray, "height width"],
) -> tuple[Bool[np.ndarray, "height width"] | None, float]:
    """Return the right half of a patch, None if it has no neck, and the neck's width in cells."""
    rows, columns = np.nonzero(mask)
    apart = np.stack([columns - columns.mean(), rows - rows.mean()])
    along = np.linalg.eigh(np.cov(apart))[1][:, 1] @ apart  # the longer axis comes last
    along = along if along @ apart[0] > 0 else -along
    slices = np.bincount(np.floor(along - along.min()).astype(int))
    neck = float(slices[int(-along.min())])
    if neck > NECK * slices.max():
        return None, neck
    right = np.zeros_like(mask)
    right[rows, columns] = along > 0
    return right, neck
