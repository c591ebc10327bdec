"""Run the steps of calibration: search, selection, camera model, body, alternatives.

What `toonset.calib.find_cameras` does one after the other, each a step from plain data to plain
data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.common_elevation import common_elevation
from toonset.calib.evidence.face import read_faces
from toonset.calib.evidence.texture import read_paint
from toonset.calib.fit.drawing_error import ROUGH_POINTS, WHITE_POINTS
from toonset.calib.fit.landmarks import LandmarkFit, landmark_starts
from toonset.calib.fit.model_selection import (
    BODY_WIDTHS,
    MODELS,
    NEAR_BODY_WIDTHS,
    QUICK_TEST_MARGIN,
    QUICK_TEST_WIDTHS,
    ModelChoice,
    fit_proportions,
    select_model,
)
from toonset.calib.fit.proportions import as_it_is
from toonset.calib.fit.sheet_adjustment import JointFit, JointProblem, SheetModel
from toonset.calib.fit.sheet_prior import Turn
from toonset.calib.fit.tilt import ElevationPrior
from toonset.calib.fit.turned_bodies import account_for_turned_bodies
from toonset.calib.flaws.cropped import ending_at
from toonset.calib.flaws.cropped_evidence import Cuts, possible_cuts, prove_cuts
from toonset.calib.flaws.stretched import Stretches, find_stretches, nothing_stretched
from toonset.calib.known import PAIR_OF_HEIGHT, Known, weighed_by_landmarks
from toonset.calib.options import CalibrationOptions, Progress
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.outline.occluding_contour import Surface, prepare_surface
from toonset.calib.outline.pose import Pose
from toonset.calib.result import CutOff
from toonset.calib.search.alternatives import refine_alternatives
from toonset.calib.search.candidates import (
    Candidates,
    add_twins,
    level_twins,
    looks_alike_from_behind,
    refine,
    turn_half,
)
from toonset.calib.search.selection import RANKING_WIDTHS, TogetherSearch, set_distance
from toonset.calib.search.sheet_posterior import SheetPosterior, possible_turns
from toonset.calib.search.template_cache import load_bank
from toonset.calib.search.templates import Templates, find_hypotheses
from toonset.calib.search.turntable_starts import TurnStart, likely_turns
from toonset.calib.verdict.judge import measure_outlines, typical_coverage
from toonset.camera import Camera, rotation_distance
from toonset.dataset.silhouettes.contour import drawn_contour
from toonset.mesh import Mesh
from toonset.view import View

if TYPE_CHECKING:
    from toonset.calib.fit.landmark_residuals import LandmarkRows

COARSE_POINTS, FINE_POINTS = 160, 200  # of a drawn outline
COARSE_WIDTHS = np.geomspace(0.08, 0.02, 6)
FINE_WIDTHS = np.geomspace(0.015, 0.01, 3)
FREE_WIDTHS = np.geomspace(0.04, 0.01, 8)  # wide at first: what a lock held back may be far
# Typical coverage below which proportions are tried without a quick test (docs/decisions.md)
SAME_BODY_COVERAGE = 0.96
FEWEST_TO_TEST = 3  # two drawings are explained by many bodies
# Yaw's z-scores on synthetic sheets spread 0.9 and 1.4 to 2.9 without them
SIGMA_OF_SAME_BODY, SIGMA_OF_ANOTHER_BODY = 0.9, 1.8


@dataclass(frozen=True, eq=False)
class SheetFit:
    """A fit of the sheet at full resolution.

    Attributes:
        problem: what was fitted.
        joint: the fit.
        model: of the cameras.
        differs: the mannequin is another body than the drawn one, visibly or by a quick test.
    """

    problem: JointProblem
    joint: JointFit
    model: ModelChoice
    differs: bool


@dataclass(frozen=True, eq=False)
class Problem:
    """A sheet on its way from drawings to cameras.

    Attributes:
        views: the drawings.
        surface: the mannequin, as the drawings have its height.
        templates: its outlines from everywhere.
        coarse: the drawings as they are searched with.
        fine: the drawings as they are fitted.
        sheet: the turns they may be of, their faces and paint.
        known: what the user gave.
        marks: what the landmarks of every view say alone; None without.
        options: how hard to look.
        progress: is told the step and the share of it that is done.
    """

    views: Sequence[View]
    surface: Surface
    templates: Templates
    coarse: Sequence[Drawing]
    fine: Sequence[Drawing]
    sheet: SheetPosterior
    known: Known
    marks: Sequence[LandmarkFit | None]
    options: CalibrationOptions
    progress: Progress

    @classmethod
    def of(
        cls,
        views: Sequence[View],
        mesh: Mesh,
        options: CalibrationOptions,
        progress: Progress,
        known: Known,
    ) -> Problem:
        """Return the problem before anything is searched; see `calibrate` for the arguments."""
        surface = prepare_surface(mesh)
        contours = [drawn_contour(view) for view in views]
        views = [replace(v, ends=c.ends) for v, c in zip(views, contours, strict=True)]
        turns = possible_turns(len(views), known.labels)
        return cls(
            views,
            surface,
            load_bank(surface),
            [Drawing(c, options.coarse_height_px, COARSE_POINTS) for c in contours],
            [Drawing(c, options.fine_height_px, FINE_POINTS) for c in contours],
            SheetPosterior(
                turns, read_faces(views), read_paint(views), known.asked_yaws(len(views))
            ),
            known,
            landmark_starts(known.landmarks or (None,) * len(views), surface),
            options,
            progress,
        )

    def search(self) -> tuple[list[Candidates], list[TurnStart]]:
        """Return every view's candidates, and the turns that explain the whole sheet."""
        given = self.known.start_poses(self.surface.middle) or self._marked()
        if given:
            return [
                refine(drawing, self.surface, [pose], FINE_WIDTHS)
                for drawing, pose in zip(self.coarse, given, strict=True)
            ], [TurnStart(given, 0.0)]
        together = likely_turns(self.views, self.templates, self.sheet.turns)
        candidates = []
        for i, view in enumerate(self.views):
            self.progress("search", i / len(self.views))
            found = find_hypotheses(view, self.templates, self.options.starts)
            starts = [h.pose for h in found]
            starts = [*starts, starts[0].twin(), *(turn.poses[i] for turn in together)]
            own = self.marks[i]
            starts += set_distance(own.poses, 0.0) if own else []
            placed = self.known.placed[i] if self.known.placed else None
            starts += [placed] if placed else []
            reached = refine(self.coarse[i], self.surface, starts, COARSE_WIDTHS)
            candidates.append(self._informed(reached, i))
        return candidates, together

    def _marked(self) -> tuple[Pose, ...]:
        """Return the cameras of the landmarks where all views have some that leave no doubt."""
        limits = self.options.thresholds
        sure = [
            fit
            for fit, drawing in zip(self.marks, self.coarse, strict=True)
            if fit and not fit.doubt(drawing.height / drawing.factor, limits)
        ]
        return tuple(fit.poses[0] for fit in sure) if len(sure) == len(self.views) else ()

    def _landmark_rows(self, drawings: Sequence[Drawing]) -> LandmarkRows | None:
        """Return the landmarks in the drawings' working pixels."""
        if not self.known.landmarks:
            return None
        from toonset.calib.fit.landmark_residuals import LandmarkRows, Pairs  # torch

        own, sigmas = [], []
        for landmarks, fit, drawing in zip(self.known.landmarks, self.marks, drawings, strict=True):
            if landmarks is None:
                own.append((np.zeros((0, 3)), np.zeros((0, 2))))
            else:
                pixels = landmarks.pixels * drawing.factor - drawing.offset
                own.append((landmarks.world - self.surface.middle, pixels))
            sigmas.append(fit.sigma_px * drawing.factor if fit else PAIR_OF_HEIGHT * drawing.height)
        return LandmarkRows(Pairs.of(own), np.array(sigmas))

    def together(
        self, candidates: list[Candidates], starts: list[TurnStart]
    ) -> tuple[JointFit, Turn, list[Candidates]]:
        """Return the best selection of candidates as a joint fit, its turn, the candidates."""
        body = as_it_is(self.surface)
        if self.known.cameras:
            turn = self.sheet.weigh([starts[0].poses])[1][0]
            model = SheetModel("given")
            fit = JointProblem(self.coarse, turn).fit(
                body, starts[0].poses, RANKING_WIDTHS[-1:], model
            )
            return replace(fit, poses=starts[0].poses), turn, candidates
        rows = self._landmark_rows(self.coarse)
        search = TogetherSearch(self.coarse, body, self.sheet, self._informed, rows)
        return search.run(candidates, starts, self.options.rounds)

    def rigid(self, coarse_fit: JointFit, turn: Turn, *, differs: bool | None = None) -> SheetFit:
        """Return the fit at full resolution, the mannequin as it is.

        Args:
            coarse_fit: where to begin.
            turn: where the views are meant to be seen from.
            differs: the mannequin is another body; None: if the outlines visibly do not meet.
        """
        if differs is None:
            differs = typical_coverage(self.fine, coarse_fit) < SAME_BODY_COVERAGE
        samples = ROUGH_POINTS if differs else WHITE_POINTS
        locks, rows = self.known.locks(self.surface.middle), self._landmark_rows(self.fine)
        problem = JointProblem(self.fine, turn, locks, samples, rows)
        keep_fov = "fov" in self.known.locked
        starts = self.known.at_locks(coarse_fit.poses, self.surface.middle)
        joint, model = select_model(
            problem, coarse_fit.body, starts, doubtful=differs, keep_fov=keep_fov
        )
        return SheetFit(problem, joint, model, differs)

    def bent(self, rigid: SheetFit, turn: Turn) -> SheetFit:
        """Return the fit with the mannequin bent, if that is proven, its sigmas made true."""
        fit, widths = rigid, BODY_WIDTHS
        if not rigid.differs and len(self.views) >= FEWEST_TO_TEST:
            _, model = fit_proportions(
                rigid.problem, rigid.joint, rigid.model, QUICK_TEST_WIDTHS, QUICK_TEST_MARGIN
            )
            if model.bends_mannequin:
                fit, widths = self.rigid(rigid.joint, turn, differs=True), NEAR_BODY_WIDTHS
            else:
                fit = replace(rigid, model=model)
        joint, model = fit.joint, fit.model
        if fit.differs:
            joint, model = fit_proportions(self._level(fit.problem, joint), joint, model, widths)
        factor = SIGMA_OF_ANOTHER_BODY if fit.differs else SIGMA_OF_SAME_BODY
        joint = replace(joint, covariance=factor**2 * joint.covariance)
        if not fit.differs and not self.known.locked - {"fov"}:
            joint = account_for_turned_bodies(joint, turn, self.known.kept)
        return replace(fit, joint=joint, model=model)

    def cut_off(self, whole: SheetFit, turn: Turn) -> tuple[Problem, SheetFit, tuple[CutOff, ...]]:
        """Return the problem with cuts taken for no outline, its fit, and which those are.

        Args:
            whole: the fit that takes every figure for whole.
            turn: where the views are meant to be seen from.
        """
        costs = self._costs(whole)
        known, possible = possible_cuts(self.views, whole.joint, costs)
        ended, fitted = self, whole
        if possible:
            ended = self._ending_at(possible)
            fitted = ended.rigid(whole.joint, turn)
            both, differs = (costs, ended._costs(fitted)), whole.differs
            proven = prove_cuts(self.views, possible, fitted.joint, both, differs=differs)
            if not proven:
                ended, fitted = self, whole
            elif len(proven) < len(possible):
                ended = self._ending_at(proven)
                fitted = ended.rigid(whole.joint, turn)
            known += proven
        return ended, fitted, tuple(cut for _, cut in known)

    def stretches(self, fitted: SheetFit, cuts: Sequence[CutOff]) -> Stretches:
        """Return how drawings and mannequin are stretched.

        Not looked for where somebody has placed cameras, nor where feet are missing.
        """
        if self.known.cameras or self.known.landmarks or cuts:
            return nothing_stretched(len(self.views))
        problem, name = fitted.problem, fitted.model.model
        return find_stretches(problem, fitted.joint, name, doubtful=fitted.differs)

    def _costs(self, fitted: SheetFit) -> list[float]:
        return [fit.cost for fit in measure_outlines(self.fine, fitted.joint)]

    def _ending_at(self, cuts: Cuts) -> Problem:
        views, fine = list(self.views), list(self.fine)
        for i, cut in cuts:
            views[i] = ending_at(views[i], cut.flat)
            contour = drawn_contour(views[i])
            fine[i] = Drawing(contour, self.options.fine_height_px, FINE_POINTS)
        return replace(self, views=views, fine=fine)

    def cameras(self, joint: JointFit) -> list[Camera]:
        """Return the joint fit's cameras in pixels of the views."""
        return [
            pose.camera(self.surface.middle, (view.rgba.shape[1], view.rgba.shape[0]))
            for view, pose in zip(self.views, joint.poses, strict=True)
        ]

    def alternatives(
        self,
        drawings: Sequence[Drawing],
        joint: JointFit,
        model: ModelChoice,
        candidates: Sequence[Candidates],
        *,
        differs: bool,
    ) -> list[Candidates]:
        """Return every view's alternatives, refined to `drawings`, those of full resolution."""
        bent = joint.body.surface
        from_behind = looks_alike_from_behind(bent, joint.poses)
        found = []
        for i, (pose, view) in enumerate(zip(joint.poses, candidates, strict=True)):
            starts = _alternative_starts(pose, view) + add_twins([turn_half(pose)]) * from_behind
            final = refine(drawings[i], bent, starts, FINE_WIDTHS)
            final = refine_alternatives(drawings[i], joint, i, final)
            seen = pose if model.is_perspective else replace(pose, k=0.0)
            final = level_twins(final, bent, seen, always=differs, from_behind=from_behind)
            found.append(self._informed(final, i))
        return found

    def _informed(self, view: Candidates, index: int) -> Candidates:
        if not self.known.landmarks:
            return view
        height = self.coarse[index].height / self.coarse[index].factor
        landmarks = self.known.landmarks[index]
        return weighed_by_landmarks(view, landmarks, self.surface.middle, height)

    def pulled(
        self, joint: JointFit, model: ModelChoice, turn: Turn
    ) -> Float[np.ndarray, " views"] | None:
        """Return how far every view would turn without the locks, radians; None: there are none."""
        if not self.known.holds:
            return None
        problem = JointProblem(self.fine, turn, landmarks=self._landmark_rows(self.fine))
        free = problem.fit(
            joint.body, joint.poses, FREE_WIDTHS, MODELS[model.model], offset=joint.offset
        )
        return np.array(
            [
                rotation_distance(p.rotation, q.rotation)
                for p, q in zip(joint.poses, free.poses, strict=True)
            ]
        )

    def _level(self, problem: JointProblem, joint: JointFit) -> JointProblem:
        """Return the problem with the mean elevation that the drawings agree on best."""
        if (
            len(self.views) < self.options.thresholds.telling_views
            or "elevation" in self.known.locked
        ):
            return problem
        cameras = self.cameras(joint)
        found = common_elevation(self.views, cameras)
        if not np.isfinite(found.sigma):
            return problem
        mean = float(np.mean([camera.angles[1] for camera in cameras]))
        return problem.with_elevation(ElevationPrior(mean + found.offset, found.sigma))


def _alternative_starts(pose: Pose, candidates: Candidates) -> list[Pose]:
    """Return the chosen pose, its twin and the best candidates, all with the chosen k."""
    return set_distance(add_twins([pose]) + [fit.pose for fit in candidates.fits[:4]], pose.k)
