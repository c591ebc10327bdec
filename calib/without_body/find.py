"""Calibrate views without a mannequin: choose the turn, then make the silhouettes coherent.

1. all turns that artists lay out, weighed by paint, faces, detail and outlines (`posterior`);
   five, six or seven views may stand anywhere (`uneven`)
2. the most probable turn's cameras: elevation, perspective, places and sizes (`placing`)
3. verdicts: front and back, the way round and the pattern are three doubts
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.coherence_state import TELLING_VIEWS, SheetState
from toonset.calib.fit.drawing_error import Noise
from toonset.calib.fit.model_selection import ORTHOGRAPHIC, SHARED, ModelChoice
from toonset.calib.known import Known
from toonset.calib.options import Progress
from toonset.calib.result import Alternative, Calibration, Sigmas, Verdict, ViewCalibration
from toonset.calib.verdict.judge import SURE, judge_sheet
from toonset.calib.verdict.one_character import downgrade_by_characters
from toonset.calib.verdict.repeated import downgrade_by_repeats
from toonset.calib.without_body.cues import Cues
from toonset.calib.without_body.placing import Figures, SheetCameras
from toonset.calib.without_body.posterior import (
    ErrorProbabilities,
    doubts,
    outlines_log_likelihood,
    view_doubt,
)
from toonset.calib.without_body.turns import (
    NEAR,
    P_FRONT_FIRST,
    STARTS,
    TurnHypotheses,
    held,
    is_even,
    labelled,
    turn_hypotheses,
    wrapped,
)
from toonset.camera import Camera, rotation_from_angles
from toonset.dataset.silhouettes.coherence import coherence
from toonset.dataset.split_folder.view_labels import Label
from toonset.view import View

FREE_VIEWS = (5, 6, 7)  # which may be no even ring; four and eight views hardly ever are uneven
FREE_YAW = np.radians(3.0)  # sigma of a view about the yaw that paint and outlines gave it
LEAST_GAIN = 2.0  # nats, of free yaws over an even ring
# Of yaws: what artists are off where all coheres, and what more where outlines are apart
LEAST_YAW_SIGMA, YAW_PER_APART, FREE_SIGMA = np.radians(1.0), np.radians(200.0), np.radians(7.0)
ROLL_SIGMA, SCALE_SIGMA, SHIFT = np.radians(1.0), 0.01, 0.01  # the last of the height
WEAK_APART, FAILED_APART = 0.03, 0.06  # of the height
WEAK_SCALE, FAILED_SCALE = 1.25, 1.5  # times the others' scale: another size, or another body
FEWEST_TO_CONFIRM = 3  # views
MOST_AGAINST = 3.0  # nats by which drawings speak against a label
ASK = "say which view is the front (--front 0)"
ONE = "are all of one character, in one pose and at one scale?"
MOST_ALTERNATIVES, LEAST_ALTERNATIVE = 4, 0.01


@dataclass(frozen=True, eq=False)
class Found:
    """The turn of a sheet and its cameras.

    Attributes:
        turns: all that were weighed.
        posterior: (turns,) their probabilities.
        log_likelihood: (turns,) of the drawings alone, nats.
        chosen: the most probable turn.
        placed: its cameras.
        is_even: it is an even ring.
    """

    turns: TurnHypotheses
    posterior: Float[np.ndarray, " turns"]
    log_likelihood: Float[np.ndarray, " turns"]
    chosen: int
    placed: SheetCameras
    is_even: bool


def calibrate_without_body(
    views: Sequence[View],
    known: Known,
    progress: Progress = lambda step, share: None,
    cues: Cues | None = None,
) -> Calibration:
    """Return one camera per view from the drawings alone; the world is the figure's, 1 high.

    Args:
        views: the drawings, at least one.
        known: labels and the yaws of cameras count, the rest needs a mannequin.
        progress: called with the step's name and the share of it that is done.
        cues: of these drawings, if they were looked at before.
    """
    began = time.perf_counter()
    progress("turns", 0.0)
    cues = cues or Cues(views)
    turns, posterior, likelihood = _weighed(cues, known)
    chosen = int(posterior.argmax())
    weighed = time.perf_counter()
    progress("cameras", 0.0)
    yaws = turns.yaws[chosen]
    even = is_even(yaws)
    free = 0.0 if even else float(FREE_YAW)
    locked = np.isfinite(known.kept_yaws(len(views)))
    placed = cues.placed(yaws, np.where(locked, 0.0, free))
    found = Found(turns, posterior, likelihood, chosen, placed, even)
    seconds = {"turns": weighed - began, "cameras": time.perf_counter() - weighed}
    return _judged(cues.figures, found, known.labels, seconds)


def _weighed(
    cues: Cues, known: Known
) -> tuple[TurnHypotheses, Float[np.ndarray, " turns"], Float[np.ndarray, " turns"]]:
    """Return the turns, their probabilities and the drawings' part in them, nats."""
    views, labels = len(cues.views), known.labels
    turns = turn_hypotheses(views, labels)
    if views in FREE_VIEWS and not (labels and all(labels)):
        turns = _with_free(cues, turns, known)
    turns = held(turns, known.asked_yaws(views), known.kept_yaws(views))
    outlines = np.zeros(len(turns.yaws))
    if views > 1:
        outlines = outlines_log_likelihood(cues.figures, turns)
    likelihood = cues.evidence.log_likelihood(turns.yaws, outlines)
    total = turns.log_prior + likelihood
    posterior = np.exp(total - total.max())
    return turns, posterior / posterior.sum(), likelihood


