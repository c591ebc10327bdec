"""Detect ruled lines: frames round the sheet or a figure, tables, ground and height lines.

A line is a thin straight run with paper along most of it, or a row of dashes. It counts if it
crosses most of the sheet, or if it closes a rectangle with other lines; so a spear, a belt or a
letter is not a ruled line.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Bool

from toonset.dataset.split.figures.frames import LEAST_SIDE
from toonset.dataset.split.lines import (
    BROKEN_PX,
    CROSSING,
    LEAST_RUN_PX,
    UPRIGHT,
    Line,
    crosses,
    ends_with,
    has_equals,
    is_on,
    is_open,
    length_of,
    open_columns,
    paint_beside,
)
from toonset.dataset.split.rectangles import SHARED, THROUGHOUT, closed_lines, rectangle_sides

LEAST_RUN = 0.04  # of the sheet's side along the line
LEAST_SHEET = 100  # cells on the shorter side: on a smaller picture a line is part of a drawing
THICKEST = 0.015  # of the sheet's shorter side
BAR = 0.05  # of its height: one from edge to edge, on which figures stand
THICKEST_PX = 6  # whatever the sheet's size
ALIKE = 0.8  # overlap of the runs of neighbouring rows
OPEN_LIKE = 0.1  # of the length of a line like several others: paper on both sides
DASHES = 6  # flat pieces in a row: a dashed line
EQUAL = 0.25  # of their length: dashes differ by less
MOSTLY = 0.6  # of the dashes; figures cut some short
HAIR = 8  # part of the thickest line: so thin are the pieces of faint lines
LEVEL = 0.0008  # of the sheet's width: they lie on one level
CRUMBS = 10  # pieces of a faint line
FAINT = 0.02  # of the sheet's width that they cover
STANDING_OUT = 4  # times what rows have of them on the average: else they are a pencil's grain
LONGEST_DASH = 0.1  # of the sheet's side
JOINT = 0.02  # of the shorter side: corners may miss each other by so much
SOFT_PX = 3  # from figures: nearer to them a line's soft edge is left


def find_lines(paint: Bool[np.ndarray, "height width"]) -> list[Line]:
    """Return the ruled lines of a sheet.

    Args:
        paint: pixels that are not background-coloured.
    """
    height, width = paint.shape
    if min(height, width) < LEAST_SHEET:
        return []
    thickest = max(THICKEST_PX, round(THICKEST * min(height, width)))
    lines = []
    for vertical in (False, True):
        turned = np.ascontiguousarray(paint.T) if vertical else paint
        lines += _straight(turned, thickest, vertical=vertical)
        lines += _dashed(turned, thickest, vertical=vertical)
    heights = [line for line in lines if has_equals(line, lines, SHARED * width)]
    free = [line for line in lines if crosses(line, paint.shape) or line in heights]
    closed = closed_lines(lines, free, JOINT * min(height, width) + thickest, heights)
    shortest = LEAST_SIDE * min(height, width)
    closed += rectangle_sides(paint, lines, shortest)
    return free + [
        line for line in closed if line not in free and line.stop - line.start >= shortest
    ]


def line_pixels(
    paint: Bool[np.ndarray, "height width"], lines: list[Line]
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels of the lines, except where a figure or its outline goes through them."""
    found = np.zeros(paint.shape, dtype=bool)
    for line in lines:
        source, target = (paint.T, found.T) if line.vertical else (paint, found)
        columns = slice(line.start, line.stop)
        above, below = paint_beside(source, line)
        target[line.first : line.last + 1, columns] |= ~(
            (above & below) | _slanting(source, line, above, below)
        )
        near = _near(above | below, SOFT_PX)
        for edge in (line.first - 1, line.last + 1):
            if not line.vertical and 0 <= edge < len(target):
                target[edge, columns] |= ~near  # its soft edge, not that of a leg's outline
    return found & paint


