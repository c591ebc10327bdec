"""Tell which parts that lie apart from their bodies may be another view's, missing, or no parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.split.figures.blobs import Blobs, shared_colors
from toonset.dataset.split.figures.grouping import LEAST_PART, NEAR, Grouping

ALIKE = 0.6  # of the colours that like things share among each other: less is another thing
NEARER = 1.2  # times the gap between parts and their bodies: so near a part may be another's
LIKE_SIZED = 1.5  # times the height: a pair of parts
LEVEL = 0.7  # of their height: they lie beside each other


@dataclass(frozen=True, eq=False)
class _Parts:
    """Patches that are parts apart.

    Attributes:
        blobs: all patches.
        figure_of: view of every part, by its number.
        bodies: number of every view's largest patch.
    """

    blobs: Blobs
    figure_of: dict[int, int]
    bodies: list[int]

    @classmethod
    def of(cls, blobs: Blobs, grouping: Grouping) -> _Parts:
        """Return the parts that are no specks."""
        figure_of, bodies = dict[int, int](), list[int]()
        for figure in range(grouping.count):
            own = np.flatnonzero(grouping.figure_of_blob == figure)
            bodies.append(int(own[blobs.areas[own].argmax()]))
            least = LEAST_PART * blobs.areas[bodies[-1]]
            large = own[blobs.areas[own] >= least].tolist()
            figure_of |= {number: figure for number in large if number != bodies[-1]}
        return cls(blobs, figure_of, bodies)

    def like(self, number: int) -> list[int]:
        """Return the other parts that are about as high as a patch, and level with it."""
        numbers = np.array(list(self.figure_of), dtype=int)
        (y, height), (tops, heights) = (
            self.blobs.boxes[n][..., [1, 3]].T for n in (number, numbers)
        )
        shared = np.minimum(y + height, tops + heights) - np.maximum(y, tops)
        lower, higher = np.minimum(height, heights), np.maximum(height, heights)
        alike = (shared >= LEVEL * lower) & (higher <= LIKE_SIZED * lower) & (numbers != number)
        found: list[int] = numbers[alike].tolist()
        return found

    def middle(self, number: int) -> float:
        """Return the column of a patch's middle."""
        return float(self.blobs.boxes[number, 0] + self.blobs.boxes[number, 2] / 2)

    def nearest(self, number: int) -> int:
        """Return the view whose body's middle is nearest to a patch's."""
        away = self.blobs.centers[self.bodies] - self.blobs.centers[number]
        return int((away**2).sum(axis=1).argmin())

    def gap(self, part: int, figure: int) -> float:
        """Return how far a part is beside a body, in its heights; infinite at no level of it."""
        x, y, width, height = self.blobs.boxes[part]
        left, top, _, tall = self.blobs.boxes[self.bodies[figure]]
        rows = slice(max(0, y - top), max(0, y + height - top))
        columns = np.flatnonzero(self.blobs.mask(self.bodies[figure])[rows].any(axis=0))
        if not len(columns):
            return np.inf
        return float(max(left + columns[0] - x - width, x - left - columns[-1] - 1, 0) / tall)


def parts_in_doubt(
    blobs: Blobs,
    grouping: Grouping,
    rgb: UInt8[np.ndarray, "height width 3"],
    cell_px: int,
    names: Sequence[str],
) -> list[str]:
    """Return a line for every part that may be in the wrong view, no part at all, or missing.

    Args:
        blobs: the patches.
        grouping: the views they belong to.
        rgb: the sheet in the patches' cells.
        cell_px: side of a cell in the sheet.
        names: of the views.
    """
    parts = _Parts.of(blobs, grouping)

    def place(number: int) -> str:
        x, y = (int(value) * cell_px for value in blobs.boxes[number, :2])
        return f"{x}, {y}"

    return [
        *(
            f"a part at {place(number)} went to view {names[parts.figure_of[number]]}: "
            f"does it belong to {names[other]}, which is as near?"
            for number, other in _near_another(parts)
        ),
        *(
            f"a thing at {place(number)} apart from view {names[parts.figure_of[number]]} was "
            "taken for its part: is it one?"
            for number in _without_like(parts)
        ),
        *(
            f"a thing at {place(number)} was left out, but is like parts of the views: is it one "
            f"of {names[parts.nearest(number)]}?"
            for number in _like_but_left_out(parts, grouping, rgb)
        ),
        *(
            f"view {names[parts.figure_of[number]]} has one part at {place(number)}: does its "
            f"like lie over view {names[other]}?"
            for number, other in _mirrored_in_another(parts, grouping)
        ),
    ]


