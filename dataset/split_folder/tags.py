"""Place labels on a picture of figures so that no figure is covered.

A tag is tried in several layouts, the fullest first, at places round and within its box. The first
layout that covers no figure is taken. Where none is free, the smallest goes where it covers least;
the upper part of a figure counts far more, for faces are there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, UInt8
from PIL import Image, ImageDraw, ImageFont

FIGURE, FACE, TAG, THING, BOX = 1.0, 50.0, 1000.0, 0.01, 1e-4  # cost of a covered pixel
FACE_SHARE = 0.5  # of a figure's height, from its top: a face is there
STEPS = 9  # places tried along a side
PAD = 3  # pixels round the words of a tag

Rgb = tuple[int, int, int]
Corners = tuple[int, int, int, int]  # left, top, right, bottom


@dataclass(frozen=True)
class Line:
    """Words in one size."""

    text: str
    size: int


Layout = tuple[Line, ...]


class Costs:
    """Cost per pixel of covering the picture."""

    def __init__(self, height: int, width: int) -> None:
        """Start with a picture where everything may be covered."""
        self.map: Float32[np.ndarray, "height width"] = np.zeros((height, width), np.float32)

    def add_figure(self, box: Corners, mask: Bool[np.ndarray, "_ _"]) -> None:
        """Keep tags off a figure, and if they can from its box."""
        left, top, right, bottom = box
        weights = np.full(mask.shape, FIGURE, np.float32)
        rows = np.flatnonzero(mask.any(axis=1))
        if len(rows):
            weights[: rows[0] + round(FACE_SHARE * (rows[-1] + 1 - rows[0]))] = FACE
        window = self.map[top:bottom, left:right]
        np.maximum(window, np.where(mask, weights, BOX), out=window)

    def add_thing(self, box: Corners) -> None:
        """Keep tags off something that was left out, if there is another place."""
        left, top, right, bottom = np.maximum(box, 0)
        window = self.map[top:bottom, left:right]
        np.maximum(window, THING, out=window)

    def cover(self, box: Corners) -> None:
        """Keep later tags off a place that is taken."""
        left, top, right, bottom = box
        self.map[top:bottom, left:right] = TAG

    def place(self, box: Corners, size_wh: tuple[int, int]) -> tuple[float, tuple[int, int]]:
        """Return the least cost of a tag of this size at a box, and its left top corner there."""
        height, width = self.map.shape
        wide, high = size_wh
        best = (float("inf"), (0, 0))
        for x, y in _places(box, size_wh):
            if x < 0 or y < 0 or x + wide > width or y + high > height:
                continue
            cost = float(self.map[y : y + high, x : x + wide].sum())
            if cost < best[0]:
                best = (cost, (x, y))
        return best


def _places(box: Corners, size_wh: tuple[int, int]) -> list[tuple[int, int]]:
    """Return left top corners for a tag, the most readable first: above, within, below, beside."""
    left, top, right, bottom = box
    wide, high = size_wh
    along = np.linspace(left, max(right - wide, left), STEPS).round().astype(int).tolist()
    along += [left + (right - left - wide) // 2, right - wide] if right - left < wide else []
    down = np.linspace(top, max(bottom - high, top), STEPS).round().astype(int).tolist()
    return [
        *((x, top - high) for x in along),
        *((x, top) for x in along),
        *((x, y) for y in down for x in (left, right - wide)),
        *((x, bottom - high) for x in along),
        *((x, bottom) for x in along),
        *((x, y) for y in down for x in (left - wide, right)),
    ]


def draw_tag(
    picture: UInt8[np.ndarray, "height width 3"],
    costs: Costs,
    box: Corners,
    layouts: Sequence[Layout],
    color: Rgb,
    *,
    must: bool = True,
) -> bool:
    """Write a tag at a box; return whether it was written.

    Args:
        picture: written into.
        costs: what to keep off; the tag's place is added.
        box: what the tag speaks of.
        layouts: what to write, the fullest first.
        color: of the ground under the white words.
        must: write the last layout even where it covers a figure.
    """
    for number, layout in enumerate(layouts):
        size = layout_size(layout)
        cost, (x, y) = costs.place(box, size)
        forced = must and number == len(layouts) - 1 and np.isfinite(cost)
        if cost < FIGURE or forced:
            window = picture[y : y + size[1], x : x + size[0]]
            window[:] = _written(layout, size, color)
            costs.cover((x, y, x + size[0], y + size[1]))
            return True
    return False


def layout_size(layout: Layout) -> tuple[int, int]:
    """Return width and height of a tag."""
    widths = [text_width(line) for line in layout]
    return max(widths) + 2 * PAD, sum(_line_height(line) for line in layout) + 2 * PAD


def text_width(line: Line) -> int:
    """Return the width of words in pixels."""
    return int(np.ceil(ImageFont.load_default(line.size).getlength(line.text)))


def _line_height(line: Line) -> int:
    return round(1.15 * line.size)


def _written(layout: Layout, size_wh: tuple[int, int], color: Rgb) -> np.ndarray:
    image = Image.new("RGB", size_wh, color)
    pen = ImageDraw.Draw(image)
    pen.rectangle((0, 0, size_wh[0] - 1, size_wh[1] - 1), outline="white")
    y = PAD
    for line in layout:
        pen.text((PAD, y), line.text, fill="white", font=ImageFont.load_default(line.size))
        y += _line_height(line)
    return np.array(image)
