"""Cut masks into runs: the stretches of figure in each row of pixels.

Runs of neighbouring rows that overlap are linked, so that what belongs to a run (its middle, its
depth) can be smoothed along a limb without a look at what lies beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.nerf.sections.drawing import TALL, Drawing, Mask, Picture, signed_distance

TOUCHING_PX = round(0.1 * TALL)  # rows in which a limb may touch the body
SLANT_PX = 3  # gaps above and below may lie twice as far beside each other


@dataclass(frozen=True, eq=False)
class Runs:
    """The runs of a mask, row by row and from left to right.

    Attributes:
        row: (n,) of each run.
        start: (n,) its first column.
        end: (n,) the column after its last.
        number: (height, width) the run nearest to each pixel in its row; rows without a run are
            those of the nearest row that has one.
    """

    row: Int[np.ndarray, " n"]
    start: Int[np.ndarray, " n"]
    end: Int[np.ndarray, " n"]
    number: Int[np.ndarray, "height width"]

    @property
    def middle(self) -> Float[np.ndarray, " n"]:
        """Return the middles, px from the picture's left edge."""
        return ((self.start + self.end) / 2).astype(np.float32)

    @property
    def half(self) -> Float[np.ndarray, " n"]:
        """Return half the widths, px."""
        return ((self.end - self.start) / 2).astype(np.float32)

    def widest(self) -> Float[np.ndarray, " n"]:
        """Return, for each run, half the width of the widest one in its row."""
        widest = np.zeros(len(self.number), np.float32)
        np.maximum.at(widest, self.row, self.half)
        return widest[self.row]

    def means(
        self, picture: Float[np.ndarray, "height width n"], weight: Picture
    ) -> Float[np.ndarray, "runs n"]:
        """Return the weighted mean of a picture's values over each run."""
        sums = np.cumsum(np.pad(picture * weight[..., None], ((0, 0), (1, 0), (0, 0))), axis=1)
        totals = np.cumsum(np.pad(weight, ((0, 0), (1, 0))), axis=1)
        spent = sums[self.row, self.end] - sums[self.row, self.start]
        total = totals[self.row, self.end] - totals[self.row, self.start]
        return spent / np.maximum(total, 1e-6)[:, None]

    def links(self, of: Bool[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray]:
        """Return each run's neighbour in the row above and below, itself where there is none.

        Neighbours overlap each other more than any other run, and only some runs have and are
        neighbours.
        """
        above = self._best(-1, of)
        below = self._best(1, of)
        own = np.arange(len(self.row))
        return np.where(below[above] == own, above, own), np.where(above[below] == own, below, own)

    def _best(self, way: int, of: Bool[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
        """Return the run of the next row that overlaps each most, itself where none does."""
        counts = np.bincount(self.row, minlength=len(self.number) + 2)
        firsts = np.concatenate([[0], np.cumsum(counts)])
        best = np.arange(len(self.row))
        most = np.zeros(len(self.row))
        there = np.clip(self.row + way, 0, len(self.number) - 1)
        for place in range(int(counts.max())):
            other = np.minimum(firsts[there] + place, len(self.row) - 1)
            overlap = np.minimum(self.end, self.end[other]) - np.maximum(
                self.start, self.start[other]
            )
            better = (self.row[other] == self.row + way) & (overlap > most) & of & of[other]
            best, most = np.where(better, other, best), np.where(better, overlap, most)
        return best


@dataclass(frozen=True, eq=False)
class Outline:
    """A drawing and the runs of its body.

    Attributes:
        drawing: whose it is.
        mask: of the body.
        runs: of the mask.
    """

    drawing: Drawing
    mask: Mask
    runs: Runs

    @classmethod
    def of(cls, drawing: Drawing, mask: Mask) -> Outline:
        """Return a mask's outline."""
        return cls(drawing, mask, runs_of(mask))

    @cached_property
    def distance(self) -> Picture:
        """Return the signed distance to the mask's border, px, negative inside."""
        return signed_distance(self.mask.astype(np.float32))


def runs_of(mask: Mask) -> Runs:
    """Return the runs of a mask that is not empty."""
    height, width = mask.shape
    steps = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, start = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    counts = np.bincount(row, minlength=height)
    firsts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    # from half way between two runs on, the second is nearer
    turns = np.zeros((height, width + 1), np.int32)
    same = np.flatnonzero(row[1:] == row[:-1])
    np.add.at(turns, (row[same], -((end[same] + start[same + 1]) // -2)), 1)
    number = firsts[:, None] + np.cumsum(turns, axis=1)[:, :width]
    rows = np.flatnonzero(counts)
    nearest = rows[np.abs(rows[None] - np.arange(height)[:, None]).argmin(axis=1)]
    return Runs(row, start, end, number[nearest].astype(np.int32))


def parted(mask: Mask) -> Mask:
    """Return a mask with limbs parted from the body where they touch between two gaps.

    Above and below there is background between both, so that the border goes on between them. Two
    holes in a body, one above the other, part it, too.
    """
    right = np.maximum.accumulate(mask, axis=1)
    left = np.maximum.accumulate(mask[:, ::-1], axis=1)[:, ::-1]
    gaps = (~mask & right & left).astype(np.uint8)
    near, beside = (cv2.dilate(gaps, np.ones((1, 2 * px + 1))) for px in (SLANT_PX, 2 * SLANT_PX))
    between = cv2.morphologyEx(near, cv2.MORPH_CLOSE, np.ones((TOUCHING_PX + 1, 1)))
    touching = (between > 0) & mask & (beside == 0)
    if not touching.any():
        return mask
    strips = runs_of(touching)
    found = mask.copy()
    found[strips.row, strips.middle.astype(int)] = False
    return found


def smoothed(
    values: Float[np.ndarray, "n ..."], links: tuple[np.ndarray, np.ndarray], rows: float
) -> Float[np.ndarray, "n ..."]:
    """Return values blurred along linked runs by a Gaussian of so many rows."""
    above, below = links
    for _ in range(round(2 * rows**2)):  # each step has a variance of half a row squared
        values = (values[above] + 2 * values + values[below]) / 4
    return values


def median_along(
    values: Float[np.ndarray, " n"], links: tuple[np.ndarray, np.ndarray], reach: int
) -> Float[np.ndarray, " n"]:
    """Return the median of the values of the linked runs within so many rows."""
    around = [np.arange(len(values))]
    for link in links:
        here = around[0]
        for _ in range(reach):
            here = link[here]
            around.append(here)
    return np.median(values[np.stack(around)], axis=0)
