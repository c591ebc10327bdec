"""Segment the whole sheet: foreground, background, and which figures stand where.

Very large sheets are segmented on cells of a few pixels; cutting out
(`toonset.dataset.split.sheet`) uses every pixel again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.dataset.split.background import Background, difference, ring_of, with_final_tolerance
from toonset.dataset.split.corrections import CORRECTIONS, SheetState
from toonset.dataset.split.figures.blobs import Blobs
from toonset.dataset.split.figures.grouping import Grouping, group_blobs
from toonset.dataset.split.figures.open_outlines import Gap
from toonset.dataset.split.figures.rows import LIKELIEST, Group, Taken
from toonset.dataset.split.ruled_lines import find_lines, line_pixels
from toonset.dataset.split.touching.cut import Cut
from toonset.errors import SheetError
from toonset.view import Box

LARGEST_SIDE = 4096  # pixels: a larger sheet is segmented on cells
BAND = 2**22  # pixels that are compared with the background at a time
PAINTED = 0.12  # of a cell: less is noise


@dataclass(frozen=True, eq=False)
class SheetLayout:
    """Segmentation of a sheet, in cells of `cell_px` pixels.

    Attributes:
        cell_px: width and height of a cell.
        paper: (rows, columns) cells that the border reaches through background.
        shadow: (rows, columns) cells of cast shadows.
        ruled: (rows, columns) cells of ruled lines.
        lines: boxes (x, y, width, height) in cells of ruled lines and drawn frames.
        blobs: patches of figures and other things.
        grouping: which patch is whose.
        cuts: where touching figures were cut apart.
        groups: equal figures, the likeliest turnaround first.
        taken: which of them are the views.
        filled: (rows, columns) cells of background within outlines that are open; None: of none.
        gaps: where those are open.
    """

    cell_px: int
    paper: Bool[np.ndarray, "rows columns"]
    shadow: Bool[np.ndarray, "rows columns"]
    ruled: Bool[np.ndarray, "rows columns"]
    lines: tuple[Box, ...]
    blobs: Blobs
    grouping: Grouping
    cuts: tuple[Cut, ...]
    groups: tuple[Group, ...]
    taken: Taken
    filled: Bool[np.ndarray, "rows columns"] | None
    gaps: tuple[Gap, ...]


def find_paint(
    rgba: UInt8[np.ndarray, "height width 4"], ground: Background
) -> tuple[Bool[np.ndarray, "height width"], Background]:
    """Return which pixels are not background, and the background with its final tolerance."""
    if ground.rgb is None:
        return rgba[..., 3] > 0, ground
    height, width = rgba.shape[:2]
    away = np.empty((height, width), dtype=np.uint8)
    rows = max(1, BAND // width)
    for top in range(0, height, rows):
        part = rgba[top : top + rows, :, :3]
        away[top : top + rows] = difference(part, ground.colors((0, top, width, len(part))))
    ground = with_final_tolerance(ground, away)
    return away > ground.tolerance, ground


def find_layout(
    rgba: UInt8[np.ndarray, "height width 4"],
    paint: Bool[np.ndarray, "height width"],
    ground: Background,
    without: Sequence[str] = (),
    taken: Taken = LIKELIEST,
) -> SheetLayout:
    """Segment a sheet.

    Args:
        rgba: the sheet.
        paint: pixels that are not background.
        ground: the background.
        without: names of corrections that are left out.
        taken: which figures are wanted.

    Raises:
        SheetError: there is no such correction, group or row.
    """
    for name in without:
        if name not in CORRECTIONS:
            known = ", ".join(CORRECTIONS)
            raise SheetError(f"split: there is no correction {name!r}; choose from {known}")
    cell = max(1, -(-max(paint.shape) // LARGEST_SIDE))
    painted = in_cells(paint, cell)
    lines = find_lines(painted)
    box = (0, 0, paint.shape[1], paint.shape[0])
    state = SheetState.first(
        np.ascontiguousarray(rgba[::cell, ::cell]),
        None if ground.rgb is None else ground.colors(box)[::cell, ::cell],
        ground.tolerance,
        painted,
        ring_of(painted.shape[0], painted.shape[1], ground.inset),
        line_pixels(painted, lines),
        tuple(line.box for line in lines),
        taken,
    )
    for name, propose in CORRECTIONS.items():
        if name not in without:
            state = propose(state) or state
    if not len(state.main_blobs) and state.groups:
        raise SheetError(_not_there(state.taken, state.groups))
    studies = [cut.study for cut in state.cuts if cut.study is not None]
    grouping = group_blobs(state.blobs, state.main_blobs, state.rgba[..., :3], studies)
    return SheetLayout(
        *(cell, state.paper, state.shadow, state.ruled, state.lines),
        *(state.blobs, grouping, state.cuts, state.groups, state.taken),
        *(state.filled, state.gaps),
    )


def _not_there(taken: Taken, groups: tuple[Group, ...]) -> str:
    if taken.group >= len(groups):
        return f"there is no such group: the sheet has {len(groups)} of them, numbered from 1"
    rows = len(groups[taken.group].rows)
    if rows == 1:
        return "there is no such outfit: the group has one row of figures"
    return f"there is no such outfit: the group has {rows} rows, A to {chr(ord('A') + rows - 1)}"


def in_cells(
    mask: Bool[np.ndarray, "height width"], cell_px: int
) -> Bool[np.ndarray, "rows columns"]:
    """Return which cells the mask covers by more than noise."""
    if cell_px == 1:
        return mask
    height, width = mask.shape
    below, beside = -height % cell_px, -width % cell_px
    padded = cv2.copyMakeBorder(
        255 * mask.view(np.uint8), 0, below, 0, beside, cv2.BORDER_REPLICATE
    )
    size = padded.shape[1] // cell_px, padded.shape[0] // cell_px
    return cv2.resize(padded, size, interpolation=cv2.INTER_AREA) > 255 * PAINTED


def in_pixels(cells: np.ndarray, cell_px: int, box: Box) -> np.ndarray:
    """Return the cells' values for every pixel of a window (x, y, width, height) of the sheet."""
    x, y, width, height = box
    rows = np.arange(y, y + height) // cell_px
    columns = np.arange(x, x + width) // cell_px
    return cells[rows[:, None], columns]


def figure_cells(found: SheetLayout) -> Int[np.ndarray, "rows columns"]:
    """Return the number of the figure of every cell, plus 1; 0 = none."""
    number = np.append(0, found.grouping.figure_of_blob + 1).astype(np.int16)
    return number[found.blobs.labels]
