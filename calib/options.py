"""Define the options and verdict thresholds of calibration. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[[str, float], None]  # step, share done


@dataclass(frozen=True)
class VerdictThresholds:
    """Where a verdict begins to doubt; evidence is in docs/decisions.md.

    Attributes:
        sure: probability of the chosen camera below which it is ambiguous.
        weak_coverage: share of both outlines that lie within 5 % of the height of each other.
        failed_coverage: the same, below which this is not the mannequin.
        weak_sigma_deg: of yaw or elevation; three of them reach another camera.
        most_faces_contradict: probability that faces are not where the cameras have the front.
        most_pull_deg: turn of a view, by its outline, once nothing is locked.
        far_from_place_deg: turn of a view off even steps, with another body's mannequin.
        far_from_label_deg: turn of a view off its label; three quarters is neither front nor side.
        far_from_level_deg: a view's elevation off the sheet's; four times what views differ.
        looking_up_deg: elevation below level; nobody draws a turnaround from so far below.
        most_contradiction: of drawings with each other, over the height.
        confirming_contradiction: below it drawings confirm cameras without the mannequin.
        steep_deg: elevation from which only the mannequin tells how far cameras look down.
        telling_views: views from which silhouettes contradict wrong cameras at all.
        weak_apart, failed_apart: outlines from being one turning body's, over the height; without
            a mannequin.
        weak_scale, failed_scale: times the other drawings' scale, without a mannequin: another
            size, or another body.
        most_landmarks_misplaced: of a view's; more do not tell which of them are.
        most_landmarks_off: of a view's landmarks, over the height; farther, they are another's.
    """

    sure: float = 0.95
    weak_coverage: float = 0.93
    failed_coverage: float = 0.70
    weak_sigma_deg: float = 5.0
    most_faces_contradict: float = 0.5
    most_pull_deg: float = 5.0
    far_from_place_deg: float = 12.0
    far_from_label_deg: float = 60.0
    far_from_level_deg: float = 12.0
    looking_up_deg: float = 5.0
    most_contradiction: float = 0.012
    confirming_contradiction: float = 0.008
    steep_deg: float = 30.0
    telling_views: int = 5
    weak_apart: float = 0.03
    failed_apart: float = 0.06
    weak_scale: float = 1.25
    failed_scale: float = 1.5
    most_landmarks_misplaced: float = 0.34
    most_landmarks_off: float = 0.05


@dataclass(frozen=True)
class CalibrationOptions:
    """How hard to look, and what to doubt.

    Attributes:
        starts: coarse hypotheses per view; 6 reach the optimum of clean views always.
        coarse_height_px: figure height while searching; 100 px see limbs, cost little.
        fine_height_px: figure height of the final fit.
        rounds: joint fits at most, when views change their candidate.
        thresholds: of verdicts.
        without: names of checks that are left out, of `toonset.calib.verdict.checks.CHECKS`.
    """

    starts: int = 6
    coarse_height_px: float = 100.0
    fine_height_px: float = 250.0
    rounds: int = 3
    thresholds: VerdictThresholds = VerdictThresholds()
    without: tuple[str, ...] = ()
