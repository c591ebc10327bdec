"""Figures that touch or overlap a little: cut apart along the thinnest place.

The cut is a path from the top to the bottom of the patch that crosses as little paint as it can,
found by dynamic programming as in seam carving; to run along an outline costs little. It counts if
both sides are then as high as a figure, of its colours, and no mere limb: a hand in a hand is
crossed in a few per cent of the height, a body never.
Source: S. Avidan, A. Shamir, "Seam carving for content-aware image resizing" (2007).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.figures import Blobs, as_box, find_mains, shared_colors
from toonset.view import Box

DEAREST = 0.12  # of the patch's height in paint: the most that a cut may cost
AS_HIGH = 0.7  # of the patch's height: what is left on each side of a cut
AS_LARGE = 0.3  # of the patch's area: the same, for two figures of equal size less
WIDER = 1.2  # times the narrowest figure's width: a patch that may be two figures
WIDE_ALONE = 0.5  # times its own height: the same where there are no others
LEAST_HEIGHT = 24  # cells: in a lower patch no two figures can be told
LARGER = 1.4  # times the area of figures that stand alone: the same
DETOUR = 0.02  # cost of a step aside, in pixels of paint
ALIKE = 0.3  # of two figures' colours that they share; a wing and its body share less
LINE = 0.9  # of the cost of paint that a drawn line saves
STRONG = 60.0  # levels that a line is darker than what it divides
WIDEST_LINE = 0.03  # of the height
GAP = 0.1  # of the cost of paint: paper that is enclosed
THROUGH = 0.7  # of an enclosed patch's height that a cut runs through: a gap between two figures
MOST_ENCLOSED = 0.25  # of a patch in the background's colour: more is a line drawing
MOST_ROWS = 600  # of the picture on which cuts are sought


@dataclass(frozen=True)
class Cut:
    """Where two figures were cut apart.

    Attributes:
        box: (x, y, width, height) of the two together, in the cells of the labels.
        crossed: paint that the cut goes through, as a share of the height.
    """

    box: Box
    crossed: float


def part_touching(
    blobs: Blobs,
    painted: Bool[np.ndarray, "height width"],
    rgb: UInt8[np.ndarray, "height width 3"],
) -> tuple[Blobs, list[Cut]]:
    """Return the patches of a sheet with touching figures apart, and the cuts.

    Paper that two touching figures enclose between them becomes nobody's.

    Args:
        blobs: the patches.
        painted: pixels that are not of the background's colour.
        rgb: the sheet.
    """
    mains, cuts = find_mains(blobs), list[Cut]()
    widths, least = blobs.boxes[mains, 2], _least_area(blobs, mains)
    labels, top = blobs.labels, len(blobs.areas)
    queue = [(int(n) + 1, as_box(blobs.boxes[n])) for n in mains]
    while queue:
        label, box = queue.pop()
        x, y, width, height = box
        if not _is_wide(box, widths):
            continue
        mask = labels[y : y + height, x : x + width] == label
        paint = mask & painted[y : y + height, x : x + width]
        if mask.sum() < least:
            continue
        if paint.sum() < mask.sum() * (1 - MOST_ENCLOSED):
            paint = mask  # a line drawing: its inside is paper, too
        found = _best_cut(mask, paint, rgb[y : y + height, x : x + width])
        if found is None:
            continue
        labels = labels.copy() if not cuts else labels
        top += 1
        window = labels[y : y + height, x : x + width]
        window[mask & (np.arange(width) >= found[0][:, None])] = top
        window[_crossed(mask & ~paint, found[0])] = 0
        cuts.append(Cut(box, found[1]))
        parts = _boxes(labels)
        queue += [(n, as_box(parts[n - 1])) for n in (label, top)]
    return (_measured(labels, top) if cuts else blobs), cuts


def _crossed(
    enclosed: Bool[np.ndarray, "height width"], cut: Int[np.ndarray, " height"]
) -> Bool[np.ndarray, "height width"]:
    """Return the enclosed patches that a cut runs through from top to bottom."""
    count, found, stats, _ = cv2.connectedComponentsWithStats(
        enclosed.view(np.uint8), connectivity=4
    )
    patches = np.asarray(found, dtype=np.int32)
    rows, columns = np.arange(len(cut)), np.clip(cut, 1, enclosed.shape[1] - 1)
    met = np.maximum(patches[rows, columns], patches[rows, columns - 1])
    between = np.bincount(met, minlength=count) >= THROUGH * stats[:, cv2.CC_STAT_HEIGHT]
    between[0] = False
    return between[patches]


def _boxes(labels: Int[np.ndarray, "height width"]) -> Int[np.ndarray, "blobs 4"]:
    """Return x, y, width, height of every number in use."""
    from scipy.ndimage import find_objects

    places = [(rows, columns) for rows, columns in find_objects(labels)]
    return np.array(
        [(c.start, r.start, c.stop - c.start, r.stop - r.start) for r, c in places]
    ).reshape(-1, 4)


def _least_area(blobs: Blobs, mains: Int[np.ndarray, " mains"]) -> float:
    """Return from which area a patch may be two figures: more than those that stand alone have."""
    widths, heights = blobs.boxes[mains, 2], blobs.boxes[mains, 3]
    alone = (widths < WIDER * widths.min(initial=0)) & (widths < WIDE_ALONE * heights)
    alone |= widths <= np.median(widths) if len(mains) >= 3 else alone
    return LARGER * float(np.median(blobs.areas[mains[alone]])) if alone.any() else 0.0


def _is_wide(box: Box, widths: Int[np.ndarray, " mains"]) -> bool:
    if len(widths) >= 3 and box[2] < WIDER * float(widths.min()):
        return False
    return box[3] >= LEAST_HEIGHT and box[2] >= WIDE_ALONE * box[3]


def _outlines(
    rgb: UInt8[np.ndarray, "height width 3"],
) -> Float[np.ndarray, "height width"]:
    """Return where thin dark lines are, 0 to 1: what closing the dark away takes away."""
    luma = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY)
    width = max(5, round(WIDEST_LINE * len(rgb))) | 1
    lines = cv2.morphologyEx(luma, cv2.MORPH_BLACKHAT, np.ones((width, width), np.uint8))
    return np.clip(lines.astype(np.float32) / STRONG, 0, 1)


def _best_cut(
    mask: Bool[np.ndarray, "height width"],
    paint: Bool[np.ndarray, "height width"],
    rgb: UInt8[np.ndarray, "height width 3"],
) -> tuple[Int[np.ndarray, " height"], float] | None:
    """Return the column right of the cut for every row, and what it crosses; None for no cut."""
    height, width = mask.shape
    shrink = min(1.0, MOST_ROWS / height)
    size = max(8, round(width * shrink)), max(8, round(height * shrink))
    savings = LINE * _outlines(rgb)
    solid, drawn, saved = (
        cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        for picture in (mask, paint, savings)
    )
    price = drawn * (1 - saved) + GAP * (solid - drawn)
    down, up = _costs(price), _costs(price[::-1])[::-1]
    rows = np.minimum((np.arange(height) * shrink).astype(int), size[1] - 1)
    for column in _valleys((down + up - price)[size[1] // 2]):
        path = _path(down, up, column)
        crossed = float(drawn[np.arange(size[1]), path].sum()) / size[1]
        cost = float(price[np.arange(size[1]), path].sum()) / size[1]
        if cost <= DEAREST and _are_figures(drawn, path):
            cut = np.rint(path[rows] / shrink).astype(int)
            right = np.arange(width) >= cut[:, None]
            if shared_colors(rgb[mask & right], rgb[mask & ~right]) >= ALIKE:
                return cut, crossed
    return None


def _costs(paint: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return the least paint on a path from the top to every cell, itself included."""
    total = paint.copy()
    for row in range(1, len(paint)):
        above = total[row - 1]
        aside = np.minimum(np.append(np.inf, above[:-1]), np.append(above[1:], np.inf))
        total[row] += np.minimum(above, aside + DETOUR)
    return total


