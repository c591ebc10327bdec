"""Hold the connected patches of a sheet, and compare what is painted in them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.view import Box

LEAST_AREA = 0.25  # of the views' median area: a side view is rarely below a third of a front view
SMALLER = 0.85  # of the views' median height or area
STRANGE = 0.6  # of what the views commonly share of their colours: less is another thing
RECTANGLE = 0.96  # of its box that a patch fills: a block of colour, no character
LEVEL = 0.12  # of the views' height: perspective moves feet and heads by that
PLAIN = 0.9  # of a patch in one of 64 colours: a swatch
LEAST_SPECK = 4  # cells: smaller things are noise


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

    def window(self, number: int) -> tuple[slice, slice]:
        """Return rows and columns of a patch's box."""
        x, y, width, height = self.boxes[number]
        return slice(y, y + height), slice(x, x + width)

    def mask(self, number: int) -> Bool[np.ndarray, "height width"]:
        """Return the pixels of a patch within its box."""
        return self.labels[self.window(number)] == number + 1


def find_blobs(foreground: Bool[np.ndarray, "height width"]) -> Blobs:
    """Return the connected patches (diagonal neighbours touch)."""
    _, labels, stats, centers = cv2.connectedComponentsWithStats(
        foreground.view(np.uint8), connectivity=8
    )
    return Blobs(labels, stats[1:, :4], stats[1:, 4], centers[1:])


def as_box(numbers: Int[np.ndarray, " 4"]) -> Box:
    """Return x, y, width, height as plain numbers."""
    x, y, width, height = (int(value) for value in numbers)
    return x, y, width, height


def add_blocks(
    blobs: Blobs,
    main_blobs: Int[np.ndarray, " main_blobs"],
    painted: Bool[np.ndarray, "height width"],
    rgb: UInt8[np.ndarray, "height width 3"],
) -> Int[np.ndarray, " main_blobs"]:
    """Return the bodies and the rectangles that are views, too: a blocky character's profile.

    It stands level with another view and has its colours, several of them; a swatch has one.
    """
    if len(main_blobs) < 2:
        return main_blobs
    fill = blobs.areas / (blobs.boxes[:, 2] * blobs.boxes[:, 3])
    blocks = np.setdiff1d(np.flatnonzero(fill >= RECTANGLE), main_blobs)
    height, area = np.median(blobs.boxes[main_blobs, 3]), np.median(blobs.areas[main_blobs])
    blocks = blocks[(blobs.areas[blocks] >= LEAST_AREA * area)]
    if not len(blocks):
        return main_blobs
    ends = np.stack([blobs.boxes[:, 1], blobs.boxes[:, 1] + blobs.boxes[:, 3]], axis=1)
    looks = np.array([_look_of(blobs, int(n), painted, rgb) for n in main_blobs])
    typical = np.median([np.minimum(look, looks.mean(axis=0)).sum() for look in looks])
    views = []
    for block in blocks.tolist():
        level = np.abs(ends[main_blobs] - ends[block]).max(axis=1) <= LEVEL * height
        look = _look_of(blobs, block, painted, rgb)
        alike = np.minimum(look, looks.mean(axis=0)).sum() >= STRANGE * typical
        if level.any() and alike and look.max() <= PLAIN:
            views.append(block)
    return np.concatenate([main_blobs, np.array(views, dtype=main_blobs.dtype)])


def remove_strangers(
    blobs: Blobs,
    main_blobs: Int[np.ndarray, " main_blobs"],
    painted: Bool[np.ndarray, "height width"],
    rgb: UInt8[np.ndarray, "height width 3"],
) -> Int[np.ndarray, " main_blobs"]:
    """Return the bodies without smaller ones in other colours: a sword as high as its bearer."""
    if len(main_blobs) < 3:
        return main_blobs
    looks = np.array([_look_of(blobs, int(n), painted, rgb) for n in main_blobs])
    others = (looks.sum(axis=0) - looks) / (len(main_blobs) - 1)
    shared = np.minimum(looks, others).sum(axis=1)
    heights, areas = blobs.boxes[main_blobs, 3], blobs.areas[main_blobs]
    smaller = (heights <= SMALLER * np.median(heights)) | (areas <= SMALLER * np.median(areas))
    return main_blobs[~smaller | (shared >= STRANGE * np.median(shared))]


def shared_colors(a: UInt8[np.ndarray, "_ 3"], b: UInt8[np.ndarray, "_ 3"]) -> float:
    """Return how much of their colours two figures share: the histograms' intersection."""
    return float(np.minimum(_look(a), _look(b)).sum())


def _look_of(
    blobs: Blobs,
    number: int,
    painted: Bool[np.ndarray, "height width"],
    rgb: UInt8[np.ndarray, "height width 3"],
) -> Float[np.ndarray, " 64"]:
    window = blobs.window(number)
    return _look(rgb[window][blobs.mask(number) & painted[window]])


def _look(colors: UInt8[np.ndarray, "_ 3"]) -> Float[np.ndarray, " 64"]:
    """Return the shares of 64 colours."""
    codes = (colors // 64).astype(np.int64) @ np.array([16, 4, 1])
    return np.bincount(codes, minlength=64) / max(len(codes), 1)


def rows_of(
    boxes: Int[np.ndarray, "n 4"], centers: Float[np.ndarray, "n 2"]
) -> list[Int[np.ndarray, " row"]]:
    """Return the numbers of boxes row by row from the top, from left to right within each.

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
    return [np.array(sorted(row, key=lambda i: centers[i, 0])) for row in rows]


def reading_order(
    boxes: Int[np.ndarray, "n 4"], centers: Float[np.ndarray, "n 2"]
) -> Int[np.ndarray, " n"]:
    """Return the order of boxes: `rows_of` one after the other."""
    return np.concatenate([np.zeros(0, dtype=int), *rows_of(boxes, centers)])
