"""Define the result of calibration: cameras, uncertainties, alternatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.drawing_error import Noise
from toonset.calib.fit.landmarks import LandmarkFit
from toonset.calib.fit.model_selection import ModelChoice
from toonset.camera import Camera
from toonset.dataset.bundle.calibration_schema import FilledHole, Side, Verdict
from toonset.mesh import Mesh
from toonset.view import View

SIDES: tuple[Side, ...] = ("left", "top", "right", "bottom")  # as in a view's ends
SEVERITY: tuple[Verdict, ...] = ("ok", "weak", "ambiguous", "failed")


@dataclass(frozen=True, eq=False)
class Sigmas:
    """One standard deviation of each number of a camera; angles in radians, shift in pixels."""

    yaw: float
    elevation: float
    roll: float
    scale_relative: float
    shift_px: float


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another camera that explains the drawing, with its probability."""

    camera: Camera
    probability: float


@dataclass(frozen=True, eq=False)
class ViewCalibration:
    """One drawing's camera.

    Attributes:
        name: the view's file name.
        camera: in pixels of the view's crop.
        sigmas: 1-sigma, the drawing's smooth error integrated out.
        covariance: (6, 6) of (rotation increment in camera axes, shift px, log scale).
        p_flip: probability that the mirror twin is right instead.
        twin: the mirror twin's camera, refined to this drawing where it is an optimum of its own.
        alternatives: other refined cameras, most probable first.
        outline_error: robust outline distance over the figure's height.
        coverage: share of both outlines that lie within 5 % of the height of each other.
        verdict: ok, weak, ambiguous or failed.
        reason: why, in words; empty when ok.
    """

    name: str
    camera: Camera
    sigmas: Sigmas
    covariance: Float[np.ndarray, "6 6"]
    p_flip: float
    twin: Camera
    alternatives: tuple[Alternative, ...]
    outline_error: float
    coverage: float
    verdict: Verdict
    reason: str


@dataclass(frozen=True)
class FlatSide:
    """A side on which a figure ends in a ruled line.

    Attributes:
        side: of the figure.
        at: between which pixels: the row or column from 0 that begins there.
        spans: (first, last + 1) columns or rows where the figure ends there.
        at_edge: the line is the picture's edge.
    """

    side: Side
    at: int
    spans: tuple[tuple[int, int], ...]
    at_edge: bool

    @property
    def axis(self) -> int:
        """Return which pixel coordinate `at` is one of: u (0) or v (1)."""
        return SIDES.index(self.side) % 2

    def is_end_of(self, view: View) -> bool:
        """Return whether the view is known to end there."""
        return bool(view.ends[SIDES.index(self.side)] == self.at)


@dataclass(frozen=True)
class CutOff:
    """A part of a figure that its picture lacks.

    Attributes:
        view: the drawing.
        flat: where it ends.
        lost_px: how far the mannequin goes on beyond.
    """

    view: str
    flat: FlatSide
    lost_px: float

    def __str__(self) -> str:
        """Return what was found, for people."""
        lost = f"about {self.lost_px:.0f} px are missing"
        ends = "" if self.flat.at_edge else "; the picture ends there now"
        return f"{self.view}: the figure is cut off at the {self.flat.side}, {lost}{ends}"


@dataclass(frozen=True, eq=False)
class Calibration:
    """The cameras of a sheet.

    Attributes:
        views: in sheet order.
        model: orthographic or perspective, with the evidence.
        outline_offset: drawn outline outside of the mannequin's, over the figure's height.
        noise: the drawings' error over the figure's height.
        contradiction: of the drawings with each other, over the height; nan for a single one.
        mannequin: (vertices, 3) of the mannequin with the proportions that were fitted.
        verdict: the worst that holds for the sheet as a whole.
        reason: why, in words.
        seconds: per step.
        cuts: parts of figures that their pictures lack.
        filled_holes: holes of the drawings that turned out to be paint.
        landmarks: what the landmarks of each view say, where there are any.
        drawings: the drawings that the cameras belong to: cropped at cuts, holes filled.
        mesh: the mannequin as it was given; `mannequin` has its vertices as they were fitted. None:
            the cameras were found without a body.
        origin: the options that were set, versions and input files, as calibration.json has them.
    """

    views: tuple[ViewCalibration, ...]
    model: ModelChoice
    outline_offset: float
    noise: Noise
    contradiction: float
    mannequin: Float[np.ndarray, "vertices 3"]
    verdict: Verdict
    reason: str
    seconds: dict[str, float]
    cuts: tuple[CutOff, ...] = ()
    filled_holes: tuple[FilledHole, ...] = ()
    landmarks: tuple[LandmarkFit, ...] = ()
    drawings: tuple[View, ...] = ()
    mesh: Mesh | None = None
    origin: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_certain(self) -> bool:
        """Return whether every view and the sheet as a whole are ok."""
        return all(verdict == "ok" for verdict in (self.verdict, *(v.verdict for v in self.views)))

    @property
    def doubtfulness(self) -> tuple[int, int]:
        """Return how severe the verdicts of the sheet and of its views are; to compare."""
        return SEVERITY.index(self.verdict), sum(SEVERITY.index(v.verdict) for v in self.views)
