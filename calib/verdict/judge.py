"""Judge cameras: probabilities of alternatives, angular uncertainties, verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.coherence_state import MOST_CONTRADICTION, SheetState
from toonset.calib.fit.align import Fit, measure
from toonset.calib.fit.sheet_adjustment import JointFit
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.outline.occluding_contour import Surface
from toonset.calib.outline.pose import PARAMETERS, Pose
from toonset.calib.result import SEVERITY, Alternative, Sigmas, Verdict, ViewCalibration
from toonset.calib.search.hypotheses import OTHER, Candidates, is_twin
from toonset.camera import angles_from_rotation, rotation_distance
from toonset.dataset.split_folder.view_labels import Label
from toonset.view import View

SURE = 0.95  # probability of the chosen camera below which it is called ambiguous
WEAK_COVERAGE = 0.93  # of both outlines within 5 % of the height of each other
FAILED_COVERAGE = 0.70
# Of the probability that faces are false: at most 0.2 on sheets with right cameras
MOST_FACES_CONTRADICT = 0.5
SIDEWAYS = np.sin(np.radians(20.0))  # of the cosine of yaw: seen from the side
# 2 characters, 3 to 8 views: at most 4 degrees under true locks, 6 on under ones 16 degrees off
MOST_PULL = np.radians(5.0)
FAR_FROM_PLACE = np.radians(12.0)  # four times what artists are off an even turn
FAR_FROM_LABEL = np.radians(60.0)  # three quarters is neither front nor side
WEAK_ANGLE = OTHER / 3  # one sigma of yaw or elevation: three of them reach another camera


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
    surface: Surface,
    joint: JointFit,
    index: int,
    candidates: Candidates,
    probability: Float[np.ndarray, " n"],
    sheet: SheetState,
    *,
    differs: bool,
) -> ViewCalibration:
    """Return the camera of view `index` with what is known about it.

    Args:
        view: the drawing.
        drawing: its outline, the sheet's offset taken off.
        surface: the mannequin, bent where it was.
        joint: the sheet's fit.
        index: of the view.
        candidates: what else it could be.
        probability: of each candidate.
        sheet: what the drawings say about each other.
        differs: the mannequin is another body than the drawn one.
    """
    pose = joint.poses[index]
    size_wh = (view.rgba.shape[1], view.rgba.shape[0])
    fit = measure(drawing, surface, drawing.pose_in(pose))
    own = slice(PARAMETERS * index, PARAMETERS * (index + 1))
    covariance = _in_view_pixels(joint.covariance[own, own], drawing.factor)
    far = [
        (float(p), f.pose)
        for p, f in zip(probability, candidates.fits, strict=True)
        if rotation_distance(f.pose.rotation, pose.rotation) > OTHER
    ]
    far.sort(key=lambda item: -item[0])
    mirrored = [item for item in far if is_twin(pose, item[1])]
    p_flip = sum(p for p, _ in mirrored)
    twin = mirrored[0][1] if mirrored else pose.twin()
    sigmas = angle_sigmas(pose, covariance)
    if not sheet.yaw_observable:
        sigmas = replace(sigmas, yaw=float(np.pi / np.sqrt(3)))
    others = [item for item in far if not is_twin(pose, item[1])]
    sideways = abs(np.cos(angles_from_rotation(pose.rotation)[0])) < SIDEWAYS
    twin_is = "seen from below for above" if sideways else "front and back swapped"
    verdict, reason = _verdict(fit.coverage, sigmas, p_flip, others, sheet, index, twin_is)
    if verdict == "ok" and not drawing.free.all() and differs:
        verdict = "weak"
        reason = (
            "the figure is cut off, and the mannequin another body: scale and shift are guesses"
        )
    return ViewCalibration(
        view.name,
        pose.camera(surface.middle, size_wh),
        sigmas,
        covariance,
        p_flip,
        twin.camera(surface.middle, size_wh),
        tuple(Alternative(q.camera(surface.middle, size_wh), p) for p, q in far[:4]),
        fit.error,
        fit.coverage,
        verdict,
        reason,
    )


def downgrade_by_locks(
    views: Sequence[ViewCalibration], pulled: Float[np.ndarray, " views"]
) -> list[ViewCalibration]:
    """Downgrade views whose outline contradicts their locked camera.

    A wrong lock can hide in another number (elevation in scale) and has no sigma, so that the
    outlines alone look well met. Where most views are pulled, all are.

    Args:
        views: judged one by one.
        pulled: how far every view turns where nothing is locked, radians.
    """
    least = MOST_PULL if np.median(pulled) < MOST_PULL else 0.0
    return [
        replace(
            view,
            verdict="weak",
            reason=f"without the lock the outlines turn this view by {np.degrees(turn):.0f} "
            "degrees: is what is locked right?",
        )
        if view.verdict == "ok" and turn > least
        else view
        for view, turn in zip(views, pulled, strict=True)
    ]


def downgrade_by_places(
    views: Sequence[ViewCalibration], off: Float[np.ndarray, " views"]
) -> list[ViewCalibration]:
    """Downgrade views that are far from their place in the even turn.

    The outline of another body can ask for that; that of one's own is to be believed.

    Args:
        views: judged one by one, with a mannequin that is another body.
        off: how far they are turned off their places, radians; 0 where none is known.
    """
    away = np.abs(off - np.median(off))
    reason = "turned {:.0f} degrees off even steps, and the mannequin is another body"
    return [
        replace(view, verdict="weak", reason=reason.format(np.degrees(turn)))
        if view.verdict == "ok" and turn > FAR_FROM_PLACE
        else view
        for view, turn in zip(views, away, strict=True)
    ]


def downgrade_by_labels(
    views: Sequence[ViewCalibration], labels: Sequence[Label]
) -> list[ViewCalibration]:
    """Downgrade views whose camera is far from their label."""
    judged = list(views)
    for i, (view, label) in enumerate(zip(views, labels, strict=False)):
        off = [abs((view.camera.angles[0] - yaw + np.pi) % (2 * np.pi) - np.pi) for yaw in label]
        if view.verdict == "ok" and off and min(off) > FAR_FROM_LABEL:
            reason = f"{np.degrees(min(off)):.0f} degrees from its label: which of them is right?"
            judged[i] = replace(view, verdict="weak", reason=reason)
    return judged


def downgrade_by_sheet(
    views: Sequence[ViewCalibration],
    sheet: SheetState,
    faces_contradict: float = 0.0,
    *,
    bent: bool = False,
) -> tuple[ViewCalibration, ...]:
    """Downgrade all views if the sheet as a whole is inconsistent.

    A wrong body can match a side view's outline well, at a wrong angle; a mirrored one matches all
    views, front and back swapped. A failed view has drawn the others along: they were fitted
    together.

    Args:
        views: judged one by one.
        sheet: what the drawings say about each other.
        faces_contradict: probability that what looks like faces must be none.
        bent: the mannequin was another body, its proportions were fitted.
    """
    typical = float(np.median([view.coverage for view in views]))
    doubtful = sum(view.verdict != "ok" for view in views)
    if typical < WEAK_COVERAGE and not sheet.drawings_confirm:
        reason = (
            f"in the sheet's typical view {_apart(typical)}: the mannequin's shape differs from "
            f"the drawings'; {sheet.unconfirmed}"
        )
    elif bent and not sheet.drawings_confirm:
        reason = f"the mannequin is another body, fitted to the drawings; {sheet.unconfirmed}"
    elif any(view.verdict == "failed" for view in views):
        reason = "a view of this sheet failed, and all were fitted together"
    elif 2 * doubtful > len(views):
        reason = f"{doubtful} of the sheet's {len(views)} views are uncertain"
    elif faces_contradict > MOST_FACES_CONTRADICT:
        reason = (
            f"what looks like faces is not where these cameras have the front (p = "
            f"{faces_contradict:.2f}): is the sheet, the mannequin or a label the wrong way round?"
        )
    else:
        return tuple(views)
    return tuple(
        replace(view, verdict="weak", reason=reason) if view.verdict == "ok" else view
        for view in views
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
    if worst == "ok" and sheet.contradiction > MOST_CONTRADICTION:
        off = f"{100 * sheet.contradiction:.1f} % of the height"
        return "weak", f"the drawings contradict each other by {off} under these cameras"
    typical = float(np.median([view.coverage for view in views]))
    if worst == "ok" and typical < WEAK_COVERAGE and sheet.drawings_confirm:
        apart = _apart(typical)
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


def _verdict(
    coverage: float,
    sigmas: Sigmas,
    p_flip: float,
    others: list[tuple[float, Pose]],
    sheet: SheetState,
    index: int,
    twin_is: str,
) -> tuple[Verdict, str]:
    apart = _apart(coverage)
    if coverage < FAILED_COVERAGE and not sheet.drawings_agree:
        return "failed", f"{apart}: this is not the mannequin's pose or shape"
    if not sheet.yaw_observable:
        return "ambiguous", "the body is a surface of revolution: yaw is not observable"
    if p_flip > 1 - SURE:
        return "ambiguous", f"the mirror twin ({twin_is}) has p = {p_flip:.2f}"
    p_other = sum(p for p, _ in others)
    if p_other > 1 - SURE:
        rival = _direction(others[0][1])
        return "ambiguous", f"{rival} fits as well, other directions have p = {p_other:.2f}"
    if index == sheet.odd_view:
        return "weak", "disagrees with the other drawings: wrong direction, mirrored or other scale"
    if coverage < (FAILED_COVERAGE if sheet.drawings_confirm else WEAK_COVERAGE):
        why = f"; {sheet.unconfirmed}" if sheet.unconfirmed else ""
        return "weak", f"{apart}: the mannequin's shape differs from the drawing's{why}"
    if max(sigmas.yaw, sigmas.elevation) > WEAK_ANGLE:
        worst = "yaw" if sigmas.yaw >= sigmas.elevation else "elevation"
        return "weak", f"the outline hardly changes with {worst}"
    return "ok", ""


def _apart(coverage: float) -> str:
    return f"{100 * (1 - coverage):.0f} % of the outlines are more than 5 % of the height apart"


def _direction(pose: Pose) -> str:
    yaw, elevation, _ = np.degrees(angles_from_rotation(pose.rotation))
    return f"yaw {yaw % 360:.0f}, elevation {elevation:.0f}"


def _in_view_pixels(
    covariance: Float[np.ndarray, "6 6"], factor: float
) -> Float[np.ndarray, "6 6"]:
    """Return the covariance with shifts in pixels of the view instead of the working scale."""
    units = np.array([1, 1, 1, 1 / factor, 1 / factor, 1])
    return covariance * np.outer(units, units)
