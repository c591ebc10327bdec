"""Judge cameras: probabilities of alternatives, angular uncertainties, verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.coherence_state import SheetState
from toonset.calib.fit.align import Fit, measure
from toonset.calib.fit.sheet_adjustment import JointFit
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.outline.pose import PARAMETERS, Pose
from toonset.calib.result import SEVERITY, Alternative, Sigmas, ViewCalibration
from toonset.calib.search.candidates import OTHER, is_twin
from toonset.camera import angles_from_rotation, rotation_distance
from toonset.dataset.bundle.calibration_schema import Verdict
from toonset.view import View

SIDEWAYS = np.sin(np.radians(20.0))  # of the cosine of yaw: seen from the side


def measure_outlines(drawings: Sequence[Drawing], joint: JointFit) -> list[Fit]:
    """Measure how well the outlines of a sheet meet under its fit, view by view."""
    return [
        measure(drawing, joint.body.surface, drawing.pose_in(pose))
        for drawing, pose in zip(drawings, joint.poses, strict=True)
    ]


def typical_coverage(drawings: Sequence[Drawing], joint: JointFit) -> float:
    """Return the share of the outlines that meet, in the sheet's typical view."""
    return float(np.median([fit.coverage for fit in measure_outlines(drawings, joint)]))


def judge_view(
    view: View,
    drawing: Drawing,
    joint: JointFit,
    index: int,
    candidates: Sequence[tuple[float, Pose]],
    sheet: SheetState,
    *,
    differs: bool,
) -> ViewCalibration:
    """Return the camera of view `index` with what is known about it.

    Args:
        view: the drawing.
        drawing: its outline, the sheet's offset taken off.
        joint: the sheet's fit.
        index: of the view.
        candidates: what else it could be, each with its probability.
        sheet: what the drawings say about each other.
        differs: the mannequin is another body than the drawn one.
    """
    pose, middle = joint.poses[index], joint.body.surface.middle
    size_wh = (view.rgba.shape[1], view.rgba.shape[0])
    fit = measure(drawing, joint.body.surface, drawing.pose_in(pose))
    own = slice(PARAMETERS * index, PARAMETERS * (index + 1))
    covariance = _in_view_pixels(joint.covariance[own, own], drawing.factor)
    sigmas = angle_sigmas(pose, covariance)
    if not sheet.yaw_observable:
        sigmas = replace(sigmas, yaw=float(np.pi / np.sqrt(3)))
    far = [c for c in candidates if rotation_distance(c[1].rotation, pose.rotation) > OTHER]
    far.sort(key=lambda item: -item[0])
    mirrored = [item for item in far if is_twin(pose, item[1])]
    others = [item for item in far if not is_twin(pose, item[1])]
    p_flip = sum(p for p, _ in mirrored)
    verdict, reason = _verdict(fit.coverage, sigmas, p_flip, others, sheet, index, pose)
    if verdict == "ok" and not drawing.free.all() and differs:
        verdict = "weak"
        reason = (
            "the figure is cut off, and the mannequin another body: scale and shift are guesses"
        )
    twin = mirrored[0][1] if mirrored else pose.twin()
    return ViewCalibration(
        view.name,
        pose.camera(middle, size_wh),
        sigmas,
        covariance,
        p_flip,
        twin.camera(middle, size_wh),
        tuple(Alternative(other.camera(middle, size_wh), p) for p, other in far[:4]),
        fit.error,
        fit.coverage,
        verdict,
        reason,
    )


def judge_sheet(views: Sequence[ViewCalibration], sheet: SheetState) -> tuple[Verdict, str]:
    """Return the sheet's verdict: the worst that at least half of its views have.

    One uncertain view makes the sheet weak. So does a single drawing: nothing confirms its scale
    and elevation. A sheet that is ok against the mannequin says so.
    """
    counts = {level: sum(x.verdict == level for x in views) for level in SEVERITY[1:]}
    named = ", ".join(f"{n} of {len(views)} {level}" for level, n in counts.items() if n)
    worst: Verdict = "ok"
    for level in SEVERITY:
        if 2 * sum(SEVERITY.index(x.verdict) >= SEVERITY.index(level) for x in views) >= len(views):
            worst = level
    if len(views) == 1 and worst == "ok":
        return "weak", "a single drawing: nothing confirms its scale, elevation and perspective"
    if worst == "ok" and named:
        return "weak", named
    if worst == "ok" and sheet.contradiction > sheet.thresholds.most_contradiction:
        off = f"{100 * sheet.contradiction:.1f} % of the height"
        return "weak", f"the drawings contradict each other by {off} under these cameras"
    typical = float(np.median([view.coverage for view in views]))
    if worst == "ok" and typical < sheet.thresholds.weak_coverage and sheet.drawings_confirm:
        apart = outlines_apart(typical)
        return "ok", f"the mannequin has another shape, {apart}; but the drawings fit together"
    return worst, named


