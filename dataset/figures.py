"""Which pixels of a sheet form which figure, and in which order one reads the figures."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

NEAR = 0.02  # of the figure's height: a part this near to the figure's box is the figure's
FAR = 0.15  # of the figure's height: a part farther away belongs to nobody
LEAST_PART = 0.01  # of the figure's area: smaller things beside a figure are specks or letters
LEAST_SPECK_PX = 4  # pixels: smaller things within a figure's box are noise
LETTERS = 3  # small things in a row beside the figures: a caption


@dataclass(frozen=True, eq=False)
class Blobs:
    """Connected patches of foreground, numbered from 0.

    Attributes:
        labels: (height, width) number of the patch + 1; 0 = background.
        boxes: (blobs, 4) x, y, width, height.
        areas: (blobs,) pixels.
        centers: (blobs, 2) x, y of the centre of mass.
    """

    labels: Int[np.ndarray, "height width"]
    boxes: Int[np.ndarray, "blobs 4"]
    areas: Int[np.ndarray, " blobs"]
    centers: Float[np.ndarray, "blobs 2"]


@dataclass(frozen=True, eq=False)
class Grouping:
    """Which figure every patch belongs to.

    Attributes:
        figure_of_blob: (blobs,) number of the figure in reading order; -1 = none.
        count: number of figures.
        captions: patches dropped as text.
        strays: patches dropped because they belong to no figure (noise not counted).
    """

    figure_of_blob: Int[np.ndarray, " blobs"]
    count: int
    captions: int
    strays: int


def find_blobs(foreground: Bool[np.ndarray, "height width"]) -> Blobs:
    """Return the connected patches (diagonal neighbours touch)."""
    _, labels, stats, centers = cv2.connectedComponentsWithStats(
        foreground.astype(np.uint8), connectivity=8
    )
    return Blobs(labels, stats[1:, :4], stats[1:, 4], centers[1:])


def group_blobs(blobs: Blobs, least_share: float) -> Grouping:
    """Return which figure every patch belongs to.

    A patch of at least `least_share` of the largest one's area is a figure. A smaller one joins
    the nearest figure if it lies within that figure's box or touches it nearly, or close above,
    below or beside it (a floating hat, a sword tip, a hand apart) unless it is a speck or part of
    a caption.
    """
    mains = np.flatnonzero(blobs.areas >= least_share * blobs.areas.max())
    mains = mains[reading_order(blobs.boxes[mains], blobs.centers[mains])]
    figure = np.full(len(blobs.areas), -1)
    figure[mains] = np.arange(len(mains))
    small = np.flatnonzero((figure < 0) & (blobs.areas >= LEAST_SPECK_PX))
    if not len(small):
        return Grouping(figure, len(mains), 0, 0)
    nearest = _nearest_main(blobs, mains, small)
    gaps = _gaps(blobs.boxes[small], blobs.boxes[mains[nearest]])
    heights = blobs.boxes[mains[nearest], 3]
    inside = gaps.max(axis=1) <= 0
    texts = np.zeros(len(small), dtype=bool)
    texts[~inside] = _in_captions(blobs.boxes[small[~inside]])
    near = gaps.max(axis=1) <= NEAR * heights
    close = (gaps.max(axis=1) <= FAR * heights) & (gaps.min(axis=1) <= 0)
    large = blobs.areas[small] >= LEAST_PART * blobs.areas[mains[nearest]]
    joins = inside | (~texts & (near | (close & large)))
    figure[small[joins]] = nearest[joins]
    captions = int((texts & ~joins).sum())
    return Grouping(figure, len(mains), captions, int((~joins).sum()) - captions)


def reading_order(
    boxes: Int[np.ndarray, "n 4"], centers: Float[np.ndarray, "n 2"]
) -> Int[np.ndarray, " n"]:
    """Return the order of boxes: rows from the top, from left to right within each.

    A box belongs to a row if it shares at least half of the smaller height with the row's first.
    """
    rows: list[list[int]] = []
    for index in np.argsort(centers[:, 1], kind="stable"):
        top, height = boxes[index, 1], boxes[index, 3]
        for row in rows:
            first_top, first_height = boxes[row[0], 1], boxes[row[0], 3]
            shared = min(top + height, first_top + first_height) - max(top, first_top)
            if shared >= 0.5 * min(height, first_height):
                row.append(int(index))
                break
        else:
            rows.append([int(index)])
    return np.array(
        [i for row in rows for i in sorted(row, key=lambda i: centers[i, 0])], dtype=int
    )


def _nearest_main(blobs: Blobs, mains: np.ndarray, small: np.ndarray) -> np.ndarray:
    """Return for every small patch the position in `mains` of the figure nearest to its pixels."""
    is_main = np.zeros(len(blobs.areas) + 1, dtype=bool)
    is_main[mains + 1] = True
    zero_at_main = (~is_main[blobs.labels]).astype(np.uint8)
    away, found = cv2.distanceTransformWithLabels(
        zero_at_main, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_CCOMP
    )
    zones = np.asarray(found, dtype=np.int32)
    zone_of_main = zones[_a_pixel_of_each(blobs, mains)]
    main_of_zone = np.full(int(zones.max()) + 1, 0)
    main_of_zone[zone_of_main] = np.arange(len(mains))
    result = []
    for number in small:
        x, y, width, height = blobs.boxes[number]
        window = (slice(y, y + height), slice(x, x + width))
        inside = blobs.labels[window] == number + 1
        nearest = np.where(inside, away[window], np.inf).argmin()
        result.append(main_of_zone[zones[window].flat[nearest]])
    return np.array(result)


def _a_pixel_of_each(blobs: Blobs, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = [], []
    for number in numbers:
        x, y, width, height = blobs.boxes[number]
        inside = blobs.labels[y : y + height, x : x + width] == number + 1
        row, column = np.unravel_index(int(inside.argmax()), inside.shape)
        rows.append(y + row)
        columns.append(x + column)
    return np.array(rows), np.array(columns)


def _gaps(a: Int[np.ndarray, "n 4"], b: Int[np.ndarray, "n 4"]) -> Int[np.ndarray, "n 2"]:
    """Return the gaps in x and y between boxes; <= 0 where they overlap."""
    start = np.maximum(a[:, :2], b[:, :2])
    end = np.minimum(a[:, :2] + a[:, 2:], b[:, :2] + b[:, 2:])
    return start - end


def _in_captions(boxes: Int[np.ndarray, "n 4"]) -> Bool[np.ndarray, " n"]:
    """Return which boxes are letters: three or more of like height, side by side on a line."""
    count = len(boxes)
    if count < LETTERS or count > 5000:  # more is noise, and the table below would be large
        return np.zeros(count, dtype=bool)
    x, y, width, height = (boxes[:, i, None].astype(float) for i in range(4))
    taller = np.maximum(height, height.T)
    gap = np.maximum(x, x.T) - np.minimum(x + width, (x + width).T)
    level = np.abs((y + height / 2) - (y + height / 2).T) <= 0.6 * taller
    alike = taller <= 2.5 * np.minimum(height, height.T)
    near = level & alike & (gap <= 1.5 * taller)
    links, groups = _connected(near)
    return np.bincount(groups, minlength=links)[groups] >= LETTERS


def _connected(near: Bool[np.ndarray, "n n"]) -> tuple[int, Int[np.ndarray, " n"]]:
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    count, groups = connected_components(csr_matrix(near), directed=False)
    return int(count), groups
