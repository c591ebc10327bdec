"""Views and a mannequin to cameras: coarse hypotheses, contour alignment, the sheet together.

1. templates: silhouettes of the mesh over yaw and elevation; the best overlaps start each view, and
   the turns (or labels) that explain the whole sheet start all views
2. contour alignment of every start at low resolution
3. selections of one candidate per view, compared by a joint fit of the sheet
4. the camera model, from orthography up, and the mannequin's proportions where they are asked for
5. rivals of the chosen cameras at full resolution: probabilities, uncertainties, verdicts
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from toonset.calib.align import ElevationPrior, measure, tilt
from toonset.calib.bank import load_bank
from toonset.calib.common_elevation import common_elevation
from toonset.calib.contour import drawn_contour
from toonset.calib.cut_off import (
    CutOff,
    FlatSide,
    beyond_px,
    ending_at,
    flat_sides,
    overhang_px,
)
from toonset.calib.drawing_error import ROUGH_POINTS, WHITE_POINTS
from toonset.calib.face import read_faces
from toonset.calib.hypotheses import (
    Candidates,
    half_turned,
    level_twins,
    looks_alike_from_behind,
    refine,
    with_twins,
)
from toonset.calib.joint import JointFit, JointProblem, SheetModel
from toonset.calib.judge import (
    judge_sheet,
    judge_view,
    typical_coverage,
    with_elevations_in_mind,
    with_labels_in_mind,
    with_locks_in_mind,
    with_sheet_in_mind,
)
from toonset.calib.known import Known, weighed_by_landmarks
from toonset.calib.ladder import MODELS, ModelChoice, climb, with_proportions
from toonset.calib.landmarks import landmark_starts
from toonset.calib.match import Drawing
from toonset.calib.paint import read_paint
from toonset.calib.pose import Pose
from toonset.calib.proportions import as_it_is
from toonset.calib.result import Calibration
from toonset.calib.rim import Surface, prepare_surface
from toonset.calib.shared import Sheet, possible_turns
from toonset.calib.sheet_state import TELLING_VIEWS, state_of
from toonset.calib.templates import Templates, find_hypotheses, turns_visibly
from toonset.calib.ties import Turn
from toonset.calib.together import SKETCHED, TogetherSearch, with_k
from toonset.calib.turns import TurnStart, likely_turns
from toonset.camera import Camera, rotation_distance
from toonset.mesh import Mesh
from toonset.view import View

if TYPE_CHECKING:
    from collections.abc import Iterator

Progress = Callable[[str, float], None]  # step, share done


@dataclass(frozen=True)
class CalibrationOptions:
    """How hard to look.

    Attributes:
        starts: coarse hypotheses per view; 6 reach the optimum of clean views always.
        coarse_height_px: figure height while searching; 100 px see limbs, cost little.
        fine_height_px: figure height of the final fit.
        rounds: joint fits at most, when views change their candidate.
    """

    starts: int = 6
    coarse_height_px: float = 100.0
    fine_height_px: float = 250.0
    rounds: int = 3


COARSE_POINTS, FINE_POINTS = 160, 200  # of a drawn outline
COARSE_WIDTHS = np.geomspace(0.08, 0.02, 6)
FINE_WIDTHS = np.geomspace(0.015, 0.01, 3)
FREE_WIDTHS = np.geomspace(0.04, 0.01, 8)  # wide at first: what a lock held back may be far
# Typical coverage below which the mannequin may be another body, whose proportions are then tried.
# Right bodies with 1.2 % drawing error have 0.98 and more. On 144 synthetic sheets with another
# body's mannequin rotations are 9.6 degrees off (p95), with 0.93 they were 13.7
SAME_BODY_COVERAGE = 0.96
LEAST_LOST_PX = 1.5  # less is a sole that lies between two pixels
MET = 0.005**2  # cost under which a figure at the picture's edge is whole
FARTHER = 2.0  # times what it does elsewhere the mannequin goes on beyond a cut
SAME_SCALE = 0.02  # views of a sheet differ by 1 % (`ties.Spreads`)
CUT_EXPLAINS = 0.5  # of the cost, for a figure at the picture's edge to be cut
# Yaw's z-scores on synthetic sheets spread 0.9 and 1.4 to 2.9 without them
SIGMA_OF_SAME_BODY, SIGMA_OF_ANOTHER_BODY = 0.9, 1.8


def calibrate(
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
    with _timed(seconds, "prepare"):
        surface = prepare_surface(mesh)
        templates = load_bank(surface)
        contours = [drawn_contour(view) for view in views]
        views = [replace(v, ends=c.ends) for v, c in zip(views, contours, strict=True)]
        coarse = [Drawing(c, options.coarse_height_px, COARSE_POINTS) for c in contours]
        fine = [Drawing(c, options.fine_height_px, FINE_POINTS) for c in contours]
        sheet = Sheet(
            possible_turns(len(views), known.labels), read_faces(views), read_paint(views)
        )
        problem = _Problem(views, surface, templates, coarse, fine, sheet, known, options, progress)
    with _timed(seconds, "search"):
        candidates, together = problem.search()
    with _timed(seconds, "together"):
        progress("together", 0.0)
        joint, turn, candidates = problem.together(candidates, together)
    with _timed(seconds, "joint"):
        progress("joint", 0.0)
        rigid = problem.rigid(joint, turn)
        ended, cuts = problem.cut_off(rigid, turn)
        if ended is not problem:
            problem, rigid = ended, ended.rigid(rigid.joint, turn)
        joint, model = problem.bent(rigid)
    with _timed(seconds, "judge"):
        progress("judge", 0.0)
        cameras = problem.cameras(joint)
        state = state_of(problem.views, cameras, yaw_observable=turns_visibly(templates))
        bare = [drawing.inset(joint.offset) for drawing in problem.fine]
        final = problem.rivals(bare, joint, model, candidates, differs=rigid.differs)
        sure = sheet.probabilities(final)
        body, differs = joint.body.surface, rigid.differs
        each = [
            judge_view(v, bare[i], body, joint, i, final[i], sure[i], state, differs=differs)
            for i, v in enumerate(views)
        ]
        each = with_labels_in_mind(with_elevations_in_mind(each), known.labels)
        each = with_locks_in_mind(each, problem.pulled(joint, model, turn))
        contradict = sheet.faces_contradict(final)
        judged = with_sheet_in_mind(each, state, contradict, bent=model.bends_mannequin)
    verdict, reason = judge_sheet(judged, state)
    return Calibration(
        judged,
        model,
        joint.offset,
        joint.noise,
        state.contradiction,
        joint.body.surface.vertices + surface.middle,
        verdict,
        reason,
        seconds,
        cuts,
    )


@dataclass(frozen=True, eq=False)
class _Rigid:
    """The sheet fitted with the mannequin as it is.

    Attributes:
        problem: what was fitted.
        joint: the fit.
        model: of the cameras.
        differs: the mannequin is another body than the drawn one.
    """

    problem: JointProblem
    joint: JointFit
    model: ModelChoice
    differs: bool


@dataclass(frozen=True, eq=False)
class _Problem:
    """A sheet on its way from drawings to cameras."""

    views: Sequence[View]
    surface: Surface
    templates: Templates
    coarse: Sequence[Drawing]
    fine: Sequence[Drawing]
    sheet: Sheet
    known: Known
    options: CalibrationOptions
    progress: Progress

    def search(self) -> tuple[list[Candidates], list[TurnStart]]:
        """Return every view's candidates, and the turns that explain the whole sheet."""
        given = self.known.start_poses(self.surface.middle)
        if given:
            return [
                refine(drawing, self.surface, [pose], FINE_WIDTHS)
                for drawing, pose in zip(self.coarse, given, strict=True)
            ], [TurnStart(given, 0.0)]
        marked = landmark_starts(self.known.landmarks, self.surface)
        together = likely_turns(self.views, self.templates, self.sheet.turns)
        candidates = []
        for i, view in enumerate(self.views):
            self.progress("search", i / len(self.views))
            found = find_hypotheses(view, self.templates, self.options.starts)
            starts = [h.pose for h in found]
            starts = [*starts, starts[0].twin(), *(turn.poses[i] for turn in together)]
            own = marked[i] if marked else None
            starts += with_k(own.poses, 0.0) if own else []
            reached = refine(self.coarse[i], self.surface, starts, COARSE_WIDTHS)
            candidates.append(self._informed(reached, i))
        return candidates, together

    def together(
        self, candidates: list[Candidates], starts: list[TurnStart]
    ) -> tuple[JointFit, Turn, list[Candidates]]:
        """Return the best selection of candidates as a joint fit, its turn, the candidates."""
        body = as_it_is(self.surface)
        if self.known.cameras:
            turn = self.sheet.weigh([starts[0].poses])[1][0]
            model = SheetModel("given")
            fit = JointProblem(self.coarse, turn).fit(body, starts[0].poses, SKETCHED[-1:], model)
            return replace(fit, poses=starts[0].poses), turn, candidates
        search = TogetherSearch(self.coarse, body, self.sheet, self._informed)
        return search.run(candidates, starts, self.options.rounds)

    def rigid(self, sketch: JointFit, turn: Turn) -> _Rigid:
        """Return the fit at full resolution, the mannequin as it is."""
        differs = typical_coverage(self.fine, sketch) < SAME_BODY_COVERAGE
        samples = ROUGH_POINTS if differs else WHITE_POINTS
        problem = JointProblem(self.fine, turn, self._kept(), samples)
        keep_fov = "fov" in self.known.locked
        starts = self.known.at_locked_yaws(sketch.poses, self.surface.middle)
        joint, model = climb(problem, sketch.body, starts, doubtful=differs, keep_fov=keep_fov)
        return _Rigid(problem, joint, model, differs)

    def bent(self, rigid: _Rigid) -> tuple[JointFit, ModelChoice]:
        """Return the fit, the mannequin bent where it is another body, and its model."""
        joint, model = rigid.joint, rigid.model
        if rigid.differs:
            joint, model = with_proportions(self._level(rigid.problem, joint), joint, model)
        factor = SIGMA_OF_ANOTHER_BODY if rigid.differs else SIGMA_OF_SAME_BODY
        return replace(joint, covariance=factor**2 * joint.covariance), model

    def cut_off(self, whole: _Rigid, turn: Turn) -> tuple[_Problem, tuple[CutOff, ...]]:
        """Return the problem with cuts taken for no outline, and which those are.

        At the picture's edge a cut must explain the outline far better. Within the picture, where
        a ruled line is seen, the mannequin must be the character: another body's legs are longer.

        Args:
            whole: the fit that takes every figure for whole.
            turn: where the views are meant to be seen from.
        """
        sides = [(i, flat) for i, view in enumerate(self.views) for flat in flat_sides(view)]
        costs = self._costs(whole.joint)
        seen, maybe = [], []
        for i, cut in self._cuts(sides, whole.joint):
            if cut.flat.is_end_of(self.views[i]):
                seen += [cut] if cut.lost_px >= LEAST_LOST_PX else []
            elif costs[i] > MET if cut.flat.at_edge else cut.lost_px >= LEAST_LOST_PX / 2:
                maybe.append((i, cut.flat))
        if not maybe:
            return self, tuple(seen)
        ended = self._ending_at(maybe)
        tried = ended.rigid(whole.joint, turn).joint
        explained = ended._costs(tried)
        error = tried.noise.smooth * np.array([view.figure_box[3] for view in self.views])
        cuts = []
        for i, cut in self._cuts(maybe, tried):
            if cut.flat.at_edge:
                proven = explained[i] < CUT_EXPLAINS * costs[i]
            else:
                proven = not whole.differs and self._stands_out(i, cut, maybe, tried)
            if proven and cut.lost_px >= max(LEAST_LOST_PX, error[i]):
                cuts.append((i, cut))
        if not cuts:
            return self, tuple(seen)
        return self._ending_at([(i, cut.flat) for i, cut in cuts]), (*seen, *(c for _, c in cuts))

    def _stands_out(
        self, index: int, cut: CutOff, maybe: Sequence[tuple[int, FlatSide]], joint: JointFit
    ) -> bool:
        """Return whether views that nothing cuts there agree with what a view's cut says.

        Longer legs than the character's reach below all feet, or make the views that end in a
        ruled line larger than the others; where all end so, on a ground line, nothing tells.
        """
        flat = {i for i, other in maybe if other.side == cut.flat.side}
        whole = [i for i in range(len(self.views)) if i not in flat]
        if not whole:
            return False
        surface, poses = joint.body.surface, joint.poses
        usual = np.median(
            [overhang_px(cut.flat.side, surface, poses[i], self.views[i]) for i in whole]
        )
        larger = poses[index].scale / np.median([poses[i].scale for i in whole]) - 1
        return bool(
            abs(larger) < SAME_SCALE and cut.lost_px >= LEAST_LOST_PX + FARTHER * max(0.0, usual)
        )

    def _costs(self, joint: JointFit) -> list[float]:
        return [
            measure(drawing, joint.body.surface, drawing.pose_in(pose)).cost
            for drawing, pose in zip(self.fine, joint.poses, strict=True)
        ]

    def _cuts(
        self, sides: Sequence[tuple[int, FlatSide]], joint: JointFit
    ) -> list[tuple[int, CutOff]]:
        """Return how far the mannequin goes on beyond sides of views."""

        def lost_px(i: int, flat: FlatSide) -> float:
            return beyond_px(flat, joint.body.surface, joint.poses[i], self.views[i])

        return [(i, CutOff(self.views[i].name, flat, lost_px(i, flat))) for i, flat in sides]

    def _ending_at(self, sides: Sequence[tuple[int, FlatSide]]) -> _Problem:
        views, fine = list(self.views), list(self.fine)
        for i, flat in sides:
            views[i] = ending_at(views[i], flat)
            contour = drawn_contour(views[i])
            fine[i] = Drawing(contour, self.options.fine_height_px, FINE_POINTS)
        return replace(self, views=views, fine=fine)

    def cameras(self, joint: JointFit) -> list[Camera]:
        """Return the joint fit's cameras in pixels of the views."""
        return [
            pose.camera(self.surface.middle, (view.rgba.shape[1], view.rgba.shape[0]))
            for view, pose in zip(self.views, joint.poses, strict=True)
        ]

    def rivals(
        self,
        drawings: Sequence[Drawing],
        joint: JointFit,
        model: ModelChoice,
        candidates: Sequence[Candidates],
        *,
        differs: bool,
    ) -> list[Candidates]:
        """Return what else every view could be, refined to `drawings`, those of full resolution."""
        bent = joint.body.surface
        from_behind = looks_alike_from_behind(bent, joint.poses)
        found = []
        for i, (pose, view) in enumerate(zip(joint.poses, candidates, strict=True)):
            starts = _rivals(pose, view) + with_twins([half_turned(pose)]) * from_behind
            final = refine(drawings[i], bent, starts, FINE_WIDTHS)
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
    ) -> Float[np.ndarray, " views"]:
        """Return how far every view would turn without the locks, radians."""
        if not self.known.locked - {"fov"}:
            return np.zeros(len(joint.poses))
        problem = JointProblem(self.fine, turn)
        free = problem.fit(
            joint.body, joint.poses, FREE_WIDTHS, MODELS[model.model], offset=joint.offset
        )
        return np.array(
            [
                rotation_distance(p.rotation, q.rotation)
                for p, q in zip(joint.poses, free.poses, strict=True)
            ]
        )

    def _kept(self) -> dict[str, Float[np.ndarray, " views"]]:
        poses = self.known.start_poses(self.surface.middle)
        values: dict[str, Callable[[], Float[np.ndarray, " views"]]] = {
            "yaw": lambda: self.known.yaws(self.surface.middle),
            "elevation": lambda: np.array([tilt(pose)[0][1] for pose in poses]),
            "scale": lambda: np.log([pose.scale for pose in poses]),
        }
        return {name: values[name]() for name in sorted(self.known.locked - {"fov"})}

    def _level(self, problem: JointProblem, joint: JointFit) -> JointProblem:
        """Return the problem with the mean elevation that the drawings agree on best."""
        if len(self.views) < TELLING_VIEWS or "elevation" in self.known.locked:
            return problem
        cameras = self.cameras(joint)
        found = common_elevation(self.views, cameras)
        if not np.isfinite(found.sigma):
            return problem
        mean = float(np.mean([camera.angles[1] for camera in cameras]))
        return problem.with_elevation(ElevationPrior(mean + found.offset, found.sigma))


def _rivals(pose: Pose, candidates: Candidates) -> list[Pose]:
    """Return the chosen pose, its twin and the best candidates, all with the chosen k."""
    return with_k(with_twins([pose]) + [fit.pose for fit in candidates.fits[:4]], pose.k)


@contextmanager
def _timed(seconds: dict[str, float], step: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[step] = seconds.get(step, 0.0) + time.perf_counter() - start
