"""Where figures and small drawings lie on a messy sheet: rows from the top, bands round them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lab.bench.messy.figure import Figure, Stamp
from toonset.view import Box


@dataclass(frozen=True, eq=False)
class Item:
    """Something that stands in a row.

    Attributes:
        picture: what is drawn.
        is_view: it is one of the sheet's figures, else a study or a prop.
        above: text over it, or None.
        below: text under it, or None.
        closer_px: None to keep the row's gap; else how far it reaches into the item on its left
            (0 = they touch).
        lifted: share of the row's free height that it hangs over the ground; 0 stands.
    """

    picture: Figure | Stamp
    is_view: bool
    above: Stamp | None = None
    below: Stamp | None = None
    closer_px: int | None = None
    lifted: float = 0.0

    @property
    def rgba(self) -> Stamp:
        """Return its pixels."""
        return self.picture.rgba if isinstance(self.picture, Figure) else self.picture


@dataclass(frozen=True)
class Spacing:
    """Distances in pixels, and how rows are set.

    Attributes:
        margin: round the sheet.
        gap: between items of a row.
        leading: between rows.
        text_gap: between a figure and its caption.
        centred: rows are centred, else they start at the left.
        cells: all items of the sheet have cells of one width.
        header: height of the band over the rows.
        footer: of the band under them.
        side: width of the column at the right.
        least: width between the margins that bands need.
    """

    margin: int
    gap: int
    leading: int
    text_gap: int
    centred: bool
    cells: bool
    header: int
    footer: int
    side: int
    least: int


@dataclass(frozen=True, eq=False)
class Placed:
    """An item and where its upper left corner lies."""

    item: Item
    x: int
    y: int

    @property
    def right(self) -> int:
        """Return the first column to the right of it."""
        return self.x + self.item.rgba.shape[1]


@dataclass(frozen=True, eq=False)
class Row:
    """A row as laid out.

    Attributes:
        items: from left to right.
        top: of its tallest item.
        ground: the row of pixels under the feet.
        cell_boxes: of its items, captions included.
        texts: captions with x and y.
    """

    items: tuple[Placed, ...]
    top: int
    ground: int
    cell_boxes: tuple[Box, ...]
    texts: tuple[tuple[Stamp, int, int], ...]


@dataclass(frozen=True, eq=False)
class Layout:
    """All rows, and the sheet's size."""

    rows: tuple[Row, ...]
    size_wh: tuple[int, int]


def lay_out(rows: Sequence[Sequence[Item]], spacing: Spacing) -> Layout:
    """Return where every item goes."""
    widest = max(item.rgba.shape[1] for row in rows for item in row) + spacing.gap
    offsets = [_offsets(row, spacing, widest) for row in rows]
    lengths = [
        widest * len(row) if spacing.cells else xs[-1] + row[-1].rgba.shape[1]
        for row, xs in zip(rows, offsets, strict=True)
    ]
    inner = max(*lengths, spacing.least)
    y = spacing.margin + spacing.header
    found = []
    for row, xs, length in zip(rows, offsets, lengths, strict=True):
        left = spacing.margin + ((inner - length) // 2 if spacing.centred else 0)
        laid, bottom = _row(row, [left + x for x in xs], y, spacing, left, widest)
        found.append(laid)
        y = bottom + spacing.leading
    height = y - spacing.leading + spacing.footer + spacing.margin
    return Layout(tuple(found), (inner + 2 * spacing.margin + spacing.side, height))


def _offsets(row: Sequence[Item], spacing: Spacing, cell: int) -> list[int]:
    if spacing.cells:
        return [i * cell + (cell - item.rgba.shape[1]) // 2 for i, item in enumerate(row)]
    xs = [0]
    tallest = max(len(item.rgba) for item in row)
    for left, right in pairwise(row):
        if right.closer_px is None:
            step = left.rgba.shape[1] + spacing.gap
        else:
            hangs = round(right.lifted * (tallest - len(right.rgba)))
            lifted = np.pad(right.rgba, ((0, hangs), (0, 0), (0, 0)))
            step = reach(left.rgba, lifted) - right.closer_px
        xs.append(xs[-1] + step)
    return xs


def reach(left: Stamp, right: Stamp) -> int:
    """Return the shift in x at which the right figure, feet level, just touches the left one."""
    height = min(len(left), len(right))
    a, b = left[-height:, :, 3] >= 128, right[-height:, :, 3] >= 128
    both = a.any(axis=1) & b.any(axis=1)
    last = a.shape[1] - np.argmax(a[:, ::-1], axis=1)
    first = np.argmax(b, axis=1)
    return int((last - first)[both].max())


def _row(
    row: Sequence[Item], xs: list[int], y: int, spacing: Spacing, left: int, cell: int
) -> tuple[Row, int]:
    """Return the row and where it ends."""
    over = max((_band(item.above, spacing) for item in row), default=0)
    under = max((_band(item.below, spacing) for item in row), default=0)
    pad = spacing.gap // 3 if spacing.cells else 0
    tallest = max(len(item.rgba) for item in row)
    top = y + pad + over
    ground = top + tallest
    placed, texts = [], []
    for item, x in zip(row, xs, strict=True):
        height, width = item.rgba.shape[:2]
        item_y = ground - height - round(item.lifted * (tallest - height))
        placed.append(Placed(item, x, item_y))
        if item.above is not None:
            text_y = item_y - spacing.text_gap - len(item.above)
            texts.append((item.above, x + (width - item.above.shape[1]) // 2, text_y))
        if item.below is not None:
            text_y = ground + spacing.text_gap
            texts.append((item.below, x + (width - item.below.shape[1]) // 2, text_y))
    bottom = ground + under + pad
    boxes = tuple((left + i * cell, y, cell, bottom - y) for i in range(len(row)))
    return Row(tuple(placed), top, ground, boxes, tuple(texts)), bottom


def _band(text: Stamp | None, spacing: Spacing) -> int:
    return 0 if text is None else len(text) + spacing.text_gap
