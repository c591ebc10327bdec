"""Solve cameras from landmarks: pairs of a point of the mannequin and its pixel, per view.

Landmarks determine a camera alone, or start the contour fit where the outline is ambiguous. Pairs
nearly in a plane have two cameras that fit alike; both are returned with their probabilities
(likelihoods with the noise integrated out).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.landmark_models import MARGIN, Explanation, choose
from toonset.calib.fit.landmark_pose import Points, on_a_line, squared_error
from toonset.calib.outline.occluding_contour import Surface
from toonset.calib.outline.pose import PARAMETERS, Pose, project_with_jacobian
from toonset.dataset.mannequin.landmark_file import LEAST_POINTS, Landmarks
from toonset.errors import LandmarkError

CLICK_OF_HEIGHT = 0.01  # error of a click or of the mannequin's proportions, before looking
CLICK_WEIGHT = 2.0  # of that knowledge, in coordinates
LEAST_PROBABILITY = 0.01  # of a camera that is worth returning
REACH = 3.0  # times the mannequin's radius: farther points have other units
LEAST_SPREAD_PX = 1.0  # of the pixels


@dataclass(frozen=True, eq=False)
class LandmarkFit:
    """The camera that a view's landmarks determine, alone or as a start for its outline.

    Attributes:
        view: file name of the view.
        poses: relative to the surface's middle, pixels of the crop; the most probable first. A
            second one is the depth reversal of pairs nearly in a plane.
        probabilities: of each pose, given the landmarks alone.
        rms_px: root mean square of the pairs' pixel distances (both axes), misplaced ones aside.
        sigma_px: estimated error of one pixel coordinate.
        covariance: (6, 6) of the first pose's (w, shift, log scale); free k is integrated out.
        misplaced: names of pairs that were given up.
        bic_gain: of perspective over orthography, 0 for three pairs; above `MARGIN` the poses have
            their own k, else k = 0.
    """

    view: str
    poses: tuple[Pose, ...]
    probabilities: tuple[float, ...]
    rms_px: float
    sigma_px: float
    covariance: Float[np.ndarray, "6 6"]
    misplaced: tuple[str, ...]
    bic_gain: float

    @property
    def model(self) -> str:
        """Return "orthographic" or "perspective"."""
        return "perspective" if self.bic_gain > MARGIN else "orthographic"


def landmark_starts(
    landmarks: Sequence[Landmarks | None], surface: Surface
) -> tuple[LandmarkFit | None, ...]:
    """Fit a camera to the landmarks of every view; None if they are too few.

    Raises:
        LandmarkError: a view's pairs lie on a line or in one place, or far from the mannequin.
    """
    return tuple(
        None if view is None or len(view.names) < LEAST_POINTS else solve_landmarks(view, surface)
        for view in landmarks
    )


def solve_landmarks(landmarks: Landmarks, surface: Surface) -> LandmarkFit:
    """Return the camera of one view from its landmarks alone.

    Args:
        landmarks: at least three pairs; four that do not lie in a plane have one camera, five
            and more can show perspective, six and more a misplaced pair.
        surface: the mannequin.

    Raises:
        LandmarkError: the pairs lie on a line or in one place, or far from the mannequin.
    """
    points, pixels = landmarks.world - surface.middle, landmarks.pixels
    _check_spread(landmarks, points, surface.radius)
    kept, best, gain = choose(points, pixels)
    freedom = max(best.freedom, 1)  # three pairs: what does not fit exactly is not an optimum
    weights = np.exp(-0.5 * freedom * np.log(np.array(best.errors) / best.errors[0]))
    probable = weights / weights.sum()
    count = int((probable >= LEAST_PROBABILITY).sum())
    pose = best.poses[0]
    sigma = _sigma_px(best, CLICK_OF_HEIGHT * surface.height * pose.scale)
    return LandmarkFit(
        landmarks.view,
        best.poses[:count],
        tuple(float(p) for p in probable[:count]),
        float(np.sqrt(squared_error(pose, points[kept], pixels[kept]) / best.pairs)),
        sigma,
        _covariance(pose, points[kept], sigma, perspective=best.perspective),
        tuple(name for name, keep in zip(landmarks.names, kept, strict=True) if not keep),
        float(gain),
    )


def _sigma_px(best: Explanation, expected_px: float) -> float:
    """Return the error of a pixel coordinate: what is left over, and what clicks are like."""
    total = best.errors[0] + CLICK_WEIGHT * expected_px**2
    return float(np.sqrt(total / (best.freedom + CLICK_WEIGHT)))


def _covariance(
    pose: Pose, points: Points, sigma_px: float, *, perspective: bool
) -> Float[np.ndarray, "6 6"]:
    """Return the covariance of (w, shift, log scale); no angle is less certain than a turn."""
    free = PARAMETERS + perspective
    rows = project_with_jacobian(pose, points)[1][..., :free].reshape(-1, free)
    normal = rows.T @ rows / sigma_px**2
    normal[:3, :3] += np.eye(3) / np.pi**2
    return np.linalg.inv(normal)[:PARAMETERS, :PARAMETERS]


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
