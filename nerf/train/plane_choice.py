"""Choose the planes' resolution by how well it predicts left-out drawings.

Finer planes fit each drawing's own pixels, and thin limbs; coarser ones hold what drawings share.
Short trainings on some drawings predict the others with finer and with coarser planes; the coarser
count if they predict as well, within a tolerance. It is between one and two thirds of a cell per
pixel; where drawings agree but are few, between two thirds and a third. (Where they disagree, that
predicts as well, but eyes and mouths are lost.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

FINE, USUAL, COARSE = 1.0, 2 / 3, 1 / 3  # cells per pixel
MANY_VIEWS = 6  # from which on a third was never as good
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
    """Chosen resolution of the planes, and its evidence.

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


def shares_for(views: int, *, agree: bool) -> tuple[float, float]:
    """Return the cells per pixel that are tried, finer ones first.

    Args:
        views: that show a figure.
        agree: their outlines do (see `Prepared.agree`).
    """
    return (USUAL, COARSE) if agree and views < MANY_VIEWS else (FINE, USUAL)


def chosen(candidates: Sequence[Candidate]) -> int:
    """Return the cells of the coarsest candidate that is about as good as the best."""
    least = max(candidate.left_out_psnr for candidate in candidates) - TOLERANCE_DB
    return min(c.cells for c in candidates if c.left_out_psnr >= least)
