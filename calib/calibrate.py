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

from toonset.calib.align import INDEPENDENT_POINTS
from toonset.calib.contour import drawn_contour
from toonset.calib.drawing_error import Noise
from toonset.calib.face import read_faces
from toonset.calib.hypotheses import SAME_POSE, Candidates, level_twins, refine, with_twins
from toonset.calib.joint import JointFit, JointProblem, SheetModel
from toonset.calib.judge import judge_sheet, judge_view, typical_coverage, with_sheet_in_mind
from toonset.calib.labels import Label
from toonset.calib.ladder import climb, with_proportions
from toonset.calib.match import Drawing
from toonset.calib.paint import read_paint
from toonset.calib.pose import Pose
from toonset.calib.proportions import Body, as_it_is
from toonset.calib.result import Calibration
from toonset.calib.rim import prepare_surface
from toonset.calib.shared import Sheet, possible_turns
from toonset.calib.templates import build_templates, find_hypotheses
from toonset.calib.ties import Turn
from toonset.calib.turns import TurnStart, likely_turns
from toonset.camera import rotation_distance
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
        labels: what is known of each view's yaw (`toonset.calib.labels`); empty for nothing.
    """

    starts: int = 6
    coarse_height_px: float = 100.0
    fine_height_px: float = 250.0
    rounds: int = 3
    labels: tuple[Label, ...] = ()


COARSE_POINTS, FINE_POINTS = 160, 200  # of a drawn outline
COARSE_WIDTHS = np.geomspace(0.08, 0.02, 8)
RECHECK_WIDTHS = np.geomspace(0.03, 0.015, 5)
NEAR_HEIGHTS = 3.0  # camera distance of the second first guess
FINE_WIDTHS = np.geomspace(0.015, 0.01, 3)
SKETCHED = np.geomspace(0.04, 0.015, 6)  # a joint fit that only has to rank selections
SKETCH_NOISE = Noise()  # one for all, so that energies compare
SAME_START = np.radians(25.0)  # a candidate this near to a start is what the start became
ASKS_FOR_PROPORTIONS = 0.93  # share of the outlines that meet in the typical view


def calibrate(
    views: Sequence[View],
    mesh: Mesh,
    options: CalibrationOptions = CalibrationOptions(),
    progress: Progress = lambda step, share: None,
) -> Calibration:
    """Return one camera per view with its uncertainty.

    Args:
        views: the drawings, at least one.
        mesh: the posed mannequin; world frame and units are its own.
        options: search effort and what is known beforehand.
        progress: called with the step's name and the share done.
    """
    seconds: dict[str, float] = {}
    with _timed(seconds, "prepare"):
        surface = prepare_surface(mesh)
        templates = build_templates(surface)
        contours = [drawn_contour(view) for view in views]
        coarse = [Drawing(c, options.coarse_height_px, COARSE_POINTS) for c in contours]
        fine = [Drawing(c, options.fine_height_px, FINE_POINTS) for c in contours]
        turns = possible_turns(len(views), options.labels)
        sheet = Sheet(turns, read_faces(views), read_paint(views))
    candidates = []
    with _timed(seconds, "search"):
        together = likely_turns(views, templates, turns)
        for i, view in enumerate(views):
            progress("search", i / len(views))
            starts = [h.pose for h in find_hypotheses(view, templates, options.starts)]
            starts = [*starts, starts[0].twin(), *(turn.poses[i] for turn in together)]
            candidates.append(refine(coarse[i], surface, starts, COARSE_WIDTHS))
    with _timed(seconds, "together"):
        progress("together", 0.0)
        search = _Together(coarse, as_it_is(surface), sheet)
        joint, turn, candidates = search.run(candidates, together, options.rounds)
    with _timed(seconds, "joint"):
        progress("joint", 0.0)
        problem = JointProblem(fine, turn)
        joint, model = climb(problem, joint.body, joint.poses)
        differs = typical_coverage(fine, joint) < ASKS_FOR_PROPORTIONS
        if differs:
            joint, model = with_proportions(problem, joint, model)
    with _timed(seconds, "judge"):
        progress("judge", 0.0)
        bent = joint.body.surface
        final = [
            refine(drawing, bent, _rivals(pose, c), FINE_WIDTHS)
            for drawing, pose, c in zip(fine, joint.poses, candidates, strict=True)
        ]
        seen = joint.poses if model.is_perspective else _with_k(joint.poses, 0.0)
        final = [
            level_twins(c, bent, pose, always=differs) for c, pose in zip(final, seen, strict=True)
        ]
        sure = sheet.probabilities(final)
        judged = with_sheet_in_mind(
            [
                judge_view(view, fine[i], bent, joint, i, final[i], sure[i])
                for i, view in enumerate(views)
            ]
        )
    verdict, reason = judge_sheet(judged)
    return Calibration(judged, model, joint.offset, joint.noise, verdict, reason, seconds)


@dataclass(frozen=True, eq=False)
class _Together:
    """The search for the selection of candidates that explains the sheet best."""

    drawings: Sequence[Drawing]
    body: Body
    sheet: Sheet

    def run(
        self, candidates: Sequence[Candidates], starts: Sequence[TurnStart], rounds: int
    ) -> tuple[JointFit, Turn, list[Candidates]]:
        """Return the best joint fit over selections, its turn, and the candidates at its k.

        The first selections: the candidates' own, as if orthographic and as if seen from near by
        (perspective of two to three body heights moves outlines so much that the wrong candidate
        can win without it), and the turns that explain all silhouettes.
        """
        nearby = self._at_camera(candidates, 1 / (NEAR_HEIGHTS * self.body.rest.height))
        selections = [self._selected(candidates), self._selected(nearby)]
        selections += [_nearest(candidates, start.poses) for start in starts]
        fits: list[JointFit] = []
        found = list(candidates)
        for _ in range(rounds):
            fits += [self._sketched(poses) for poses in selections]
            flipped = self._best(fits)[0]
            fits.append(self._sketched([pose.twin() for pose in flipped.poses]))
            best, turn = self._best(fits)
            again = [
                replace(view, fits=(replace(view.fits[0], pose=pose), *view.fits[:4]))
                for pose, view in zip(best.poses, candidates, strict=True)
            ]
            found = self._at_camera(again, best.poses[0].k)
            selections = [self._selected(found)]
            if _same(selections[0], best.poses):
                break
            fits = [best]
        return best, turn, found

    def _best(self, fits: Sequence[JointFit]) -> tuple[JointFit, Turn]:
        """Return the most probable of some joint fits, and the turn that it is."""
        prior, turns = self.sheet.weigh([fit.poses for fit in fits])
        views = len(self.drawings)
        likelihood = [np.log(fit.energy / views) for fit in fits]
        least = int(np.argmin(0.5 * INDEPENDENT_POINTS * views * np.array(likelihood) + prior))
        return fits[least], turns[least]

    def _sketched(self, poses: Sequence[Pose]) -> JointFit:
        """Return a joint fit that only has to rank a selection."""
        _, turns = self.sheet.weigh([poses])
        problem = JointProblem(self.drawings, turns[0])
        return problem.fit(self.body, poses, SKETCHED, SheetModel("shared"), SKETCH_NOISE)

    def _selected(self, candidates: Sequence[Candidates]) -> list[Pose]:
        chosen, _ = self.sheet.choose(candidates)
        return [view.fits[c].pose for view, c in zip(candidates, chosen, strict=True)]

    def _at_camera(self, candidates: Sequence[Candidates], k: float) -> list[Candidates]:
        """Refine the best candidates and their twins again at a given k."""
        surface = self.body.surface
        return [
            refine(
                drawing,
                surface,
                _with_k(with_twins([fit.pose for fit in found.fits[:4]]), k),
                RECHECK_WIDTHS,
            )
            for drawing, found in zip(self.drawings, candidates, strict=True)
        ]


def _nearest(candidates: Sequence[Candidates], starts: Sequence[Pose]) -> list[Pose]:
    """Return what each view's start became, or the start where its view ran away from it."""
    poses = []
    for view, start in zip(candidates, starts, strict=True):
        turns = [rotation_distance(fit.pose.rotation, start.rotation) for fit in view.fits]
        near = int(np.argmin(turns))
        poses.append(view.fits[near].pose if turns[near] < SAME_START else start)
    return poses


def _same(poses: Sequence[Pose], others: Sequence[Pose]) -> bool:
    turns = [rotation_distance(p.rotation, q.rotation) for p, q in zip(poses, others, strict=True)]
    return max(turns) < SAME_POSE


def _rivals(pose: Pose, candidates: Candidates) -> list[Pose]:
    """Return the chosen pose, its twin and the best candidates, all with the chosen k."""
    return _with_k(with_twins([pose]) + [fit.pose for fit in candidates.fits[:4]], pose.k)


def _with_k(poses: Sequence[Pose], k: float) -> list[Pose]:
    return [replace(pose, k=k) for pose in poses]


@contextmanager
def _timed(seconds: dict[str, float], step: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[step] = seconds.get(step, 0.0) + time.perf_counter() - start
