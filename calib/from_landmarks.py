"""Calibrate from landmarks alone, for drawings whose outline is not the mannequin's.

Every view is solved by itself (`toonset.calib.fit.landmarks`). How far its outline is from
the mannequin's is reported, and judges nothing: who clicks points of a body under a cloak knows.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from toonset.calib.evidence.coherence_state import state_of
from toonset.calib.fit.align import measure
from toonset.calib.fit.drawing_error import Noise
from toonset.calib.fit.landmarks import LandmarkFit, solve_landmarks
from toonset.calib.fit.model_selection import (
    BIC_MARGIN,
    ORTHOGRAPHIC,
    SHARED,
    ModelChoice,
    ModelTest,
)
from toonset.calib.options import VerdictThresholds
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.outline.occluding_contour import Surface, prepare_surface
from toonset.calib.result import Alternative, Calibration, Sigmas, ViewCalibration
from toonset.calib.search.candidates import is_twin
from toonset.calib.verdict.judge import angle_sigmas, judge_sheet, outlines_apart
from toonset.dataset.bundle.calibration_schema import Verdict
from toonset.dataset.mannequin.landmark_file import Landmarks
from toonset.dataset.silhouettes.contour import drawn_contour
from toonset.errors import LandmarkError
from toonset.mesh import Mesh
from toonset.view import View

# Of four pairs with a wrong one, another camera may fit all: 4 of 432 views were 110 degrees off
FEWEST_SURE = 5
OUTLINE_HEIGHT_PX, OUTLINE_POINTS = 250.0, 200  # scale at which outlines are compared


def calibrate_by_landmarks(
    views: Sequence[View],
    mesh: Mesh,
    landmarks: Sequence[Landmarks | None],
    thresholds: VerdictThresholds = VerdictThresholds(),
) -> Calibration:
    """Return one camera per view from its landmarks; no outline is fitted.

    Args:
        views: the drawings, at least one.
        mesh: the mannequin that the landmarks' world points belong to.
        landmarks: the pairs of every view.
        thresholds: where to begin to doubt.

    Raises:
        LandmarkError: a view without landmarks, or pairs that determine no camera.
    """
    start = time.perf_counter()
    surface = prepare_surface(mesh)
    pairs = landmarks_of_every_view(views, landmarks)
    fits = solve_landmarks(pairs, surface)
    solved = time.perf_counter()
    drawings = [Drawing(drawn_contour(v), OUTLINE_HEIGHT_PX, OUTLINE_POINTS) for v in views]
    each = zip(views, drawings, fits, strict=True)
    wrong = any(fit.misplaced for fit in fits)
    judged = tuple(_judged(*one, surface, thresholds, others_wrong=wrong) for one in each)
    state = state_of(views, [view.camera for view in judged], thresholds)
    # one drawing's landmarks confirm its scale and elevation; its outline would not
    only = judged[0]
    single = len(views) == 1
    verdict, reason = (only.verdict, only.reason) if single else judge_sheet(judged, state)
    heights = [drawing.height / drawing.factor for drawing in drawings]
    off = [fit.sigma_px / height for fit, height in zip(fits, heights, strict=True)]
    return Calibration(
        judged,
        _model(fits, pairs, surface),
        0.0,
        Noise(0.0, float(np.median(off))),
        state.contradiction,
        mesh.vertices,
        verdict,
        reason,
        {"landmarks": solved - start, "judge": time.perf_counter() - solved},
        landmarks=fits,
    )


def landmarks_of_every_view(
    views: Sequence[View], landmarks: Sequence[Landmarks | None]
) -> list[Landmarks]:
    """Return the landmarks of all views.

    Raises:
        LandmarkError: a view without any.
    """
    without = [v.name for v, own in zip(views, landmarks, strict=True) if own is None]
    if without:
        raise LandmarkError(
            f"--landmarks-only: no landmarks for {', '.join(without)}; give three or more in "
            "every view, or leave --landmarks-only out"
        )
    return [own for own in landmarks if own is not None]


def _judged(
    view: View,
    drawing: Drawing,
    fit: LandmarkFit,
    surface: Surface,
    limits: VerdictThresholds,
    *,
    others_wrong: bool,
) -> ViewCalibration:
    size_wh = (view.rgba.shape[1], view.rgba.shape[0])
    pose, *others = fit.poses
    cameras = [other.camera(surface.middle, size_wh) for other in others]
    mirrored = [is_twin(pose, other) for other in others]
    twin = others[mirrored.index(True)] if any(mirrored) else pose.twin()
    p_flip = float(np.dot(mirrored, fit.probabilities[1:]))
    outline = measure(drawing, surface, drawing.pose_in(pose))
    sigmas = angle_sigmas(pose, fit.covariance)
    verdict, reason = _verdict(fit, sigmas, drawing.height / drawing.factor, limits)
    if verdict == "ok" and others_wrong and fit.pairs < FEWEST_SURE:
        verdict, reason = "weak", f"{fit.pairs} landmarks, and other views have wrong ones: add one"
    if verdict == "ok" and outline.coverage < limits.failed_coverage:
        apart = outlines_apart(outline.coverage)
        verdict, reason = "weak", f"{apart}: are these the points of this mannequin?"
    return ViewCalibration(
        view.name,
        pose.camera(surface.middle, size_wh),
        sigmas,
        fit.covariance,
        p_flip,
        twin.camera(surface.middle, size_wh),
        tuple(map(Alternative, cameras, fit.probabilities[1:])),
        outline.error,
        outline.coverage,
        verdict,
        reason,
    )


def _verdict(
    fit: LandmarkFit, sigmas: Sigmas, height_px: float, limits: VerdictThresholds
) -> tuple[Verdict, str]:
    doubt = fit.doubt(height_px, limits)
    if doubt:
        return doubt
    if fit.misplaced:
        return "weak", f"landmarks that do not fit the others: {', '.join(fit.misplaced)}"
    if max(sigmas.yaw, sigmas.elevation) > np.radians(limits.weak_sigma_deg):
        worst = "yaw" if sigmas.yaw >= sigmas.elevation else "elevation"
        return "weak", f"the landmarks hardly tell {worst}: add points farther from the others"
    return "ok", ""


def _model(
    fits: Sequence[LandmarkFit], pairs: Sequence[Landmarks], surface: Surface
) -> ModelChoice:
    k = fits[0].poses[0].k
    distance = 1 / (k * surface.height) if k > 0 else float("inf")
    return ModelChoice(
        SHARED if k > 0 else ORTHOGRAPHIC,
        (distance,) * len(fits),
        (ModelTest(SHARED, fits[0].bic_gain, 1, BIC_MARGIN),),
        float(2 * sum(len(own.names) for own in pairs)),
    )
