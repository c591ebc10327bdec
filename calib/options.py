"""Define hints, options and verdict thresholds of calibration. Imports nothing heavy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from toonset.dataset.split_folder.options import CORRECTIONS, LABELS
from toonset.errors import UsageError
from toonset.options import Option, Symmetric, check_ranges, described

if TYPE_CHECKING:
    from toonset.view import View

Progress = Callable[[str, float], None]  # step, share done


KNOWN_PANEL = "What you know"  # of the help
Lock = Literal["yaw", "elevation", "scale", "fov"]


@described
@dataclass(frozen=True)
class Hints:
    """Hints about the views; all are optional."""

    labels: Annotated[str, replace(LABELS, panel=KNOWN_PANEL)] = ""
    landmarks: Annotated[
        str | Path | None,
        Option(
            "Which pixels show which points of the mannequin: JSON or CSV.",
            metavar="FILE",
            panel=KNOWN_PANEL,
        ),
    ] = None
    landmarks_only: Annotated[
        bool,
        Option(
            "Cameras from --landmarks alone: the outline is not the mannequin's.", panel=KNOWN_PANEL
        ),
    ] = False
    init: Annotated[
        str | Path | None,
        Option(
            "A bundle or transforms.json of these views: start from its cameras.",
            metavar="PATH",
            panel=KNOWN_PANEL,
        ),
    ] = None
    lock: Annotated[
        tuple[Lock, ...],
        Option(
            "Keep yaw, elevation, scale or fov as --init has it (or yaw as --views has it); "
            "repeatable.",
            metavar="WHAT",
            panel=KNOWN_PANEL,
        ),
    ] = ()
    corrections: Annotated[str | Path | None, CORRECTIONS] = None
    symmetric: Annotated[
        Symmetric,
        Option(
            "Left and right are mirror images: on, off, or auto (unless a drawing shows "
            "otherwise). `toonset train` mirrors what nobody drew.",
            panel=KNOWN_PANEL,
        ),
    ] = "auto"

    def check(self) -> None:
        """Refuse what contradicts itself, before any file is read.

        Raises:
            UsageError: `symmetric` or a lock that does not exist, `landmarks_only` without
                landmarks or beside what it does not use.
        """
        check_ranges(self)
        if not self.landmarks_only:
            return
        if self.landmarks is None:
            raise UsageError("--landmarks-only needs --landmarks FILE")
        for name, value in {
            "--views": self.labels,
            "--init": self.init,
            "--lock": self.lock,
            "--corrections": self.corrections,
        }.items():
            if value:
                raise UsageError(f"{name} does nothing beside --landmarks-only; drop one")

    def label_text(self, views: Sequence[View]) -> str:
        """Return each view's label, its own where the hints have none."""
        if self.labels or not any(view.label for view in views):
            return self.labels
        return ",".join(view.label or "?" for view in views)

    def captions_of(self, views: Sequence[View]) -> str:
        """Return what the sheet says of the views, "" where a person has said anything."""
        said = self.label_text(views) or self.landmarks or self.init or self.lock
        if said or self.corrections or not any(view.caption for view in views):
            return ""
        return ",".join(view.caption or "?" for view in views)

    def as_options(self, views: Sequence[View]) -> dict[str, Any]:
        """Return what calibration.json keeps besides the files."""
        return {
            "views": self.label_text(views) or None,
            "landmarks_only": self.landmarks_only,
            "locked": list(self.lock),
            "symmetric": self.symmetric,
        }


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


@described
@dataclass(frozen=True)
class CalibrationOptions:
    """How hard to look, and what to doubt."""

    starts: Annotated[
        int,
        Option("Coarse hypotheses per view; 6 reach the optimum of clean views always.", flag=None),
    ] = 6
    coarse_height_px: Annotated[
        float, Option("Figure height while searching; 100 px see limbs, cost little.", flag=None)
    ] = 100.0
    fine_height_px: Annotated[float, Option("Figure height of the final fit.", flag=None)] = 250.0
    rounds: Annotated[
        int, Option("Joint fits at most, when views change their candidate.", flag=None)
    ] = 3
    thresholds: Annotated[VerdictThresholds, Option("Of verdicts.", flag=None)] = (
        VerdictThresholds()
    )
    without: Annotated[
        tuple[str, ...],
        Option(
            "Names of checks that are left out, of `toonset.calib.verdict.checks.CHECKS`.",
            flag=None,
        ),
    ] = ()
