"""Judge cameras that were found without a mannequin: sigmas, mirror twins, alternatives, verdicts.

Front and back, the way round and the pattern of the turn are three errors, each with a probability.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.coherence_state import SheetState
from toonset.calib.fit.drawing_error import Noise
from toonset.calib.fit.model_selection import ORTHOGRAPHIC, SHARED, ModelChoice
from toonset.calib.options import CalibrationOptions, VerdictThresholds
from toonset.calib.result import Alternative, Calibration, Sigmas, ViewCalibration
from toonset.calib.verdict.checks import OF_DRAWINGS, JudgedSheet, apply_checks
from toonset.calib.verdict.judge import judge_sheet
from toonset.calib.without_body.placing import NOT_PLACED, Figures, SheetCameras
from toonset.calib.without_body.posterior import ErrorProbabilities, doubts, label_doubt, view_doubt
from toonset.calib.without_body.turns import NEAR, STARTS, TurnHypotheses, wrapped
from toonset.camera import Camera, rotation_from_angles
from toonset.dataset.bundle.calibration_schema import Verdict
from toonset.dataset.silhouettes.coherence import ViewCoherence, coherence
from toonset.dataset.split_folder.view_labels import Label
from toonset.view import View

FREE_VIEWS = (5, 6, 7)  # whose steps may be uneven; those of other numbers hardly ever are
RING_VIEWS = 8  # from which steps are even ones
# Of yaws: what artists are off where all coheres, and what more where outlines are apart
LEAST_YAW_SIGMA, YAW_PER_APART, FREE_SIGMA = np.radians(1.0), np.radians(200.0), np.radians(7.0)
ROLL_SIGMA, SCALE_SIGMA, SHIFT = np.radians(1.0), 0.01, 0.01  # the last of the height
FEWEST_TO_CONFIRM = 3  # views
ASK = "say which view is the front (--front 0)"
ONE = "are all of one character, in one pose and at one scale?"
WORTH_SAYING = 0.05  # probability of an error
MOST_ALTERNATIVES, LEAST_ALTERNATIVE = 4, 0.01


@dataclass(frozen=True, eq=False)
class Found:
    """The turn of a sheet and its cameras.

    Attributes:
        turns: all that were weighed.
        posterior: (turns,) their probabilities.
        log_likelihood: (turns,) of the drawings alone, nats.
        chosen: the most probable turn.
        placed: its cameras; none until they are placed.
        is_free: its yaws were measured one by one.
    """

    turns: TurnHypotheses
    posterior: Float[np.ndarray, " turns"]
    log_likelihood: Float[np.ndarray, " turns"]
    chosen: int
    placed: SheetCameras = NOT_PLACED
    is_free: bool = False


def judge_found(
    figures: Figures, found: Found, labels: Sequence[Label], options: CalibrationOptions
) -> Calibration:
    """Return the calibration of cameras that were found without a mannequin.

    Args:
        figures: the drawings.
        found: their turn and cameras.
        labels: which yaws a person named, per view; () for none.
        options: what to doubt.
    """
    views, cameras, limits = figures.views, found.placed.cameras, options.thresholds
    cohering = coherence(views, cameras) if len(views) > 1 else None
    state = SheetState(
        True,
        float("nan"),
        cohering.odd_view if cohering else None,
        len(views),
        found.placed.elevation,
        limits,
    )
    apart = cohering.contradiction if cohering else float("nan")
    doubt = doubts(found.turns, found.posterior, found.chosen)
    outlines = cohering.views if cohering else ()
    each = _views(figures, found, outlines)
    judged = _doubted(each, views, found, labels, apart, doubt, state)
    judged = apply_checks(JudgedSheet(judged, views, state), OF_DRAWINGS, options.without)
    verdict, reason = judge_sheet(judged, state)
    reason = "" if verdict == "ok" else reason
    said = _doubts_text(doubt) if verdict != "ok" else ""
    ask = ASK if verdict != "ok" and not any(labels) else ""
    near = cameras[0].k
    return Calibration(
        judged,
        ModelChoice(
            SHARED if near else ORTHOGRAPHIC,
            (1 / near if near else float("inf"),) * len(views),
            (),
            float(len(views)),
        ),
        0.0,
        Noise(found.placed.apart, 0.0),
        apart,
        np.zeros((0, 3)),
        verdict,
        "; ".join(part for part in (reason, said, ask) if part),
        {},
    )


def _views(
    figures: Figures, found: Found, outlines: Sequence[ViewCoherence]
) -> tuple[ViewCalibration, ...]:
    """Return the views as if nothing were doubtful."""
    each = [_sigmas(figures, found, i) for i in range(len(figures.views))]
    return tuple(
        ViewCalibration(
            view.name,
            camera,
            each[i],
            _covariance(each[i]),
            _p_flip(found, i),
            camera.twin(),
            _alternatives(found, i, camera),
            outlines[i].contradiction if outlines else 0.0,
            outlines[i].share if outlines else 1.0,
            "ok",
            "",
        )
        for i, (view, camera) in enumerate(zip(figures.views, found.placed.cameras, strict=True))
    )


def _doubted(
    views: Sequence[ViewCalibration],
    drawings: Sequence[View],
    found: Found,
    labels: Sequence[Label],
    apart: float,
    doubt: ErrorProbabilities,
    state: SheetState,
) -> tuple[ViewCalibration, ...]:
    """Return the views with their own verdicts."""
    scale = scale_apart(found.placed.cameras)
    stretch = stretch_apart(drawings, found.turns.yaws[found.chosen])
    sheet_verdict = _apart_verdict(len(views), any(labels), apart, scale, state.thresholds)
    wrong = view_doubt(found.turns, found.posterior, found.chosen)
    misread = label_doubt(found.turns, found.log_likelihood, found.chosen, labels)
    judged = []
    for i, view in enumerate(views):
        verdict, reason = sheet_verdict or _turn_verdict(
            found, labels, float(wrong[i]), float(misread[i]), doubt, state.thresholds
        )
        if verdict == "ok":
            verdict, reason = _weak_verdict(len(views), apart, scale, stretch, state.thresholds)
        if verdict == "ok" and i == state.odd_view:
            verdict, reason = "weak", "disagrees with the other drawings"
        judged.append(replace(view, verdict=verdict, reason=reason))
    return tuple(judged)


def _apart_verdict(
    views: int, has_label: bool, apart: float, scale: float, limits: VerdictThresholds
) -> tuple[Verdict, str] | None:
    """Return the verdict where drawings are too few or not one turning body's, else None."""
    if views == 1:
        if has_label:
            return "weak", "a single drawing: nothing confirms its label, scale and elevation"
        return "ambiguous", "a single drawing without a body shows no direction"
    if apart > limits.failed_apart:
        off = f"{100 * apart:.1f} % of the height"
        return "failed", f"the outlines are {off} from being one turning body's: {ONE}"
    if scale > limits.failed_scale:
        return (
            "failed",
            f"a drawing fits only {scale:.1f} times larger or smaller than the others: {ONE}",
        )
    return None