def _near_another(parts: _Parts) -> list[tuple[int, int]]:
    """Return the parts that lie as near to another view as parts do, with that view.

    Not where it is one of a pair, or where the other view has its own between that and its body.
    """
    gaps = {number: parts.gap(number, figure) for number, figure in parts.figure_of.items()}
    reach = NEARER * max((gap for gap in gaps.values() if np.isfinite(gap)), default=0.0)
    found = []
    for number, gap in gaps.items():
        alike, figure = parts.like(number), parts.figure_of[number]
        for other in range(len(parts.bodies)):
            away = parts.gap(number, other)
            if other == figure or not np.isfinite(gap) or away > reach:
                continue
            own = [one for one in alike if parts.figure_of[one] == figure]
            theirs = [one for one in alike if parts.figure_of[one] == other]
            paired = gap <= away and _is_paired(parts, number, own)
            if not paired and not _is_one_between(parts, number, theirs, parts.bodies[other]):
                found.append((number, other))
    return found


def _without_like(parts: _Parts) -> list[int]:
    """Return the parts far beside their bodies that have no like: they may be props."""
    far = [n for n, figure in parts.figure_of.items() if NEAR < parts.gap(n, figure) < np.inf]
    return [number for number in far if not parts.like(number)]


def _like_but_left_out(parts: _Parts, grouping: Grouping, rgb: np.ndarray) -> list[int]:
    """Return the patches of no view that lie level with parts, as high and in their colours."""

    def share(one: int, other: int) -> float:
        looks = [rgb[parts.blobs.window(n)][parts.blobs.mask(n)] for n in (one, other)]
        return shared_colors(*looks)

    left_out = np.flatnonzero(grouping.figure_of_blob < 0).tolist()
    return [n for n in left_out if any(share(n, other) >= ALIKE for other in parts.like(n))]


def _mirrored_in_another(parts: _Parts, grouping: Grouping) -> list[tuple[int, int]]:
    """Return the parts without a like in their view whose mirrored place is in another one's."""
    found = []
    for number, figure in parts.figure_of.items():
        if any(parts.figure_of[other] == figure for other in parts.like(number)):
            continue
        x, y, width, height = parts.blobs.boxes[number].tolist()
        left = round(2 * parts.middle(parts.bodies[figure])) - x - width
        there = parts.blobs.labels[y : y + height, max(left, 0) : max(left + width, 0)]
        others = np.unique(grouping.figure_of_blob[there[there > 0] - 1])
        found += [(number, int(other)) for other in others if other not in (-1, figure)]
    return found


def _is_paired(parts: _Parts, part: int, alike: list[int]) -> bool:
    """Return whether a body has one part on each side, of which this is one."""
    middle = parts.middle(parts.bodies[parts.figure_of[part]])
    left = parts.middle(part) < middle
    beside = [(parts.middle(other) < middle) == left for other in alike]
    return len(beside) > 0 and not any(beside)


def _is_one_between(parts: _Parts, part: int, theirs: list[int], body: int) -> bool:
    """Return whether one of a view's own parts lies between another's part and its body."""
    ends = sorted((parts.middle(part), parts.middle(body)))
    return any(ends[0] < parts.middle(number) < ends[1] for number in theirs)
