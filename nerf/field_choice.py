"""How fine the planes need to be, by what short trainings predict of drawings they have not seen.

Finer planes hold more than a scene may need. The coarsest candidate counts that predicts as well as
the best one, within a tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

TOLERANCE_DB = 0.15  # less than two seeds differ by in one view


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
    """Which planes were chosen.

    Attributes:
        cells: along the longest side.
        candidates: from fine to coarse; empty where nothing could be left out.
        left_out: names of the drawings that were predicted.
        tolerance_db: by how much the chosen one may be worse than the best.
    """

    cells: int
    candidates: tuple[Candidate, ...]
    left_out: tuple[str, ...]
    tolerance_db: float = TOLERANCE_DB

    def to_json(self) -> dict[str, Any]:
        """Return the numbers for a report."""
        return asdict(self)


def chosen(candidates: Sequence[Candidate]) -> int:
    """Return the cells of the coarsest candidate that is about as good as the best."""
    least = max(candidate.left_out_psnr for candidate in candidates) - TOLERANCE_DB
    return min(c.cells for c in candidates if c.left_out_psnr >= least)