def _turn_verdict(
    found: Found,
    labels: Sequence[Label],
    wrong: float,
    misread: float,
    doubt: ErrorProbabilities,
    limits: VerdictThresholds,
) -> tuple[Verdict, str]:
    """Return the verdict of a view by the probability that it is seen from elsewhere."""
    if wrong > 1 - limits.sure:
        kinds = {"front or back": doubt.front, "which way round": doubt.way}
        kinds["where the axis lies"] = doubt.spacing
        kind, p = max(kinds.items(), key=lambda pair: pair[1])
        return "ambiguous", f"{kind} is open: p = {p:.2f} that it is another"
    if found.is_free and not (labels and all(labels)):
        return "weak", "its steps may be uneven: label every view to confirm them"
    if misread > 1 - limits.sure:
        return "weak", "what is drawn speaks for another direction: is a label wrong?"
    return "ok", ""


def _weak_verdict(
    views: int, apart: float, scale: float, stretch: float, limits: VerdictThresholds
) -> tuple[Verdict, str]:
    if views < FEWEST_TO_CONFIRM:
        return "weak", "two drawings: nothing confirms their directions, scale and elevation"
    if scale > limits.weak_scale:
        return "weak", f"a drawing is {scale:.1f} times larger or smaller than the others: {ONE}"
    if stretch > limits.weak_scale:
        return "weak", f"a figure is {stretch:.1f} times as high or as wide as the others: {ONE}"
    if apart > limits.weak_apart and views >= limits.telling_views:
        return "weak", f"the outlines are {100 * apart:.1f} % of the height apart: {ONE}"
    return "ok", ""


