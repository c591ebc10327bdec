"""Define the options of calibration. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[[str, float], None]  # step, share done


@dataclass(frozen=True)
class CalibrationOptions:
    """Options of calibration.

    Attributes:
        starts: coarse hypotheses per view; 6 reach the optimum of clean views always.
        coarse_height_px: figure height while searching; 100 px see limbs, cost little.
        fine_height_px: figure height of the final fit.
        rounds: joint fits at most, when views change their candidate.
    """

    starts: int = 6
    coarse_height_px: float = 100.0
    fine_height_px: float = 250.0
    rounds: int = 3
