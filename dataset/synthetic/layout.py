"""Lay out the cells of a synthetic sheet, and paste them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8


@dataclass(frozen=True)
class CellGrid:
    """Square cells side by side, in rows from the top; figures keep clear of their cell's rim.

    Attributes:
        count: cells.
        columns: cells in a full row.
        cell_px: width and height of a cell.
        caption_px: height of the strip for a caption below every cell.
        title_px: height of the strip above all cells.
    """

    count: int
    columns: int
    cell_px: int
    caption_px: int = 0
    title_px: int = 0

    @property
    def size_wh(self) -> tuple[int, int]:
        """Return width and height of the sheet."""
        rows = math.ceil(self.count / self.columns)
        return self.columns * self.cell_px, self.title_px + rows * (self.cell_px + self.caption_px)

    def box(self, index: int) -> tuple[int, int, int, int]:
        """Return (x, y, width, height) of a cell in the sheet."""
        row, column = divmod(index, self.columns)
        y = self.title_px + row * (self.cell_px + self.caption_px)
        return column * self.cell_px, y, self.cell_px, self.cell_px

    def figure_box(
        self, index: int, rgba: UInt8[np.ndarray, "cell cell 4"]
    ) -> tuple[int, int, int, int]:
        """Return (x, y, width, height) in the sheet of what a cell shows."""
        x, y, _, _ = self.box(index)
        rows = np.flatnonzero(rgba[..., 3].any(axis=1))
        columns = np.flatnonzero(rgba[..., 3].any(axis=0))
        return (
            x + int(columns[0]),
            y + int(rows[0]),
            int(columns[-1] - columns[0]) + 1,
            int(rows[-1] - rows[0]) + 1,
        )


def paste(
    cells: Sequence[UInt8[np.ndarray, "cell cell 4"]],
    grid: CellGrid,
    ground: UInt8[np.ndarray, "height width 3"] | None,
) -> UInt8[np.ndarray, "height width 4"]:
    """Return the sheet: cells over the ground; None keeps it transparent."""
    width, height = grid.size_wh
    sheet = np.zeros((height, width, 4), np.uint8)
    for index, cell in enumerate(cells):
        x, y, w, h = grid.box(index)
        sheet[y : y + h, x : x + w] = cell
    if ground is None:
        return sheet
    alpha = sheet[..., 3:] / 255
    rgb = alpha * sheet[..., :3] + (1 - alpha) * ground
    opaque = np.full((height, width, 1), 255.0)
    return np.rint(np.concatenate([rgb, opaque], axis=-1)).astype(np.uint8)