def _valleys(cost: Float[np.ndarray, " width"]) -> list[int]:
    """Return the columns at which a cut is cheapest among its neighbours, the cheapest first."""
    padded = np.pad(cost, 1, constant_values=np.inf)
    low = (cost <= padded[:-2]) & (cost <= padded[2:])
    starts = np.flatnonzero(low & ~np.append(False, low[:-1]))
    stops = np.flatnonzero(low & ~np.append(low[1:], False))
    middles = (starts + stops) // 2
    return [int(c) for c in middles[np.argsort(cost[middles], kind="stable")]]


def _path(down: np.ndarray, up: np.ndarray, column: int) -> Int[np.ndarray, " height"]:
    """Return the columns of the cheapest path through a column of the middle row."""
    middle = len(down) // 2
    path = np.full(len(down), column)
    for row in range(middle - 1, -1, -1):
        path[row] = _cheapest_beside(down[row], path[row + 1])
    for row in range(middle + 1, len(down)):
        path[row] = _cheapest_beside(up[row], path[row - 1])
    return path


def _cheapest_beside(cost: np.ndarray, column: int) -> int:
    places = [c for c in (column, column - 1, column + 1) if 0 <= c < len(cost)]
    return min(places, key=lambda c: cost[c] + (DETOUR if c != column else 0.0))


def _are_figures(paint: np.ndarray, path: np.ndarray) -> bool:
    """Return whether the largest piece on each side of a path could be a figure."""
    right = np.arange(paint.shape[1]) >= path[:, None]
    least = AS_LARGE * float(paint.sum()) * 2 / _figures_across(paint)
    for side in (right, ~right):
        piece = ((paint > 0.5) & side).view(np.uint8)
        stats = cv2.connectedComponentsWithStats(piece, connectivity=8)[2][1:]
        if not len(stats):
            return False
        largest = stats[stats[:, cv2.CC_STAT_AREA].argmax()]
        if largest[cv2.CC_STAT_HEIGHT] < AS_HIGH * len(paint):
            return False
        if largest[cv2.CC_STAT_AREA] < least:
            return False
    return True


def _figures_across(paint: np.ndarray) -> float:
    """Return about how many figures stand side by side: a figure is rarely over half as wide."""
    return max(2.0, paint.shape[1] / (WIDE_ALONE * paint.shape[0]))


def _measured(labels: Int[np.ndarray, "height width"], count: int) -> Blobs:
    """Return boxes, areas and centres of numbered patches."""
    rows, columns = np.nonzero(labels)
    number = labels[rows, columns] - 1
    areas = np.bincount(number, minlength=count)
    sums = [np.bincount(number, places, count) for places in (columns, rows)]
    return Blobs(labels, _boxes(labels), areas, np.stack(sums, axis=1) / areas[:, None])