def scale_apart(cameras: Sequence[Camera]) -> float:
    """Return how many times larger or smaller than usual the farthest view is drawn, >= 1."""
    logs = np.log([camera.scale for camera in cameras])
    return float(np.exp(np.abs(logs - np.median(logs)).max()))


def stretch_apart(views: Sequence[View], yaws: Float[np.ndarray, " views"]) -> float:
    """Return by what factor heights differ, or mean widths seen from opposite sides, >= 1.

    At eye level figures are of one height, and opposite outlines mirror each other. How wide a
    figure is from a side that no other drawing faces may be anything.
    """
    boxes = [view.mask.any(axis=1) for view in views]
    heights = np.array([np.ptp(np.flatnonzero(rows)) + 1 for rows in boxes])
    widths = np.log([view.mask.sum() for view in views]) - np.log(heights)
    opposite = np.abs(wrapped(yaws[:, None] - yaws + np.pi)) <= NEAR
    off = np.abs(np.log(heights / np.median(heights))).max()
    across = np.abs(widths[:, None] - widths)[opposite].max(initial=0.0)
    return float(np.exp(max(off, across)))


def _doubts_text(doubt: ErrorProbabilities) -> str:
    """Return in words what may be wrong; empty where nothing is likely to be."""
    each = {
        "front or back": doubt.front,
        "which way round": doubt.way,
        "where the axis lies": doubt.spacing,
    }
    said = [f"{kind} {p:.2f}" for kind, p in each.items() if p > WORTH_SAYING]
    return f"in doubt: {', '.join(said)}" if said else ""


def _sigmas(figures: Figures, found: Found, view: int) -> Sigmas:
    """Return a view's sigmas; what is drawn between front and side may be any such direction."""
    placed = found.placed
    yaw = float(np.hypot(LEAST_YAW_SIGMA, YAW_PER_APART * placed.apart))
    between = abs(np.sin(2 * found.turns.yaws[found.chosen, view])) > np.sin(NEAR)
    if found.is_free or (between and len(figures.views) < RING_VIEWS):
        yaw = float(np.hypot(yaw, FREE_SIGMA))
    shift = SHIFT * figures.height_px
    return Sigmas(yaw, placed.elevation_sigma, float(ROLL_SIGMA), SCALE_SIGMA, shift)


def _covariance(sigmas: Sigmas) -> Float[np.ndarray, "6 6"]:
    shift = sigmas.shift_px
    each = (sigmas.elevation, sigmas.yaw, sigmas.roll, shift, shift, sigmas.scale_relative)
    return np.diag(np.square(each))


def _p_flip(found: Found, view: int) -> float:
    """Return the probability that the view is its mirror twin: yaw -> 180 - yaw."""
    yaws = found.turns.yaws[:, view]
    own = yaws[found.chosen]
    if abs(wrapped(np.array(np.pi - 2 * own))) <= NEAR:
        return 0.0  # seen from the side: both are one
    return float(found.posterior[np.abs(wrapped(yaws - (np.pi - own))) <= NEAR].sum())


def _alternatives(found: Found, view: int, camera: Camera) -> tuple[Alternative, ...]:
    """Return other cameras of a view, the most probable first."""
    yaws = found.turns.yaws[:, view]
    own, elevation, roll = yaws[found.chosen], *camera.angles[1:]
    turned = camera.angles[0] - own
    shares: dict[int, float] = {}
    for yaw, share in zip(yaws, found.posterior, strict=True):
        place = round(float(wrapped(np.array(yaw - own))) / (2 * NEAR)) % STARTS
        shares[place] = shares.get(place, 0.0) + float(share)
    likely = sorted(((share, at) for at, share in shares.items() if at), reverse=True)
    return tuple(
        Alternative(
            replace(
                camera, rotation=rotation_from_angles(own + turned + at * 2 * NEAR, elevation, roll)
            ),
            share,
        )
        for share, at in likely[:MOST_ALTERNATIVES]
        if share >= LEAST_ALTERNATIVE
    )
