"""Calibrate views without a mannequin: choose the turn, then make the silhouettes coherent.

1. all turns that artists lay out, weighed by paint, faces, detail and outlines (`posterior`);
   five, six or seven views may stand anywhere (`uneven`)
2. the most probable turn's cameras: elevation, perspective, places and sizes (`placing`)
3. verdicts: front and back, the way round and the pattern are three doubts
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from toonset.calib.known import Known
from toonset.calib.options import CalibrationOptions, Progress
from toonset.calib.result import Calibration
from toonset.calib.without_body.cues import Cues
from toonset.calib.without_body.judge import FREE_VIEWS, Found, judge_found
from toonset.calib.without_body.posterior import outlines_log_likelihood
from toonset.calib.without_body.turns import (
    P_FRONT_FIRST,
    STARTS,
    TurnHypotheses,
    held,
    is_even,
    labelled,
    turn_hypotheses,
)
from toonset.view import View

FREE_YAW = np.radians(3.0)  # sigma of a view about the yaw that paint and outlines gave it
LEAST_GAIN = 2.0  # nats, of free yaws over an even ring


def calibrate_without_body(
    views: Sequence[View],
    known: Known,
    progress: Progress = lambda step, share: None,
    cues: Cues | None = None,
    options: CalibrationOptions = CalibrationOptions(),
) -> Calibration:
    """Return one camera per view from the drawings alone; the world is the figure's, 1 high.

    Args:
        views: the drawings, at least one.
        known: labels and the yaws of cameras count, the rest needs a mannequin.
        progress: called with the step's name and the share of it that is done.
        cues: of these drawings, if they were looked at before.
        options: what to doubt.
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
    return replace(judge_found(cues.figures, found, known.labels, options), seconds=seconds)


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