def _with_free(cues: Cues, turns: TurnHypotheses, known: Known) -> TurnHypotheses:
    """Return the turns, the even ones replaced where drawings prove that theirs is another."""
    relative, gain = cues.free_yaws
    if gain < LEAST_GAIN:
        return turns
    rows = np.arange(3 * STARTS) * 2 * np.pi / (3 * STARTS)
    first = np.full(len(rows), np.log((1 - P_FRONT_FIRST) / (len(rows) - 1)))
    first[0] = np.log(P_FRONT_FIRST)
    free = TurnHypotheses(rows[:, None] + relative, first, np.zeros(len(rows)))
    views, labels = len(cues.views), known.labels
    free = held(free, known.asked_yaws(views), known.kept_yaws(views))  # the others may stay
    return labelled(free, labels) if any(labels) else free


def _judged(
    figures: Figures, found: Found, labels: Sequence[Label], seconds: dict[str, float]
) -> Calibration:
    views, placed = figures.views, found.placed
    many = len(views) > 1
    cohering = coherence(views, placed.cameras) if many else None
    apart = cohering.contradiction if cohering else float("nan")
    odd = cohering.odd_view if cohering else None
    wrong = view_doubt(found.turns, found.posterior, found.chosen)
    doubt = doubts(found.turns, found.posterior, found.chosen)
    against = float(found.log_likelihood.max() - found.log_likelihood[found.chosen])
    sigmas = _sigmas(figures, found)
    each = []
    for i, (view, camera) in enumerate(zip(views, placed.cameras, strict=True)):
        verdict, reason = _verdict(found, labels, apart, float(wrong[i]), doubt, against)
        if verdict == "ok" and i == odd:
            verdict, reason = "weak", "disagrees with the other drawings"
        own = cohering.views[i] if cohering else None
        each.append(
            ViewCalibration(
                view.name,
                camera,
                sigmas,
                _covariance(sigmas),
                _p_flip(found, i),
                camera.twin(),
                _alternatives(found, i, camera),
                own.contradiction if own else 0.0,
                own.share if own else 1.0,
                verdict,
                reason,
            )
        )
    judged = downgrade_by_characters(downgrade_by_repeats(each, views), views)
    state = SheetState(True, float("nan"), odd, len(views), placed.elevation)
    verdict, reason = judge_sheet(judged, state)
    reason = "" if verdict == "ok" else reason
    text = _doubts_text(doubt) + (f"; {ASK}" if verdict != "ok" and not any(labels) else "")
    near = placed.cameras[0].k
    return Calibration(
        judged,
        ModelChoice(
            SHARED if near else ORTHOGRAPHIC,
            (1 / near if near else float("inf"),) * len(views),
            (),
            float(len(views)),
        ),
        0.0,
        Noise(placed.apart, 0.0),
        apart,
        np.zeros((0, 3)),
        verdict,
        "; ".join(part for part in (reason, text) if part),
        seconds,
    )


def _verdict(
    found: Found,
    labels: Sequence[Label],
    apart: float,
    wrong: float,
    doubt: ErrorProbabilities,
    against: float,
) -> tuple[Verdict, str]:
    views, has_label = len(found.placed.cameras), any(labels)
    scale = scale_apart(found.placed.cameras)
    if views == 1:
        if has_label:
            return "weak", "a single drawing: nothing confirms its label, scale and elevation"
        return "ambiguous", "a single drawing without a body shows no direction"
    if views < FEWEST_TO_CONFIRM and has_label:
        return "weak", "two drawings: nothing confirms their labels, scale and elevation"
    if apart > FAILED_APART:
        off = f"{100 * apart:.1f} % of the height"
        return "failed", f"the outlines are {off} from being one turning body's: {ONE}"
    if scale > FAILED_SCALE:
        return (
            "failed",
            f"a drawing fits only {scale:.1f} times larger or smaller than the others: {ONE}",
        )
    if wrong > 1 - SURE:
        kinds = {"front or back": doubt.front, "which way round": doubt.way}
        kinds["where the axis lies"] = doubt.spacing
        kind, p = max(kinds.items(), key=lambda pair: pair[1])
        return "ambiguous", f"{kind} is open: p = {p:.2f} that it is another"
    if not has_label:
        return "weak", "no body, no label: only faces, paint and layout tell the front"
    if not all(labels) and (views in FREE_VIEWS or not found.is_even):
        return "weak", "its steps may be uneven: label every view to confirm them"
    if against > MOST_AGAINST:
        return "weak", "what is drawn speaks for another direction: is a label wrong?"
    if scale > WEAK_SCALE:
        return "weak", f"a drawing is {scale:.1f} times larger or smaller than the others: {ONE}"
    if apart > WEAK_APART and views >= TELLING_VIEWS:
        return "weak", f"the outlines are {100 * apart:.1f} % of the height apart: {ONE}"
    return "ok", ""


def scale_apart(cameras: Sequence[Camera]) -> float:
    """Return how many times larger or smaller than usual the farthest view is drawn, >= 1."""
    logs = np.log([camera.scale for camera in cameras])
    return float(np.exp(np.abs(logs - np.median(logs)).max()))


def _doubts_text(doubt: ErrorProbabilities) -> str:
    return (
        f"without a body; in doubt: front or back {doubt.front:.2f}, which way round "
        f"{doubt.way:.2f}, spacing {doubt.spacing:.2f}"
    )


def _sigmas(figures: Figures, found: Found) -> Sigmas:
    placed = found.placed
    yaw = float(np.hypot(LEAST_YAW_SIGMA, YAW_PER_APART * placed.apart))
    if not found.is_even:
        yaw = float(np.hypot(yaw, FREE_SIGMA))
    return Sigmas(
        yaw, placed.elevation_sigma, float(ROLL_SIGMA), SCALE_SIGMA, SHIFT * figures.height_px
    )


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
