"""Find a sheet's cameras: template search, contour alignment, joint adjustment, model selection.

1. templates: silhouettes of the mesh over yaw and elevation; the best overlaps start each view, and
   the turns (or labels) that explain the whole sheet start all views
2. contour alignment of every start at low resolution
3. selections of one candidate per view, compared by a joint fit of the sheet
4. the camera model, from orthography up; drawings that are stretched are begun anew without it
   (`toonset.calib.flaws.stretched`); the mannequin's proportions where outlines
   do not meet or a quick test proves them
5. alternatives of the chosen cameras at full resolution: probabilities, uncertainties, verdicts
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from toonset.calib.evidence.coherence_state import state_of
from toonset.calib.fit.model_selection import ModelTest
from toonset.calib.fit.sheet_prior import Turn, off_places
from toonset.calib.flaws.stretched import as_drawn, nothing_stretched, stretch_mannequin, unstretch
from toonset.calib.known import Known
from toonset.calib.options import CalibrationOptions, Progress
from toonset.calib.pipeline import Problem, SheetFit
from toonset.calib.result import Calibration, CutOff
from toonset.calib.search.candidates import Candidates
from toonset.calib.search.templates import turns_visibly
from toonset.calib.verdict.checks import JudgedSheet, apply_checks
from toonset.calib.verdict.judge import judge_sheet, judge_view
from toonset.mesh import Mesh
from toonset.view import View

# Times that stretches are taken off: the first look at strong ones may miss a view
MOST_UNSTRETCHED = 2


def find_cameras(
    views: Sequence[View],
    mesh: Mesh,
    options: CalibrationOptions = CalibrationOptions(),
    progress: Progress = lambda step, share: None,
    known: Known | None = None,
) -> Calibration:
    """Return one camera per view with its uncertainty.

    Args:
        views: the drawings, at least one.
        mesh: the posed mannequin; world frame and units are its own.
        options: search effort.
        progress: called with the step's name and the share done.
        known: what a person knows beforehand.

    Raises:
        CameraError, LandmarkError: what is known does not belong to the views or the mannequin.
    """
    known = known or Known()
    known.check(views)
    seconds: dict[str, float] = {}
    stretches, taken = nothing_stretched(len(views)), list(views)
    fitted = _fitted(taken, mesh, options, progress, known, seconds)
    for _ in range(MOST_UNSTRETCHED):
        with _timed(seconds, "joint"):
            more = fitted.problem.stretches(fitted.rigid, fitted.cuts)
        stretches = stretches.and_then(more)
        if more.is_none:
            break
        taken = [unstretch(*pair) for pair in zip(views, stretches.views, strict=True)]
        mannequin = stretch_mannequin(mesh, stretches)
        fitted = _fitted(taken, mannequin, options, progress, known, seconds)
    found = _judged(fitted, stretches.tried, seconds)
    return as_drawn(found, taken, views)


@dataclass(frozen=True, eq=False)
class _Fitted:
    """A sheet whose cameras are found, before they are judged.

    Attributes:
        problem: with drawings that end at their cuts.
        candidates: what else every view could be.
        turn: where the views are meant to be seen from.
        rigid: the fit with the mannequin as it is.
        cuts: parts of figures that their pictures lack.
        mesh: the mannequin.
    """

    problem: Problem
    candidates: Sequence[Candidates]
    turn: Turn
    rigid: SheetFit
    cuts: tuple[CutOff, ...]
    mesh: Mesh


def _fitted(
    views: Sequence[View],
    mesh: Mesh,
    options: CalibrationOptions,
    progress: Progress,
    known: Known,
    seconds: dict[str, float],
) -> _Fitted:
    with _timed(seconds, "prepare"):
        problem = Problem.of(views, mesh, options, progress, known)
    with _timed(seconds, "search"):
        candidates, together = problem.search()
    with _timed(seconds, "together"):
        progress("together", 0.0)
        coarse_fit, turn, candidates = problem.together(candidates, together)
    with _timed(seconds, "joint"):
        progress("joint", 0.0)
        whole = problem.rigid(coarse_fit, turn)
        problem, rigid, cuts = problem.cut_off(whole, turn)
    return _Fitted(problem, candidates, turn, rigid, cuts, mesh)


def _judged(fitted: _Fitted, tried: Sequence[ModelTest], seconds: dict[str, float]) -> Calibration:
    """Return the calibration; `tried` are what has been said about stretches."""
    problem = fitted.problem
    with _timed(seconds, "joint"):
        bent = problem.bent(fitted.rigid, fitted.turn)
        joint = bent.joint
        model = replace(bent.model, tried=(*tried, *bent.model.tried))
    with _timed(seconds, "judge"):
        problem.progress("judge", 0.0)
        sheet = _judged_one_by_one(fitted, bent)
        views = apply_checks(sheet, without=problem.options.without)
    verdict, reason = judge_sheet(views, sheet.state)
    return Calibration(
        views,
        model,
        joint.offset,
        joint.noise,
        sheet.state.contradiction,
        joint.body.surface.vertices + problem.surface.middle,
        verdict,
        reason,
        seconds,
        fitted.cuts,
        landmarks=tuple(fit for fit in problem.marks if fit),
    )


def _judged_one_by_one(fitted: _Fitted, bent: SheetFit) -> JudgedSheet:
    problem, joint, model, differs = fitted.problem, bent.joint, bent.model, bent.differs
    observable = turns_visibly(problem.templates)
    limits = problem.options.thresholds
    state = state_of(problem.views, problem.cameras(joint), limits, yaw_observable=observable)
    inset = [drawing.inset(joint.offset) for drawing in problem.fine]
    final = problem.alternatives(inset, joint, model, fitted.candidates, differs=differs)
    poses = [
        [(float(p), fit.pose) for p, fit in zip(own, view.fits, strict=True)]
        for own, view in zip(problem.sheet.probabilities(final), final, strict=True)
    ]
    labels = problem.known.labels  # of every view they are no even steps
    even = np.isfinite(fitted.turn.places).all() and not (labels and all(labels))
    return JudgedSheet(
        tuple(
            judge_view(v, inset[i], joint, i, poses[i], state, differs=differs)
            for i, v in enumerate(problem.views)
        ),
        problem.views,
        state,
        labels,
        off_places(joint.poses, fitted.turn) if differs and even else None,
        problem.pulled(joint, model, fitted.turn),
        problem.sheet.faces_contradict(final),
        model.bends_mannequin,
        replace(fitted.mesh, vertices=joint.body.surface.vertices + problem.surface.middle),
    )


@contextmanager
def _timed(seconds: dict[str, float], step: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[step] = seconds.get(step, 0.0) + time.perf_counter() - start
