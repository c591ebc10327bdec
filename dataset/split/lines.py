"""A straight line in paint: whether paper lies beside it, and whether others are its equals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

LEAST_RUN_PX = 24  # a shorter run is no line's; equals lie farther apart
CROSSING = 0.6  # of the sheet's width: a line this long needs no others
EQUALS = 4  # lines that begin and end together
UPRIGHT = 0.9  # of its height, for upright ones: staffs and poles are shorter
OPEN = 0.5  # of the line's length with paper on both sides
OPEN_UPRIGHT = 0.7  # the same of upright lines, which no figure stands behind
OPEN_ACROSS = 0.2  # the same of a line that crosses the sheet, behind all figures
BROKEN_PX = 5  # gaps in a run that noise may leave


@dataclass(frozen=True)
class Line:
    """A straight line of the sheet; rows and columns change roles for vertical ones.

    Attributes:
        first: its first row.
        last: its last row.
        start: its first column.
        stop: the column after its last.
        vertical: rows are columns.
    """

    first: int
    last: int
    start: int
    stop: int
    vertical: bool

    @property
    def box(self) -> tuple[int, int, int, int]:
        """Return x, y, width, height."""
        if self.vertical:
            return self.first, self.start, self.last - self.first + 1, self.stop - self.start
        return self.start, self.first, self.stop - self.start, self.last - self.first + 1


def length_of(pieces: list[Line]) -> int:
    """Return how long pieces are together."""
    return sum(line.stop - line.start for line in pieces)


def open_columns(paint: np.ndarray, line: Line) -> Bool[np.ndarray, " columns"]:
    """Return the columns of a line with paper above and below."""
    above, below = paint_beside(paint, line)
    return np.asarray(~above & ~below)


def ends_with(line: Line, other: Line) -> bool:
    """Return whether two lines begin and end together."""
    return max(abs(other.start - line.start), abs(other.stop - line.stop)) <= BROKEN_PX


def is_on(line: Line, other: Line) -> bool:
    """Return whether two lines share rows, or touch."""
    return line.first <= other.last + 1 and other.first <= line.last + 1


def is_open(paint: np.ndarray, line: Line, *, equals: bool = False) -> bool:
    """Return whether there is paper on both sides along enough of a line."""
    columns = slice(line.start, line.stop)
    reach = line.last - line.first + 2
    above = paint[max(line.first - 1 - reach, 0) : max(line.first - 1, 0), columns]
    below = paint[line.last + 2 : line.last + 2 + reach, columns]
    closed_above = above.all(axis=0) & bool(len(above))
    closed_below = below.all(axis=0) & bool(len(below))
    length = line.stop - line.start
    across = equals or (not line.vertical and length >= CROSSING * paint.shape[1])
    least = OPEN_ACROSS if across else OPEN_UPRIGHT if line.vertical else OPEN
    return bool(np.mean(~closed_above & ~closed_below) >= least)


def paint_beside(paint: np.ndarray, line: Line) -> tuple[np.ndarray, np.ndarray]:
    """Return whether something is painted just above and just below each column of a line."""
    columns = slice(line.start, line.stop)
    nothing = np.zeros(line.stop - line.start, dtype=bool)
    above = paint[line.first - 2, columns] if line.first >= 2 else nothing
    below = paint[line.last + 2, columns] if line.last + 2 < len(paint) else nothing
    return above, below


def crosses(line: Line, shape: tuple[int, ...]) -> bool:
    """Return whether a line crosses most of the sheet."""
    length = line.stop - line.start
    return length >= (UPRIGHT * shape[0] if line.vertical else CROSSING * shape[1])


def has_equals(line: Line, lines: list[Line], least: float) -> bool:
    """Return whether level lines of a good length begin and end together, as height lines do."""
    if line.vertical or line.stop - line.start < least:
        return False
    levels = sorted(other.first for other in lines if not other.vertical and ends_with(line, other))
    return 1 + int((np.diff(levels) > LEAST_RUN_PX).sum()) >= EQUALS  # no line drawn by hand
