"""Calibrate views without a mannequin: choose the turn, then make the silhouettes coherent.

1. all turns that artists lay out, weighed by paint, faces, detail and outlines (`posterior`)
2. the most probable turn's cameras: elevation, perspective, places and sizes (`placing`); where
   outlines of five, six or seven views do not meet, their yaws are measured instead (`uneven`)
3. verdicts: front and back, the way round and the pattern are three doubts
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toonset.calib.known import Known
from toonset.calib.options import CalibrationOptions, Progress
from toonset.calib.result import Calibration
from toonset.calib.without_body.cues import Cues
from toonset.calib.without_body.judge import FREE_VIEWS, Found, judge_found
from toonset.calib.without_body.placing import SheetCameras
from toonset.calib.without_body.posterior import outlines_log_likelihood, view_doubt
from toonset.calib.without_body.turns import (
    P_FRONT_FIRST,
    STARTS,
    TurnHypotheses,
    held,
    labelled,
    turn_hypotheses,
    views_in_row,
    wrapped,
)
from toonset.view import View

FREE_YAW = np.radians(3.0)  # sigma of a view about the yaw that was measured
LEAST_GAIN = 2.0  # nats, of free yaws over an even ring
P_UNEVEN = 0.05  # that yaws are none of the listed turns
LISTED_APART = 0.01  # over the height: what is farther apart may be another turn than those listed


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
        known: labels, their lock and the yaws of cameras count, the rest needs a mannequin.
        progress: called with the step's name and the share of it that is done.
        cues: of these drawings, if they were looked at before.
        options: what to doubt.
    """
    began = time.perf_counter()
    progress("turns", 0.0)
    cues, known = cues or Cues(views), known.yaws_of_labels
    in_row = views_in_row(views)
    listed = turn_hypotheses(len(views), known.labels, in_row)
    found = _most_likely(cues, known, listed)
    may_be_uneven = len(views) in FREE_VIEWS and not (known.labels and all(known.labels))
    weighed = time.perf_counter()
    progress("cameras", 0.0)
    placed = _placed(cues, known, found)
    sure = (
        view_doubt(found.turns, found.posterior, found.chosen).max() < 1 - options.thresholds.sure
    )
    doubtful = may_be_uneven and (placed.apart > LISTED_APART or not sure)
    if doubtful and cues.free_yaws[1] >= LEAST_GAIN:
        either = listed.joined(_free_turns(cues, known), P_UNEVEN)
        found = _most_likely(cues, known, either)
        found = replace(found, is_free=found.chosen >= len(listed.yaws))
        placed = _placed(cues, known, found)
    found = replace(found, placed=placed)
    seconds = {"turns": weighed - began, "cameras": time.perf_counter() - weighed}
    return replace(judge_found(cues.figures, found, known.labels, options), seconds=seconds)


def _most_likely(cues: Cues, known: Known, turns: TurnHypotheses) -> Found:
    """Return the turns, weighed by the drawings; cameras are not placed yet."""
    views = len(cues.views)
    turns = held(turns, known.asked_yaws(views), known.kept_yaws(views))
    outlines = np.zeros(len(turns.yaws))
    if views > 1:
        outlines = outlines_log_likelihood(cues.figures, turns)
    likelihood = cues.evidence.log_likelihood(turns.yaws, outlines)
    total = turns.log_prior + likelihood
    posterior = np.exp(total - total.max())
    return Found(turns, posterior / posterior.sum(), likelihood, int(total.argmax()))


def _placed(cues: Cues, known: Known, found: Found) -> SheetCameras:
    """Return the cameras of the most probable turn; only measured yaws may move."""
    yaws = found.turns.yaws[found.chosen]
    named = np.min([np.abs(wrapped(yaws - to)) for to in (0.0, np.pi)], axis=0) < 1e-6
    stays = named | np.isfinite(known.kept_yaws(len(yaws))) | (not found.is_free)
    return cues.placed(yaws, np.where(stays, 0.0, FREE_YAW))


def _free_turns(cues: Cues, known: Known) -> TurnHypotheses:
    """Return the turns whose yaws were measured, wherever the front is."""
    relative, _ = cues.free_yaws
    rows = np.arange(3 * STARTS) * 2 * np.pi / (3 * STARTS)
    first = np.full(len(rows), np.log((1 - P_FRONT_FIRST) / (len(rows) - 1)))
    first[0] = np.log(P_FRONT_FIRST)
    free = TurnHypotheses(rows[:, None] + relative, first, np.zeros(len(rows)))
    views, labels = len(cues.views), known.labels
    free = held(free, known.asked_yaws(views), known.kept_yaws(views))  # the others may stay
    return labelled(free, labels) if any(labels) else free
