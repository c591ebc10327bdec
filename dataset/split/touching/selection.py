"""Select the right cut through a patch, with its probability, by logistic regression.

Evidence is added up as logarithms: what the cut crosses, whether it runs from cleft to cleft, and
how alike both sides of it are to sides of the sheet's other figures. The weights are those of a
conditional logistic regression on synthetic sheets of touching and overlapping figures; so the
shares of the exponentials are the chances that a cut is the right one.
Source: D. McFadden, "Conditional logit analysis of qualitative choice behavior" (1974).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.dataset.split.figures.blobs import shared_colors
from toonset.dataset.split.touching.costs import CutCosts
from toonset.dataset.split.touching.profiles import largest_piece, right_flank, unlikeness
from toonset.dataset.split.touching.seams import Seam, distinct_ways

DEAREST = 0.3  # of the height in paint: a way that costs more is not looked at
MOST_CROSSED = 0.4  # of the height in paint, lines or not: figures touch, they do not merge
AS_HIGH = 0.7  # of the patch's height: what is left on each side of a cut
AS_LARGE = 0.3  # of the patch's area: the same, for two figures of equal size less
HEAD = 0.12  # of the patch's height: a head is as thick, an arm is not
MOST_STUDY = 0.6  # of the figure's area: a study beside it has no more
HALF_AS_WIDE = 0.5  # times its own height: a figure is rarely wider
TWO_WIDE = 0.7  # times its own height: what is narrower is rarely two figures
ALIKE = 0.3  # of two figures' colours that they share; a wing and its body share less
SAME = 0.0015  # of the paint: two cuts that differ by less are one
ELSEWHERE = 0.15  # of the paint: two cuts that differ by more are between other figures
AS_GOOD = 0.015  # of the height: two cuts whose figures end so near each other are equally right

WEIGHTS = np.array([1.6, 1.2, 2.3, 2.7, 2.7])  # of the logarithms of `Option.evidence`
LEAST = np.array([0.01, 0.01, 0.3, 0.001, 0.001])  # what cannot be told from nothing in it


@dataclass(frozen=True, eq=False)
class Option:
    """A cut that leaves something like a figure on each side.

    Attributes:
        seam: where it runs.
        is_right: which cells lie right of it.
        evidence: paint crossed beside lines and beside edges in heights, places where it begins or
            ends on a straight side, unlikeness of its left and its right side: all 0 at best.
        crossed: paint that it goes through, in heights.
        ends: in heights, where the left figure ends and where the right one begins.
        study: "left" or "right" where that piece is a smaller drawing, "" where both are figures.
    """

    seam: Seam
    is_right: Bool[np.ndarray, "height width"]
    evidence: tuple[float, float, float, float, float]
    crossed: float
    ends: tuple[float, float]
    study: str = ""

    @property
    def badness(self) -> float:
        """Return how improbable it is, as minus a logarithm; 0 at best."""
        return float(WEIGHTS @ np.log1p(np.array(self.evidence) / LEAST))


def find_options(
    cut_costs: CutCosts,
    colors: UInt8[np.ndarray, "height width 3"],
    others: Sequence[Float[np.ndarray, " rows"]],
) -> list[Option]:
    """Return the cuts that come into question.

    Args:
        cut_costs: the patch.
        colors: of its cells.
        others: sides of the sheet's figures that are known, those of this patch included.
    """
    found: list[Option] = []
    height, width = cut_costs.drawn.shape
    for ways in distinct_ways(cut_costs.prices(), cut_costs.drawn, DEAREST * height):
        for seam in ways:
            option = _option(cut_costs, colors, others, seam)
            if option is not None and not any(_are_same(option, o, cut_costs) for o in found):
                found.append(option)
        if not found and width < TWO_WIDE * height:  # one look is enough at a single figure
            break
    return found


def _option(
    cut_costs: CutCosts, colors: np.ndarray, others: Sequence[np.ndarray], seam: Seam
) -> Option | None:
    """Return a way as a cut, None if it does not leave two figures."""
    height, width = cut_costs.drawn.shape
    crossed = float(seam.along(cut_costs.drawn).sum()) / height
    if crossed > MOST_CROSSED:
        return None
    inside, right = cut_costs.drawn > 0.5, seam.is_right(width)
    if not (inside & right).any() or not (inside & ~right).any():
        return None
    one, two = largest_piece(inside & ~right), largest_piece(inside & right)
    figures = _are_figures(inside, one, two)
    study = "" if figures else _study(one, two)
    if not (figures or study) or shared_colors(colors[one], colors[two]) < ALIKE:
        return None
    sides = right_flank(one), right_flank(two[:, ::-1])
    if study:
        lone = unlikeness(sides[study == "left"], others)
        unlike = lone, lone
    else:
        unlike = (
            unlikeness(sides[0], [*others, sides[1]]),
            unlikeness(sides[1], [*others, sides[0]]),
        )
    ends = np.flatnonzero(one.any(axis=0))[-1], np.flatnonzero(two.any(axis=0))[0]
    evidence = (*_crossing(cut_costs, seam), *unlike)
    return Option(seam, right, evidence, crossed, (ends[0] / height, ends[1] / height), study)


def _study(one: np.ndarray, two: np.ndarray) -> str:
    """Return which piece is a head or a bust beside a figure, "left", "right" or "" for none."""
    height = len(one)
    for side, piece, other in (("left", one, two), ("right", two, one)):
        rows = np.flatnonzero(other.any(axis=1))
        depth = cv2.distanceTransform(np.pad(piece, 1).view(np.uint8), cv2.DIST_L2, 3).max()
        if rows[-1] + 1 - rows[0] >= AS_HIGH * height and 2 * depth >= HEAD * height:
            if piece.sum() <= MOST_STUDY * other.sum():
                return side
    return ""


def _are_same(a: Option, b: Option, cut_costs: CutCosts) -> bool:
    inside = cut_costs.drawn > 0.5
    return bool((a.is_right != b.is_right)[inside].sum() < SAME * inside.sum())


def best_option(options: Sequence[Option], inside: Bool[np.ndarray, "h w"]) -> tuple[Option, float]:
    """Return the most probable cut and its chance to be right among those between two figures."""
    best = min(options, key=lambda option: option.badness)
    limit = ELSEWHERE * inside.sum()
    alternatives = [o for o in options if (o.is_right != best.is_right)[inside].sum() <= limit]
    chances = np.array([np.exp(best.badness - option.badness) for option in alternatives])
    ends = np.array([option.ends for option in alternatives])
    alike = (np.abs(ends - best.ends) <= AS_GOOD).all(axis=1)
    return best, float(chances[alike].sum() / chances.sum())


def _crossing(cut_costs: CutCosts, seam: Seam) -> tuple[float, float, float]:
    height = len(cut_costs.drawn)
    by_lines, by_edges = cut_costs.by_lines(), cut_costs.by_edges()
    met = seam.along(cut_costs.drawn) > 0.5
    ends = np.diff(np.concatenate([[0], met.astype(np.int8), [0]]))
    first, last = np.flatnonzero(ends == 1), np.flatnonzero(ends == -1) - 1
    opened = seam.along(cut_costs.open)
    return (
        float(seam.along(by_lines + cut_costs.gaps()).sum()) / height,
        float(seam.along(by_edges).sum()) / height,
        float(opened[first].sum() + opened[last].sum()),
    )


def _are_figures(inside: np.ndarray, *pieces: np.ndarray) -> bool:
    """Return whether pieces are as high and as large as figures."""
    height, width = inside.shape
    across = max(2.0, width / (HALF_AS_WIDE * height))
    least = AS_LARGE * float(inside.sum()) * 2 / across
    for piece in pieces:
        rows = np.flatnonzero(piece.any(axis=1))
        if rows[-1] + 1 - rows[0] < AS_HIGH * height or piece.sum() < least:
            return False
    return True
