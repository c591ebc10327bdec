"""Compare a mannequin with no body at all by how well their cameras explain the drawings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toonset.calib.known import Known
from toonset.calib.options import CalibrationOptions, Progress
from toonset.calib.result import Calibration
from toonset.calib.without_body.cues import Cues
from toonset.calib.without_body.find import calibrate_without_body
from toonset.calib.without_body.placing import coherence_log_likelihood
from toonset.calib.without_body.posterior import ROUGH
from toonset.calib.without_body.turns import NEAR, STARTS, turn_hypotheses, wrapped
from toonset.view import View

FEWEST = 2  # views: one says nothing by itself
P_ELSEWHERE = 0.05  # that a sheet is not a turn that artists lay out
REFUSED = "the mannequin is another body; cameras come from the drawings"
ASK_ALONE = "without the mannequin every view is certain; try --mesh none"


def tells_directions(views: Sequence[View], known: Known) -> bool:
    """Return whether cameras may come from the drawings alone.

    Two drawings say too little; landmarks, cameras and what they lock belong to the mannequin.
    """
    of_mannequin = known.landmarks or known.cameras or known.locked - {"yaw"}
    return len(views) >= FEWEST and not of_mannequin


def with_body_or_without(
    views: Sequence[View],
    found: Calibration,
    known: Known,
    *,
    given: bool,
    tell: Progress,
    cues: Cues | None = None,
    options: CalibrationOptions = CalibrationOptions(),
    alone: Calibration | None = None,
) -> tuple[Calibration, bool]:
    """Return the calibration that explains the drawings better, and whether it has no body.

    A body that explains nothing loses to drawings that cohere, the default one also to drawings
    with milder verdicts; else paint, faces, detail, outlines and layout decide. A mannequin that
    somebody gave loses where the drawings alone are right with the probability `thresholds.sure`;
    one that stays though every view is certain without it says so. Nothing is tried where the
    mannequin's cameras are certain, or, where somebody put it on a view, not failed; nor where
    landmarks, cameras or locks of the whole sheet belong to it.

    Args:
        views: the drawings.
        found: with the mannequin.
        known: beforehand.
        given: somebody chose the mannequin.
        tell: called with the step's name and the share of it that is done.
        cues: of these drawings, if they were looked at before.
        options: what to doubt.
        alone: the calibration without a body, if it is known.
    """
    fine = found.verdict != "failed" if any(known.placed) else found.is_certain
    if fine or not tells_directions(views, known):
        return found, False
    cues = cues or Cues(views)
    alone = alone or calibrate_without_body(views, known, tell, cues, options)
    if found.verdict == "failed":
        worse = alone.verdict == "failed"
    elif not given and alone.doubtfulness < found.doubtfulness:
        worse = False
    else:
        from scipy.special import logit

        least = logit(options.thresholds.sure) if given else 0.0
        worse = _odds(cues, alone, found, known) <= least
    if worse:
        return _because(found, ASK_ALONE) if given and alone.is_certain else found, False
    return _because(alone, REFUSED) if given else alone, True


def _because(found: Calibration, why: str) -> Calibration:
    """Return a calibration with a reason before its own."""
    return replace(found, reason=f"{why}; {found.reason}" if found.reason else why)


def _odds(cues: Cues, one: Calibration, other: Calibration, known: Known) -> float:
    """Return by how many nats the first calibration's cameras are the likelier ones."""
    views = len(cues.views)
    turns = turn_hypotheses(views, known.labels)
    cameras = [[view.camera for view in found.views] for found in (one, other)]
    yaws = np.array([[camera.angles[0] for camera in own] for own in cameras])
    apart = np.array([cues.figures.contradiction(own) for own in cameras])
    outlines = coherence_log_likelihood(apart, views, ROUGH)
    elsewhere = np.log(P_ELSEWHERE) - views * np.log(STARTS)
    prior = []
    for own in yaws:
        near = (np.abs(wrapped(turns.yaws - own)) <= NEAR).all(axis=1)
        prior.append(np.logaddexp.reduce(np.append(turns.log_prior[near], elsewhere)))
    total = np.array(prior) + cues.evidence.log_likelihood(yaws, outlines)
    return float(total[0] - total[1])
