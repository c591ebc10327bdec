"""How fine the planes are: two thirds of a cell per pixel, or half of that where it does as well.

Finer planes fit each drawing's own pixels; coarser ones hold what drawings share. Where several
drawings agree, nothing coarser than two thirds does as well. Where they are few or disagree, short
trainings on some of them predict the others, and the coarser planes count if they do not predict
worse, within a tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

USUAL, COARSE = 2 / 3, 1 / 3  # cells per pixel
MANY_VIEWS = 6  # that agree: nothing coarser is tried
FEWEST_VIEWS = 3  # with fewer nothing can be left out
TOLERANCE_DB = 0.1


@dataclass(frozen=True)
class Candidate:
    """A field that was tried.

    Attributes:
        cells: along the longest side of the planes.
        parameters: of planes and decoder.
        left_out_psnr: over white, of the rays through the figures of the left-out drawings, dB.
    """

    cells: int
    parameters: int
    left_out_psnr: float


@dataclass(frozen=True)
class FieldChoice:
    """Which planes were chosen, and on what evidence.

    Attributes:
        cells: along the longest side.
        untried: why nothing was tried; empty where something was.
        candidates: from fine to coarse.
        left_out: names of the drawings that were predicted.
        tolerance_db: by how much the chosen one may be worse than the best.
    """

    cells: int
    untried: str = ""
    candidates: tuple[Candidate, ...] = ()
    left_out: tuple[str, ...] = ()
    tolerance_db: float = TOLERANCE_DB

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        return asdict(self)


def why_untried(views: int, *, agree: bool, short: bool) -> str:
    """Return why trials would tell nothing of so many drawings, or not be worth it; else nothing.

    Args:
        views: that show a figure.
        agree: their outlines do, to the pixel.
        short: the training takes hardly longer than trials would.
    """
    if agree and views >= MANY_VIEWS:
        return f"{views} drawings agree"
    if views < FEWEST_VIEWS:
        return "too few drawings to leave one out"
    return "too short a training for trials" if short else ""


def chosen(candidates: Sequence[Candidate]) -> int:
    """Return the cells of the coarsest candidate that is about as good as the best."""
    least = max(candidate.left_out_psnr for candidate in candidates) - TOLERANCE_DB
    return min(c.cells for c in candidates if c.left_out_psnr >= least)
