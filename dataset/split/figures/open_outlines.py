"""Close outlines that are nearly closed: line art with gaps, broken pencil lines.

The background is flooded from outside with a ball that does not fit through gaps (trapped-ball
segmentation, Zhang et al. 2009, "Vectorizing cartoon animations"). What only a smaller ball
reaches is a pocket: the inside of an open outline, or the gap between legs, between arm and body.
They are told apart by their walls. Behind the line around a figure lies the outside again; behind
an arm or a leg, painted or closed, it does not. Each pocket is cut off by the smallest ball that
does not enter it. Paper between two figures is no pocket of either.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.dataset.split.figures.blobs import find_blobs
from toonset.dataset.split.figures.rows import find_groups
from toonset.raster import connected_to, dilate, sized_parts, wider_than

SEEN_AT = 280  # cells of a figure's height: outlines of larger figures are closed on coarser ones
MEASURED_AT = 1000  # cells of the longer side: the figures' height is measured on coarser ones
LARGEST = 0.03  # of the figure's height: half of the widest gap that is closed in line drawings
LARGEST_PAINTED = 0.02  # the same in painted ones
LOOKED_FOR = 0.05  # the same of gaps that are said, not closed
WALL = 0.03  # of the figure's height, and two cells: no line is thicker
LEAST_POCKET = 0.002  # of the figure's squared height: smaller pockets are corners of the outline
LINE = 0.012  # of the figure's height: half of the thickest line
JOIN = 0.012  # of the figure's height: across gaps so wide lines are of one figure
TALL, SOLID = 0.6, 0.04  # of the figure's height, and squared: what is less is no figure
BESIDE = 2  # cells from a pocket: its walls
STEP = 1.2  # times the ball before: the next

Mask = Bool[np.ndarray, "rows columns"]


@dataclass(frozen=True)
class Evidence:
    """Least evidence for the inside of an open outline.

    Attributes:
        share: of its walls that are lines with the outside behind them.
        length: of those lines, in the figure's height.
        enough: so long lines are enough, whatever their share.
        roomier: times the gap's width: what is narrower is a cleft.
        area: in the figure's squared height.
        ball: half of the widest gap that is closed, in the figure's height.
        looked_for: the same of gaps that are found.
    """

    share: float
    length: float
    enough: float
    roomier: float
    area: float
    ball: float
    looked_for: float

    def holds(
        self, length: Int[np.ndarray, "*parts"], facing: Int[np.ndarray, "*parts"], height: float
    ) -> Bool[np.ndarray, "*parts"]:
        """Return which walls of so many cells have enough lines among them."""
        share = np.minimum(self.share * length, self.enough * height)
        return facing >= np.maximum(share, self.length * height)


OF_LINES = Evidence(0.1, 0.06, 0.4, 1.5, 0.002, LARGEST, LOOKED_FOR)
OF_PAINT = Evidence(0.25, 0.1, 0.4, 2.0, 0.003, LARGEST_PAINTED, LARGEST_PAINTED)


@dataclass(frozen=True)
class Gap:
    """Gap of an outline.

    Attributes:
        x: of its middle, in cells of the sheet.
        y: of its middle, in cells of the sheet.
        width: in cells.
        area: of the pocket that was open there, in cells.
        height: of the sheet's figures, in cells.
        closed: whether what lies behind it was taken for the figure's inside.
    """

    x: int
    y: int
    width: float
    area: int
    height: float
    closed: bool = True


def close_outlines(walls: Mask, paper: Mask, ring: Mask) -> tuple[Mask, tuple[Gap, ...]]:
    """Return the background within nearly closed outlines, and where they are open.

    Args:
        walls: what is drawn.
        paper: background that the outside reaches.
        ring: cells at the border, where the outside begins.
    """
    coarse = max(1, max(paper.shape) // MEASURED_AT)
    height = coarse * _figure_height(_pooled(~paper, coarse))
    step = max(1, round(height / SEEN_AT))
    drawn = _pooled(walls, step)
    outside = _pooled(paper, step) & ~drawn
    pockets, gaps = _close(drawn, outside, _pooled(ring, step) & outside, height / step)
    if not gaps:
        return np.zeros_like(walls), ()
    rows, columns = (np.arange(size) // step for size in walls.shape)
    filled = pockets[rows[:, None], columns] & paper
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    for _ in range(step if step > 1 else 0):  # up to the lines, which coarse cells contain
        filled = cv2.dilate(filled.view(np.uint8), cross).view(np.bool_) & paper
    scaled = [
        Gap(
            *(step * gap.x + step // 2, step * gap.y + step // 2, step * gap.width),
            *(step * step * gap.area, height, gap.closed),
        )
        for gap in gaps
    ]
    return filled, tuple(scaled)


def line_walls(
    numbers: Int[np.ndarray, "rows columns"], count: int, drawn: Mask, outside: Mask, height: float
) -> Bool[np.ndarray, " parts"]:
    """Return which patches are closed off by lines: a good share of their walls has no limb behind.

    Args:
        numbers: of every cell's patch, from 1; 0 elsewhere.
        count: of numbers, with 0.
        drawn: what walls are made of.
        outside: what lies behind a line around the figure.
        height: of the figure, in cells.
    """
    length, facing = _walls(numbers, count, drawn, outside, height)
    return OF_LINES.holds(length, facing, height)


def _walls(
    numbers: Int[np.ndarray, "rows columns"], count: int, drawn: Mask, outside: Mask, height: float
) -> tuple[Int[np.ndarray, " parts"], Int[np.ndarray, " parts"]]:
    """Return how long every patch's walls are, and how much of that is a line."""
    walled = (numbers > 0) & dilate(drawn)
    walled &= ~dilate((numbers > 0) & dilate(outside), 2)  # an opening is no wall
    behind = walled & (_distance(outside) <= WALL * height + 2)
    length, facing = (np.bincount(numbers[mask], minlength=count) for mask in (walled, behind))
    return length, facing


