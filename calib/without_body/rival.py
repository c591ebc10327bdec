"""Compare a mannequin with no body at all by how well their cameras explain the drawings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

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


def tells_directions(views: Sequence[View], known: Known) -> bool:
    """Return whether cameras may come from the drawings alone.

    Two drawings say too little; landmarks, cameras and what they lock belong to the mannequin.
    """
    of_mannequin = known.landmarks or known.cameras or known.locked - {"yaw"}
    return len(views) >= FEWEST and not of_mannequin


def without_body_if_better(
    views: Sequence[View],
    found: Calibration,
    known: Known,
    *,
    given: bool,
    tell: Progress,
    cues: Cues | None = None,
    options: CalibrationOptions = CalibrationOptions(),
    alone: Calibration | None = None,
) -> Calibration | None:
    """Return the calibration without a body if it explains the drawings better, else None.

    A body that explains nothing loses to drawings that cohere; else paint, faces, detail, outlines
    and layout decide. Nothing is tried where the mannequin's cameras are certain, or, where
    somebody gave it or put it on a view, not failed; nor where landmarks, cameras or locks of the
    whole sheet belong to it.

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
    fine = found.verdict != "failed" if given or any(known.placed) else found.is_certain
    if fine or not tells_directions(views, known):
        return None
    cues = cues or Cues(views)
    alone = alone or calibrate_without_body(views, known, tell, cues, options)
    explains = found.verdict != "failed"
    worse = _odds(cues, alone, found, known) <= 0 if explains else alone.verdict == "failed"
    if worse:
        return None
    if not given:
        return alone
    return replace(alone, reason=f"{REFUSED}; {alone.reason}" if alone.reason else REFUSED)


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
        prior.append(logsumexp(np.append(turns.log_prior[near], elsewhere)))
    total = np.array(prior) + cues.evidence.log_likelihood(yaws, outlines)
    return float(total[0] - total[1])