def _slanting(
    paint: np.ndarray, line: Line, above: np.ndarray, below: np.ndarray
) -> Bool[np.ndarray, " columns"]:
    """Return the columns between which something slants through a line and goes on beyond it."""
    reach = line.last - line.first + 1
    farther = replace(line, first=line.first - 2 * reach, last=line.last + 2 * reach)
    over, under = (_near(mask, 2 * reach) for mask in paint_beside(paint, farther))
    over, under = over & above, under & below
    after = np.ones(2 * reach + 1)
    size = len(over)
    right_of_over, right_of_under = (np.convolve(m, after)[:size] > 0 for m in (over, under))
    left_of_over, left_of_under = (np.convolve(m, after)[-size:] > 0 for m in (over, under))
    return np.asarray((right_of_over & left_of_under) | (left_of_over & right_of_under))


def _near(mask: np.ndarray, reach: int) -> Bool[np.ndarray, " columns"]:
    return np.asarray(np.convolve(mask, np.ones(2 * reach + 1), "same")[: len(mask)] > 0)


def _straight(paint: np.ndarray, thickest: int, *, vertical: bool) -> list[Line]:
    """Return thin horizontal lines with paper beside them."""
    least = max(LEAST_RUN_PX, round(LEAST_RUN * paint.shape[1]))
    bar = thickest if vertical else max(thickest, round(BAR * paint.shape[0]))
    whole = cv2.morphologyEx(
        paint.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((1, BROKEN_PX), np.uint8)
    )
    edges = np.diff(np.pad(whole, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, starts = np.nonzero(edges == 1)
    stops = np.nonzero(edges == -1)[1]
    long = stops - starts >= least
    runs = zip(rows[long].tolist(), starts[long].tolist(), stops[long].tolist(), strict=True)
    bands = _stacked(list(runs))
    lines = [
        Line(*band, vertical)
        for band in bands
        if band[1] - band[0] < (thickest if band[3] - band[2] < paint.shape[1] else bar)
    ]
    lines += _broken(paint, lines)
    shared = SHARED * paint.shape[1]
    lines = [line for line in lines if is_open(paint, line, equals=has_equals(line, lines, shared))]
    return lines if vertical else lines + _like_whole(paint, lines)


def _broken(paint: np.ndarray, lines: list[Line]) -> list[Line]:
    """Return lines across the sheet whose pieces figures interrupt.

    They go on wherever there is paper, but behind clothes in the paper's colour, unless they begin
    and end where a whole line does: height lines are ruled together, and hems end earlier.
    """
    found, long = list[Line](), list[Line]()
    side = paint.shape[1]
    across = [line for line in lines if line.stop - line.start >= CROSSING * side]
    whole = [line for line in across if is_open(paint, line)]
    levels = dict[int, list[Line]]()
    for line in lines:
        levels.setdefault(line.first, []).append(line)
    for first, own in sorted(levels.items(), key=lambda level: (-length_of(level[1]), level[0])):
        last, vertical, length = max(line.last for line in own), own[0].vertical, length_of(own)
        line = Line(first, last, min(x.start for x in own), max(x.stop for x in own), vertical)
        level = _level(paint, line, lines)
        apart = [other for other in whole if abs(other.first - first) > LEAST_RUN_PX]
        if sum(ends_with(level, other) for other in apart) > 1:  # a frame has one other side
            line = level
            if line not in whole and not any(is_on(line, other) for other in found):
                found.append(line)
        elif len(own) > 1 and length >= (UPRIGHT if vertical else SHARED) * side:
            open_, rows = open_columns(paint, line), paint[first : last + 1, line.start : line.stop]
            if open_.any() and rows[:, open_].all(axis=0).mean() >= THROUGHOUT:
                found.append(line)
        if line in found and (vertical or length >= CROSSING * side):
            long.append(line)
    return [line for line in found if line in long or has_equals(line, found, SHARED * side)]


def _like_whole(paint: np.ndarray, lines: list[Line]) -> list[Line]:
    """Return levels that go on like several whole lines, though no piece of them is long."""
    across = [line for line in lines if line.stop - line.start >= CROSSING * paint.shape[1]]
    whole = [line for line in across if has_equals(line, across, SHARED * paint.shape[1])]
    if not whole:
        return []
    start, stop = whole[0].start, whole[0].stop
    thin = min(line.last - line.first for line in whole if ends_with(line, whole[0]))
    rows, middle = paint[:, start:stop], len(paint) - thin - 4
    if middle <= 0:
        return []
    drawn = np.logical_and.reduce([rows[2 + k : 2 + k + middle] for k in range(thin + 1)])
    open_ = ~rows[:middle] & ~rows[thin + 4 :]
    paper = np.count_nonzero(open_, axis=1)
    crossed = np.count_nonzero(drawn & open_, axis=1)
    first = 2 + np.flatnonzero(
        (paper >= OPEN_LIKE * (stop - start)) & (crossed >= THROUGHOUT * paper)
    )
    levels = [Line(int(row), int(row) + thin, start, stop, vertical=False) for row in first]
    return [level for level in levels if not any(is_on(level, other) for other in whole)]


def _level(paint: np.ndarray, line: Line, lines: list[Line]) -> Line:
    """Return a line as far as pieces on its level go: it may drift, and short ones are no runs."""
    near = [x for x in lines if line.first - 1 <= x.first and x.last <= line.last + 1]
    drawn = paint[line.first : line.last + 1].any(axis=0)
    drawn &= open_columns(paint, replace(line, start=0, stop=paint.shape[1]))
    edges = np.diff(np.pad(drawn, 1).astype(np.int8))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = stops - starts > BROKEN_PX
    start = min(starts[long].min(initial=len(drawn)), *(x.start for x in near))
    stop = max(stops[long].max(initial=0), *(x.stop for x in near))
    return replace(line, start=int(start), stop=int(stop))


def _dashed(paint: np.ndarray, thickest: int, *, vertical: bool) -> list[Line]:
    """Return rows of dashes: many thin flat pieces on one level that span most of the sheet."""
    stats = cv2.connectedComponentsWithStats(paint.view(np.uint8), connectivity=8)[2][1:]
    left, top, width, height = stats[:, :4].T
    thin = (height <= max(3, thickest // 2)) & (width >= 2 * height)
    flat = thin & (width <= LONGEST_DASH * paint.shape[1])
    lines: list[Line] = []
    hair = flat & (height <= max(2, thickest // HAIR))
    slack = max(1, round(LEVEL * paint.shape[1]))
    each = np.bincount(top[hair], width[hair], len(paint))
    covered = np.convolve(each, np.ones(2 * slack + 1), "same")
    least = max(FAINT * paint.shape[1], STANDING_OUT * float(np.mean(covered)))
    for level in np.unique(top[flat]):
        own = flat & (np.abs(top - level) <= 1)
        faint = hair & (np.abs(top - level) <= slack)
        if covered[level] >= least and _spans(left[faint], paint.shape[1]):
            last = int((top + height)[faint].max()) - 1
            if not lines or lines[-1].last < level - slack:
                lines.append(Line(int(level), last, 0, paint.shape[1], vertical))
            continue
        start, stop = int(left[own].min()), int((left + width)[own].max())
        if own.sum() < DASHES or stop - start < CROSSING * paint.shape[1]:
            continue
        usual = np.median(width[own])
        if np.mean(np.abs(width[own] - usual) <= EQUAL * usual) < MOSTLY:
            continue  # a line of small print
        last = int((top + height)[own].max()) - 1
        if not lines or lines[-1].last < level - 1:
            lines.append(Line(int(level), last, 0, paint.shape[1], vertical))
    return lines


def _spans(left: np.ndarray, side: int) -> bool:
    """Return whether hair-thin pieces are spread as what a scan leaves of a line across a sheet."""
    return len(left) >= CRUMBS and len(np.unique(10 * left // side)) >= 10 * CROSSING


def _stacked(runs: list[tuple[int, int, int]]) -> list[tuple[int, int, int, int]]:
    """Return (first row, last row, start, stop) of runs that lie below each other."""
    done: list[tuple[int, int, int, int]] = []
    growing: list[tuple[int, int, int, int]] = []
    for row, start, stop in runs:
        for i, (first, last, left, right) in enumerate(growing):
            shared = min(stop, right) - max(start, left)
            if last == row - 1 and shared >= ALIKE * max(stop - start, right - left):
                growing[i] = (first, row, min(start, left), max(stop, right))
                break
        else:
            growing.append((row, row, start, stop))
        if len(growing) > 256:
            done += [band for band in growing if band[1] < row - 1]
            growing = [band for band in growing if band[1] >= row - 1]
    return done + growing
