"""Select one candidate per view by fitting selections jointly.

Every view brings its candidates. A selection takes one of each, is fitted as a sheet at low
resolution with a common camera distance, and scored by likelihood and by what is shared (elevation,
turn or labels, face, paint). The best selection's distance then sharpens the candidates, until no
selection is better.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toonset.calib.fit.align import INDEPENDENT_POINTS
from toonset.calib.fit.drawing_error import Noise
from toonset.calib.fit.proportions import Body
from toonset.calib.fit.sheet_adjustment import JointFit, JointProblem, SheetModel
from toonset.calib.fit.sheet_prior import Turn
from toonset.calib.outline.correspondences import Drawing
from toonset.calib.outline.pose import Pose
from toonset.calib.search.candidates import SAME_POSE, Candidates, add_twins, refine
from toonset.calib.search.sheet_posterior import SheetPosterior
from toonset.calib.search.turntable_starts import TurnStart
from toonset.camera import rotation_distance

if TYPE_CHECKING:
    from toonset.calib.fit.landmark_residuals import LandmarkRows

RECHECK_WIDTHS = np.geomspace(0.03, 0.015, 3)
RECHECKED = 4  # best candidates of a view that are tried again at another camera distance
NEAR_HEIGHTS = 3.0  # camera distance of the second first guess
RANKING_NOISE = Noise()  # one for all, so that energies compare
SAME_START = np.radians(25.0)  # a candidate this near to a start is what the start became
RANKING_WIDTHS = np.geomspace(0.04, 0.015, 6)  # a joint fit that only has to rank selections


@dataclass(frozen=True, eq=False)
class TogetherSearch:
    """The search for the selection of candidates that explains the sheet best."""

    drawings: Sequence[Drawing]
    body: Body
    sheet: SheetPosterior
    informed: Callable[[Candidates, int], Candidates]
    landmarks: LandmarkRows | None = None

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
        best, turn, found = None, Turn(np.full(len(candidates), np.nan)), list(candidates)
        for _ in range(rounds):
            fits = [self._sketched(poses) for poses in _distinct(selections)]
            leader = self._best(fits)[0]
            fits.append(self._sketched([pose.twin() for pose in leader.poses]))
            contender, its_turn = self._best(fits if best is None else [best, *fits])
            if contender is best:
                break
            best, turn = contender, its_turn
            again = [
                replace(view, fits=(replace(view.fits[0], pose=pose), *view.fits[:RECHECKED]))
                for pose, view in zip(best.poses, candidates, strict=True)
            ]
            found = self._at_camera(again, best.poses[0].k)
            selections = [self._selected(found)]
            if _same(selections[0], best.poses):
                break
        assert best is not None
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
        problem = JointProblem(self.drawings, turns[0], landmarks=self.landmarks)
        return problem.fit(self.body, poses, RANKING_WIDTHS, SheetModel("shared"), RANKING_NOISE)

    def _selected(self, candidates: Sequence[Candidates]) -> list[Pose]:
        chosen, _ = self.sheet.choose(candidates)
        return [view.fits[c].pose for view, c in zip(candidates, chosen, strict=True)]

    def _at_camera(self, candidates: Sequence[Candidates], k: float) -> list[Candidates]:
        """Refine the best candidates and their twins again at a given k."""
        surface = self.body.surface
        again = []
        for i, (drawing, found) in enumerate(zip(self.drawings, candidates, strict=True)):
            starts = set_distance(add_twins([fit.pose for fit in found.fits[:RECHECKED]]), k)
            again.append(self.informed(refine(drawing, surface, starts, RECHECK_WIDTHS), i))
        return again


def _nearest(candidates: Sequence[Candidates], starts: Sequence[Pose]) -> list[Pose]:
    """Return each view's refined start, or the start where refinement diverged."""
    poses = []
    for view, start in zip(candidates, starts, strict=True):
        turns = [rotation_distance(fit.pose.rotation, start.rotation) for fit in view.fits]
        near = int(np.argmin(turns))
        poses.append(view.fits[near].pose if turns[near] < SAME_START else start)
    return poses


def _distinct(selections: Sequence[list[Pose]]) -> list[list[Pose]]:
    kept: list[list[Pose]] = []
    for poses in selections:
        if not any(_same(poses, other) for other in kept):
            kept.append(poses)
    return kept


def _same(poses: Sequence[Pose], others: Sequence[Pose]) -> bool:
    turns = [rotation_distance(p.rotation, q.rotation) for p, q in zip(poses, others, strict=True)]
    return max(turns) < SAME_POSE


def set_distance(poses: Sequence[Pose], k: float) -> list[Pose]:
    """Return the poses at another camera distance."""
    return [replace(pose, k=k) for pose in poses]
