"""Crop each figure of a sheet: its box and its own pixels, before the edge is matted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from toonset.dataset.split.segment import SheetLayout, figure_cells, in_pixels
from toonset.errors import SheetError
from toonset.raster import connected_to, dilate
from toonset.view import Box

LEAST_CELL_PX = 16  # pixels of paint in a cell of a grid: less is an empty cell


@dataclass(frozen=True, eq=False)
class Crop:
    """Box of a figure, and its pixels there.

    Attributes:
        box: (x, y, width, height) in the sheet, with a margin.
        solid: what the figure covers with all that it encloses.
        enclosed: background-coloured pixels within.
        filled: those of them that an open outline encloses; None: of none.
    """

    box: Box
    solid: Bool[np.ndarray, "height width"]
    enclosed: Bool[np.ndarray, "height width"]
    filled: Bool[np.ndarray, "height width"] | None = None


def found_crops(
    found: SheetLayout, paint: Bool[np.ndarray, "height width"], margin_px: int
) -> list[Crop]:
    """Return the crops of the figures that segmentation found, in reading order."""
    cells = figure_cells(found)
    return [
        _crop(found, paint, _box(found, number, paint.shape, margin_px), cells, number)
        for number in range(found.grouping.count)
    ]


def boxed_crops(
    found: SheetLayout,
    paint: Bool[np.ndarray, "height width"],
    boxes: Sequence[Box],
    margin_px: int,
) -> list[Crop]:
    """Return one crop per box: all paint in it is one figure's.

    Raises:
        SheetError: a box lies outside of the sheet, or holds no paint.
    """
    crops = []
    for number, box in enumerate(boxes):
        x, y, width, height = box
        inside = 0 <= x < x + width <= paint.shape[1] and 0 <= y < y + height <= paint.shape[0]
        if not inside:
            raise SheetError(
                f"box {number} ({x}, {y}, {width}, {height}) does not lie on the sheet of "
                f"{paint.shape[1]} x {paint.shape[0]} px; correct it"
            )
        crop = _tight(_crop(found, paint, box), paint.shape, margin_px)
        if crop is None:
            raise SheetError(
                f"box {number} ({x}, {y}, {width}, {height}) holds background only; move it"
            )
        crops.append(crop)
    return crops


def grid_crops(
    found: SheetLayout,
    paint: Bool[np.ndarray, "height width"],
    grid: tuple[int, int],
    margin_px: int,
) -> list[Crop]:
    """Return one crop per cell (columns, rows) of a grid that is not empty.

    Raises:
        SheetError: all cells are empty, or narrower than a figure can be.
    """
    columns, rows = grid
    height, width = paint.shape
    if width < columns or height < rows:
        raise SheetError(f"a grid of {columns} x {rows} cells on {width} x {height} px; use fewer")
    crops = []
    for row in range(rows):
        for column in range(columns):
            left, right = column * width // columns, (column + 1) * width // columns
            top, bottom = row * height // rows, (row + 1) * height // rows
            crop = _crop(found, paint, (left, top, right - left, bottom - top))
            if crop.solid.sum() >= LEAST_CELL_PX:
                crops.append(_tight(crop, paint.shape, margin_px))
    if not crops:
        raise SheetError(f"all {columns} x {rows} cells are empty; correct --grid")
    return [crop for crop in crops if crop is not None]


def _crop(
    found: SheetLayout,
    paint: Bool[np.ndarray, "height width"],
    box: Box,
    cells: Int[np.ndarray, "rows columns"] | None = None,
    number: int = 0,
) -> Crop:
    """Return the crop of a window: of the figure `number`, or of all paint."""
    drawn = _window(paint, box) & ~in_pixels(found.ruled | found.shadow, found.cell_px, box)
    own = np.ones(drawn.shape, dtype=bool)
    if cells is not None:
        own = _own_pixels(cells, number, found.cell_px, box)
    paper = in_pixels(found.paper, found.cell_px, box)
    filled = None if found.filled is None else in_pixels(found.filled, found.cell_px, box)
    if found.cell_px > 1:
        free = ~drawn if filled is None else ~drawn & ~filled
        paper = connected_to(paper & free, free)
    solid = own & ~paper & ~in_pixels(found.shadow, found.cell_px, box)
    enclosed = solid & ~drawn
    return Crop(box, solid, enclosed, None if filled is None else enclosed & filled)


def _tight(crop: Crop, shape: tuple[int, ...], margin: int) -> Crop | None:
    """Return the crop around its pixels, with a margin; None if it is empty."""
    rows, columns = (np.flatnonzero(crop.solid.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    top, left = int(rows[0]), int(columns[0])
    height, width = int(rows[-1]) - top + 1, int(columns[-1]) - left + 1
    x, y = crop.box[0] + left, crop.box[1] + top
    before_x, before_y = min(margin, x), min(margin, y)
    after_x, after_y = min(margin, shape[1] - x - width), min(margin, shape[0] - y - height)
    pad = ((before_y, after_y), (before_x, after_x))
    window = slice(top, top + height), slice(left, left + width)
    box = x - before_x, y - before_y, width + before_x + after_x, height + before_y + after_y
    solid, enclosed = np.pad(crop.solid[window], pad), np.pad(crop.enclosed[window], pad)
    filled = None if crop.filled is None else np.pad(crop.filled[window], pad)
    return Crop(box, solid, enclosed, filled)


def _own_pixels(
    cells: Int[np.ndarray, "rows columns"], number: int, cell_px: int, box: Box
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels of a figure's cells; of large cells also those beside, if nobody's."""
    x, y, width, height = box
    if cell_px == 1:
        return _window(cells, box) == number + 1
    rows = slice(max(y // cell_px - 1, 0), (y + height) // cell_px + 2)
    columns = slice(max(x // cell_px - 1, 0), (x + width) // cell_px + 2)
    near = cells[rows, columns]
    own = dilate(near == number + 1) & ((near == 0) | (near == number + 1))
    local = (x - columns.start * cell_px, y - rows.start * cell_px, width, height)
    return np.asarray(in_pixels(own, cell_px, local), dtype=bool)


def _box(found: SheetLayout, number: int, shape: tuple[int, ...], margin: int) -> Box:
    """Return the box of a figure with its margin, in pixels of the sheet."""
    boxes = found.blobs.boxes[found.grouping.figure_of_blob == number] * found.cell_px
    left, top = np.maximum(boxes[:, :2].min(axis=0) - margin, 0)
    right, bottom = (boxes[:, :2] + boxes[:, 2:]).max(axis=0) + margin
    right, bottom = min(right, shape[1]), min(bottom, shape[0])
    return int(left), int(top), int(right - left), int(bottom - top)


def _window(picture: np.ndarray, box: Box) -> np.ndarray:
    x, y, width, height = box
    return picture[y : y + height, x : x + width]