def angle_sigmas(pose: Pose, covariance: Float[np.ndarray, "6 6"]) -> Sigmas:
    """Return the uncertainty in angles of a pose from its covariance, (w, shift, log scale)."""
    step = 1e-5
    here = np.array(angles_from_rotation(pose.rotation))
    slopes = np.zeros((3, 3))
    for axis in range(3):
        move = np.zeros(PARAMETERS)
        move[axis] = step
        change = np.array(angles_from_rotation(pose.moved(move).rotation)) - here
        slopes[:, axis] = (change + np.pi) % (2 * np.pi) - np.pi
    angles = np.sqrt(np.diag(slopes @ covariance[:3, :3] @ slopes.T)) / step
    shift = float(np.sqrt(np.trace(covariance[3:5, 3:5]) / 2))
    yaw, elevation, roll = (float(min(a, np.pi)) for a in angles)
    return Sigmas(yaw, elevation, roll, float(np.sqrt(covariance[5, 5])), shift)


def outlines_apart(coverage: float) -> str:
    """Return in words how much of the outlines does not meet."""
    return f"{100 * (1 - coverage):.0f} % of the outlines are more than 5 % of the height apart"


def _verdict(
    coverage: float,
    sigmas: Sigmas,
    p_flip: float,
    others: list[tuple[float, Pose]],
    sheet: SheetState,
    index: int,
    pose: Pose,
) -> tuple[Verdict, str]:
    limits, apart = sheet.thresholds, outlines_apart(coverage)
    if coverage < limits.failed_coverage and not sheet.drawings_agree:
        return "failed", f"{apart}: this is not the mannequin's pose or shape"
    if not sheet.yaw_observable:
        return "ambiguous", "the body is a surface of revolution: yaw is not observable"
    if p_flip > 1 - limits.sure:
        sideways = abs(np.cos(angles_from_rotation(pose.rotation)[0])) < SIDEWAYS
        twin_is = "seen from below for above" if sideways else "front and back swapped"
        return "ambiguous", f"the mirror twin ({twin_is}) has p = {p_flip:.2f}"
    p_other = sum(p for p, _ in others)
    if p_other > 1 - limits.sure:
        rival = _direction(others[0][1])
        return "ambiguous", f"{rival} fits as well, other directions have p = {p_other:.2f}"
    if index == sheet.odd_view:
        return "weak", "disagrees with the other drawings: wrong direction, mirrored or other scale"
    if coverage < (limits.failed_coverage if sheet.drawings_confirm else limits.weak_coverage):
        why = f"; {sheet.unconfirmed}" if sheet.unconfirmed else ""
        return "weak", f"{apart}: the mannequin's shape differs from the drawing's{why}"
    if max(sigmas.yaw, sigmas.elevation) > np.radians(limits.weak_sigma_deg):
        worst = "yaw" if sigmas.yaw >= sigmas.elevation else "elevation"
        return "weak", f"the outline hardly changes with {worst}"
    return "ok", ""


def _direction(pose: Pose) -> str:
    yaw, elevation, _ = np.degrees(angles_from_rotation(pose.rotation))
    return f"yaw {yaw % 360:.0f}, elevation {elevation:.0f}"


def _in_view_pixels(
    covariance: Float[np.ndarray, "6 6"], factor: float
) -> Float[np.ndarray, "6 6"]:
    """Return the covariance with shifts in pixels of the view instead of the working scale."""
    units = np.array([1, 1, 1, 1 / factor, 1 / factor, 1])
    return covariance * np.outer(units, units)