def _figure_height(solid: Mask) -> float:
    """Return how high the figures are, whose lines may be in pieces."""
    reach = max(1, round(JOIN / 3 * min(solid.shape)))
    height = 0.0
    for _ in range(3):
        blobs = find_blobs(dilate(solid, reach))
        groups = find_groups(blobs)
        height = groups[0].height - 2 * reach if groups else 0.0
        if round(JOIN * height) <= reach:
            break
        reach = round(JOIN * height)
    return height


def _pooled(mask: Mask, step: int) -> Mask:
    """Return which coarse cells hold any of a mask."""
    below, beside = -mask.shape[0] % step, -mask.shape[1] % step
    whole = np.pad(mask, ((0, below), (0, beside)))
    size = whole.shape[0] // step, step, whole.shape[1] // step, step
    return np.asarray(whole.reshape(size).any(axis=(1, 3)))


def _close(drawn: Mask, outside: Mask, seeds: Mask, height: float) -> tuple[Mask, list[Gap]]:
    pockets, gaps = np.zeros_like(drawn), list[Gap]()
    room = _distance(drawn)
    least = OF_LINES if _is_line_drawing(drawn, outside, height) else OF_PAINT
    reached = _reached(room, outside, seeds, least.looked_for * height)
    numbers, areas = sized_parts(outside & ~reached, connectivity=4)
    bodies = _bodies(drawn, outside, height)
    for number in range(1, len(areas)):
        if areas[number] < least.area * height**2:
            continue
        window = _around(numbers == number, round(WALL * height) + 4)
        found = _smallest(
            *(
                numbers[window] == number,
                drawn[window],
                reached[window],
                room[window],
                height,
                least,
            )
        )
        y, x = window[0].start, window[1].start
        for inside, gap in found:
            if gap.closed:
                beside = np.unique(bodies[window][dilate(inside, BESIDE)])
                if np.count_nonzero(beside) > 1:
                    continue
                pockets[window] |= inside
            gaps.append(replace(gap, x=gap.x + x, y=gap.y + y))
    return pockets, gaps


def _bodies(drawn: Mask, outside: Mask, height: float) -> Int[np.ndarray, "rows columns"]:
    """Return the number of every cell's figure, 0 where there is none: what is high and solid."""
    blobs = find_blobs(drawn | ~outside)
    solid = (blobs.areas >= SOLID * height**2) & (blobs.boxes[:, 3] > TALL * height)
    return np.where(np.append(False, solid)[blobs.labels], blobs.labels, 0)


def _is_line_drawing(drawn: Mask, outside: Mask, height: float) -> bool:
    """Return whether the sheet shows lines: beside them more paper than paint."""
    painted = np.count_nonzero(wider_than(drawn, max(1, round(LINE * height))))
    lines = np.count_nonzero(drawn) - painted
    enclosed = np.count_nonzero(~drawn & ~outside)
    return bool(painted < max(enclosed, lines))


def _smallest(
    pocket: Mask,
    drawn: Mask,
    reached: Mask,
    room: Float[np.ndarray, "rows columns"],
    height: float,
    least: Evidence,
) -> list[tuple[Mask, Gap]]:
    """Return the parts of a pocket, each cut off by the smallest ball that does not enter it."""
    found, left, ball = list[tuple[Mask, Gap]](), pocket, 1.0
    while ball < least.looked_for * height * STEP and left.any():
        within = _reached(room, left | reached, reached, min(ball, least.looked_for * height))
        numbers, areas = sized_parts(left & ~within, connectivity=4)
        length, facing = _walls(numbers, len(areas), drawn, within, height)
        for number in range(1, len(areas)):
            part = numbers == number
            asked = least if ball <= least.ball * height else OF_PAINT
            if areas[number] < asked.area * height**2 or room[part].max() < asked.roomier * ball:
                continue
            if asked.holds(length[number], facing[number], height):
                gap = _gap(part, within, 2 * ball - 1, height)
                found.append((part, replace(gap, closed=ball <= least.ball * height)))
                left = left & ~part
        room = np.where(left | reached, room, 0)
        ball *= STEP
    return found


def _gap(part: Mask, outside: Mask, width: float, height: float) -> Gap:
    rows, columns = np.nonzero(part & dilate(outside))
    if not len(rows):
        rows, columns = np.nonzero(part)
    middle = len(rows) // 2
    return Gap(int(columns[middle]), int(rows[middle]), width, int(part.sum()), height)


def _reached(room: Float[np.ndarray, "rows columns"], free: Mask, seeds: Mask, ball: float) -> Mask:
    """Return the free cells that a ball covers on its way from the seeds."""
    return free & (_distance(connected_to(seeds, (room > ball) & free)) <= ball + 0.5)


def _distance(marked: Mask) -> Float[np.ndarray, "rows columns"]:
    return cv2.distanceTransform((~marked).view(np.uint8), cv2.DIST_L2, 5)


def _around(mask: Mask, margin: int) -> tuple[slice, slice]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(int(rows[0]) - margin, 0), int(rows[-1]) + margin + 1),
        slice(max(int(columns[0]) - margin, 0), int(columns[-1]) + margin + 1),
    )
