"""Lines that make rectangles: panels and tables, whose lines meet or go on behind figures."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from toonset.dataset.split.lines import OPEN_ACROSS, Line, is_on, length_of, open_columns

SHARED = 0.3  # of the sheet's side: a line so long counts with others
THROUGHOUT = 0.75  # of the columns with paper above and below that a broken line crosses


def closed_lines(
    lines: list[Line], free: list[Line], slack: float, heights: list[Line]
) -> list[Line]:
    """Return the lines both of whose ends meet lines across, until all do: rectangles, tables."""
    kept = list(lines)
    while True:
        left = [line for line in kept if line in free or _is_joined(line, kept, slack, heights)]
        if len(left) == len(kept):
            return left
        kept = left


def rectangle_sides(paint: np.ndarray, lines: list[Line], shortest: float) -> list[Line]:
    """Return the sides of rectangles that go on wherever the figures before them leave paper."""
    across = _levels([line for line in lines if not line.vertical], SHARED * paint.shape[1])
    upright = _levels([line for line in lines if line.vertical], SHARED * paint.shape[0])
    found = dict[Line, None]()
    for left, right in combinations(upright, 2):
        sides = [replace(line, start=left.first, stop=right.last + 1) for line in across]
        sides = [line for line in sides if line.stop - line.start >= shortest]
        for top, bottom in combinations([line for line in sides if _goes_on(paint, line)], 2):
            start, stop = top.first, bottom.last + 1
            both = [replace(line, start=start, stop=stop) for line in (left, right)]
            if stop - start >= shortest and all(_goes_on(paint.T, line) for line in both):
                found |= dict.fromkeys([top, bottom, *both])
    return list(found)


def _levels(lines: list[Line], least: float) -> list[Line]:
    """Return the levels, in order, on which pieces of such a length lie."""
    pieces = list[list[Line]]()
    for line in sorted(lines, key=lambda line: line.start - line.stop):
        own = next((own for own in pieces if is_on(line, own[0])), None)
        if own is None:
            pieces.append([line])
        else:
            own.append(line)
    return sorted(
        (
            replace(own[0], first=min(x.first for x in own), last=max(x.last for x in own))
            for own in pieces
            if length_of(own) >= least
        ),
        key=lambda line: line.first,
    )


def _goes_on(paint: np.ndarray, line: Line) -> bool:
    """Return whether a line is drawn nearly wherever there is paper on both of its sides."""
    open_, rows = (
        open_columns(paint, line),
        paint[line.first : line.last + 1, line.start : line.stop],
    )
    drawn = rows[:, open_].all(axis=0)  # a line drawn by hand leaves its level
    return bool(open_.mean() >= OPEN_ACROSS and drawn.mean() >= THROUGHOUT)


def _is_joined(line: Line, others: list[Line], slack: float, heights: list[Line]) -> bool:
    """Return whether both ends meet lines across; height lines have corners at their ends only."""
    middle = (line.first + line.last) / 2
    met = [
        (other.first + other.last) / 2
        for other in others
        if other.vertical != line.vertical and _reaches(other, middle, slack, other in heights)
    ]
    return all(any(abs(place - end) <= slack for place in met) for end in (line.start, line.stop))


def _reaches(line: Line, place: float, slack: float, at_ends: bool) -> bool:
    """Return whether a line reaches a place along it, or has one of its ends there."""
    if at_ends:
        return min(abs(place - line.start), abs(place - line.stop)) <= slack
    return line.start - slack <= place <= line.stop + slack
