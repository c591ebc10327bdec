"""Solve a sheet's cameras from landmarks: points of the mannequin and their pixels, per view.

1. OpenCV's PnP starts every view (`landmark_starts`), all starts are refined as one batch
2. views are refined again as one sheet's: of its scale and elevation, upright
3. all views are adjusted together (`landmark_adjustment`), orthographic unless the pairs of all
   views prove one camera distance
4. what else every view could be under what the sheet says: pairs nearly in a plane have two
   cameras, few pairs of which one is wrong have several

Landmarks determine cameras alone, or start the fit of outlines and take part in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.landmark_starts import Points, on_a_line
from toonset.calib.fit.model_selection import BIC_MARGIN
from toonset.calib.options import VerdictThresholds
from toonset.calib.outline.occluding_contour import Surface
from toonset.calib.outline.pose import PARAMETERS, Pose
from toonset.camera import angles_from_rotation
from toonset.dataset.mannequin.landmark_file import LEAST_POINTS, Landmarks
from toonset.errors import LandmarkError

if TYPE_CHECKING:
    from toonset.calib.fit.landmark_search import FoundCameras

LEAST_PROBABILITY = 0.01  # of a camera that is worth returning
REACH = 3.0  # times the mannequin's radius: farther points have other units
LEAST_SPREAD_PX = 1.0  # of the pixels


@dataclass(frozen=True, eq=False)
class LandmarkFit:
    """The camera that a view's landmarks determine, alone or as a start for its outline.

    Attributes:
        view: file name of the view.
        poses: relative to the surface's middle, pixels of the crop; the most probable first. Others
            are, say, the depth reversal of pairs nearly in a plane.
        probabilities: of each pose, given the landmarks alone.
        pairs: how many there are.
        rms_px: root mean square of the pairs' pixel distances (both axes), misplaced ones aside.
        sigma_px: estimated error of one pixel coordinate.
        covariance: (6, 6) of the first pose's (w, shift, log scale); free k is integrated out.
        misplaced: names of pairs that do not fit the others.
        bic_gain: of perspective over orthography, for the sheet; above `BIC_MARGIN` all poses have
            one k, else k = 0.
    """

    view: str
    poses: tuple[Pose, ...]
    probabilities: tuple[float, ...]
    pairs: int
    rms_px: float
    sigma_px: float
    covariance: Float[np.ndarray, "6 6"]
    misplaced: tuple[str, ...]
    bic_gain: float

    @property
    def model(self) -> str:
        """Return "orthographic" or "perspective"."""
        return "perspective" if self.bic_gain > BIC_MARGIN else "orthographic"

    def doubt(
        self, height_px: float, limits: VerdictThresholds
    ) -> tuple[Literal["failed", "ambiguous"], str] | None:
        """Return why the landmarks do not tell one camera: a verdict and its reason.

        Args:
            height_px: of the figure.
            limits: where to begin to doubt.
        """
        if len(self.misplaced) > limits.most_landmarks_misplaced * self.pairs:
            named = ", ".join(self.misplaced)
            return "failed", f"too many landmarks do not fit the others: {named}; another body's?"
        if self.rms_px > limits.most_landmarks_off * height_px:
            off = f"{100 * self.rms_px / height_px:.0f} % of the height"
            return "failed", f"the landmarks are {off} off: other points, or another body's"
        if sum(self.probabilities[1:]) > 1 - limits.sure:
            yaw, p = angles_from_rotation(self.poses[1].rotation)[0], self.probabilities[1]
            also = f"yaw {np.degrees(yaw) % 360:.0f} fits as well (p = {p:.2f})"
            return "ambiguous", f"{also}: add a point off their plane"
        return None


def landmark_starts(
    landmarks: Sequence[Landmarks | None], surface: Surface
) -> tuple[LandmarkFit | None, ...]:
    """Return the cameras of all views with landmarks enough, solved together; None for the others.

    Raises:
        LandmarkError: a view's pairs lie on a line or in one place, or far from the mannequin.
    """
    enough = [own for own in landmarks if own is not None and len(own.names) >= LEAST_POINTS]
    found = {fit.view: fit for fit in solve_landmarks(enough, surface)} if enough else {}
    return tuple(found.get(own.view) if own else None for own in landmarks)


def solve_landmarks(landmarks: Sequence[Landmarks], surface: Surface) -> tuple[LandmarkFit, ...]:
    """Return the cameras of a sheet's views from their landmarks alone.

    Args:
        landmarks: of every view, at least three pairs.
        surface: the mannequin.

    Raises:
        LandmarkError: a view's pairs lie on a line or in one place, or far from the mannequin.
    """
    from toonset.calib.fit.landmark_search import search_cameras  # torch: a second of importing

    views = [(own.world - surface.middle, own.pixels) for own in landmarks]
    for own, (points, _) in zip(landmarks, views, strict=True):
        _check_spread(own, points, surface.radius)
    found = search_cameras(views, surface.height)
    return tuple(_fit_of(i, own, found, surface.height) for i, own in enumerate(landmarks))


def _fit_of(index: int, landmarks: Landmarks, found: FoundCameras, height: float) -> LandmarkFit:
    joint, others = found.joint, found.others[index]
    pose, squared = joint.poses[index], joint.squared[index, : len(landmarks.names)]
    sigma_px = joint.shared.honest_sigma * height * pose.scale
    misplaced = joint.misplaced[index, : len(squared)]
    weights = np.array([1.0, *(float(np.exp(-0.5 * more)) for more, _ in others)])
    probable = weights / weights.sum()
    kept = [0, *(i for i in range(1, len(probable)) if probable[i] >= LEAST_PROBABILITY)]
    own = slice(PARAMETERS * index, PARAMETERS * (index + 1))
    turns = np.diag([1.0, 1, 1, 0, 0, 0]) / np.pi**2  # no angle is less certain than a turn
    return LandmarkFit(
        landmarks.view,
        tuple([pose, *(other for _, other in others)][i] for i in kept),
        tuple(float(probable[i]) for i in kept),
        len(squared),
        float(sigma_px * np.sqrt((squared if misplaced.all() else squared[~misplaced]).mean())),
        sigma_px,
        np.linalg.inv(np.linalg.inv(joint.covariance[own, own]) + turns),
        tuple(name for name, off in zip(landmarks.names, misplaced, strict=True) if off),
        found.bic_gain,
    )


def _check_spread(landmarks: Landmarks, points: Points, radius: float) -> None:
    where = f"landmarks of view {landmarks.view}"
    reach = np.linalg.norm(points, axis=1)
    far = int(reach.argmax())
    if reach[far] > REACH * radius:
        raise LandmarkError(
            f"{where}: {landmarks.names[far]!r} is {reach[far] / radius:.3g} times as far from the "
            f"mannequin's middle as its surface, {REACH:g} at most is meant; check its units"
        )
    if on_a_line(points):
        raise LandmarkError(
            f"{where}: all {len(points)} lie on one line of the mannequin, which leaves the turn "
            "about it open; add a point beside it"
        )
    if np.ptp(landmarks.pixels, axis=0).max() < LEAST_SPREAD_PX:
        raise LandmarkError(
            f"{where}: all {len(points)} pixels are within {LEAST_SPREAD_PX:g} px; give each point "
            "its own"
        )
