"""See drawings that were enlarged without smoothing: every pixel is a block of equal ones.

Blends along the edges are blocks then, and look like flat paint. All steps from colour to colour
lie on a grid; on it the picture is read at its own size, block by block. Pixel art, too, lies on a
grid, but has no blends: its colours come again and again, and it is right as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int, UInt8

from toonset.palette.pixels.antialias import OPAQUE
from toonset.raster import dilate

LARGEST = 32  # times: larger blocks are paint
ON_GRID = 0.98  # of the steps; those of a picture that was not enlarged lie anywhere
RIM = 2  # pixels of a cut-out's edge that matting may have changed
FEW = 4  # pixels of one colour: a blend, or a gradient's; two mirrored halves have it twice
BLENDS = 0.5  # of the colours that come so rarely; of enlarged pixel art 0.27 at most
LEAST_COLORS = 64  # fewer are no antialiased drawing

Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True, eq=False)
class Grid:
    """Blocks of an enlarged picture.

    Attributes:
        times: by which it was enlarged.
        rows, columns: number of the block of every row and column.
    """

    times: int
    rows: Int[np.ndarray, " height"]
    columns: Int[np.ndarray, " width"]

    def reduced(self, values: np.ndarray) -> np.ndarray:
        """Return one value per block, of (height, width, ...) values."""
        return values[_middles(self.rows)[:, None], _middles(self.columns)]

    def enlarged(self, values: np.ndarray) -> np.ndarray:
        """Return the blocks' values for every pixel."""
        return values[self.rows[:, None], self.columns]


def find_grid(rgba: Picture) -> Grid | None:
    """Return the blocks of a drawing with blends that was enlarged; None for others."""
    if not rgba.size:
        return None
    words = np.ascontiguousarray(rgba).view("<u4")[..., 0]
    core = ~dilate(rgba[..., 3] < OPAQUE, RIM)
    across = _period(((words[:, 1:] != words[:, :-1]) & core[:, 1:] & core[:, :-1]).sum(axis=0))
    if across is None:
        return None
    down = _period(((words[1:] != words[:-1]) & core[1:] & core[:-1]).sum(axis=1))
    if down is None or down[0] != across[0]:
        return None
    height, width = words.shape
    grid = Grid(across[0], _blocks(height, *down), _blocks(width, *across))
    own = grid.reduced(words)
    counts = np.unique(own[grid.reduced(core)], return_counts=True)[1]
    blended = len(counts) >= LEAST_COLORS and float((counts <= FEW).mean()) >= BLENDS
    return grid if blended else None


def common_grids(pictures: Sequence[Picture]) -> list[Grid] | None:
    """Return the pictures' grids if all were enlarged by the same factor, else None."""
    grids: list[Grid] = []
    for picture in pictures:
        grid = find_grid(picture)
        if grid is None or grid.times != (grids or [grid])[0].times:
            return None
        grids.append(grid)
    return grids or None


def _period(steps: Int[np.ndarray, " n"]) -> tuple[int, int] | None:
    """Return the largest period that the steps have, and where it begins; None if they have none.

    Args:
        steps: from each line to the next, how many.
    """
    total = int(steps.sum())
    at = np.arange(1, len(steps) + 1)
    for times in range(min(LARGEST, len(steps) // 2), 1, -1):
        on = np.bincount(at % times, steps, times)
        if total and on.max() >= ON_GRID * total:
            return times, int(on.argmax())
    return None


def _blocks(length: int, times: int, start: int) -> Int[np.ndarray, " length"]:
    number = (np.arange(length) - start) // times
    return number - number[0]


def _middles(block_of: Int[np.ndarray, " n"]) -> Int[np.ndarray, " blocks"]:
    """Return the middle line of every block."""
    first = np.searchsorted(block_of, np.arange(block_of[-1] + 1))
    last = np.searchsorted(block_of, np.arange(block_of[-1] + 1), side="right") - 1
    middle: Int[np.ndarray, " blocks"] = (first + last) // 2
    return middle
