"""Compute the posterior of a sheet's candidate cameras, over turns and elevations.

Two things tie the views together, both unknown and summed out on a grid:

- one elevation, about which the views spread by 2 or 4 degrees: it separates twins
  (yaw -> 180 - yaw, elevation -> -elevation) unless all views flip together;
- where the views are meant to be seen from: what a person says (labels), else an evenly spaced
  turn, yaw_i = start +- i * 360 / views, in either direction. Most sheets are one (and most start
  at the front), but an uneven sheet stays possible: "no turn" is one of the alternatives, and
  evidence decides.

What is drawn inside the outlines adds to that: the face, and paint that moves as the body turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from toonset.calib.evidence.face import FaceEvidence, face_log_likelihood
from toonset.calib.evidence.texture import BROKEN, Paint, paint_log_likelihood
from toonset.calib.fit.sheet_prior import Turn
from toonset.calib.fit.tilt import ElevationPrior, tilt
from toonset.calib.outline.pose import Pose
from toonset.calib.search.candidates import Candidates
from toonset.camera import angles_from_rotation
from toonset.dataset.split_folder.view_labels import Label, label_rows

ELEVATION_GRID = np.radians(np.arange(-30.0, 61.0, 1.25))
ELEVATION_SIGMAS = np.radians([2.0, 4.0])  # of views about their sheet's elevation; equally likely
TURN_VIEWS = 4  # fewer views make no turn
TURN_STARTS = 36  # of the first view's yaw
TURN_SIGMA = np.radians(8.0)  # of a view about its place
P_TURN = 0.5  # before looking: half of all sheets are evenly spaced turns
# Of the turns: start at the front, at the back; the others start anywhere (docs/decisions.md)
P_FRONT_FIRST, P_BACK_FIRST = 0.4, 0.1
NEAR_ASKED, UNASKED = np.radians(25.0), 50.0  # nats, of a yaw farther from where a person put it
UNLIKELY = 20.0  # nats: hypotheses this far behind are not asked about paint


@dataclass(frozen=True, eq=False)
class Turns:
    """Alternative turns of a sheet.

    Attributes:
        places: (t, views) yaw in radians; nan where an alternative says nothing about a view.
        log_prior: (t,).
        anchored: a person has said so.
        named: of which views, where it is not of all that have places; empty for all.
    """

    places: Float[np.ndarray, "t views"]
    log_prior: Float[np.ndarray, " t"]
    anchored: bool = False
    named: tuple[bool, ...] = ()


def possible_turns(views: int, labels: tuple[Label, ...] = ()) -> Turns:
    """Return the readings of the labels, or without any label "no turn" and the even turns.

    Where only some views are labelled, the others may stand in an even turn with them.
    """
    if any(labels):
        rows, log_odds = label_rows(labels)
        if all(labels) or views < TURN_VIEWS:
            return Turns(rows, log_odds, anchored=True)
        near = [
            (turn, odds + np.log(P_TURN / 2))
            for row, odds in zip(rows, log_odds, strict=True)
            for way in (1, -1)
            if (turn := _even_turn(row, way)) is not None
        ]
        return Turns(
            np.array([*rows, *(turn for turn, _ in near)]),
            np.array([*(log_odds + np.log(1 - P_TURN)), *(odds for _, odds in near)]),
            anchored=True,
            named=tuple(np.isfinite(rows[0]).tolist()),
        )
    places, log_prior = np.full((1, views), np.nan), np.zeros(1)
    if views >= TURN_VIEWS:
        starts = np.arange(TURN_STARTS) * 2 * np.pi / TURN_STARTS
        steps = np.arange(views) * 2 * np.pi / views
        even = np.concatenate([starts[:, None] + steps, starts[:, None] - steps])
        p_start = np.full(TURN_STARTS, (1 - P_FRONT_FIRST - P_BACK_FIRST) / TURN_STARTS)
        p_start[0] += P_FRONT_FIRST
        p_start[TURN_STARTS // 2] += P_BACK_FIRST
        places = np.concatenate([places, even])
        log_prior = np.log(np.concatenate([[1 - P_TURN], np.tile(P_TURN * p_start / 2, 2)]))
    return Turns(places, log_prior)


def _even_turn(row: Float[np.ndarray, " views"], way: int) -> Float[np.ndarray, " views"] | None:
    """Return a reading of labels with its other views in an even turn; None if it is in none."""
    known, even = np.isfinite(row), way * np.arange(len(row)) * 2 * np.pi / len(row)
    start = np.angle(np.exp(1j * (row - even)[known]).mean())
    off = (row - even - start + np.pi) % (2 * np.pi) - np.pi
    if np.abs(off[known]).max() > 2 * TURN_SIGMA:
        return None
    return np.where(known, row, (start + even) % (2 * np.pi))


class SheetPosterior:
    """The grid of what the views might share, against which candidates are weighed."""

    def __init__(
        self,
        turns: Turns,
        faces: FaceEvidence | None = None,
        paint: Paint | None = None,
        asked: Float[np.ndarray, " views"] | None = None,
    ) -> None:
        """Cross the turns with the elevations, and with whether what is drawn inside can be read.

        Args:
            turns: where the views might be meant to be seen from.
            faces: what the heads say; None for nothing.
            paint: what the colours say; None for nothing.
            asked: yaws at which a person put views, nan elsewhere. Selections stay there; how
                probable they are is still the drawings' to say.
        """
        wide = ElevationPrior()
        log_elevation = -0.5 * ((ELEVATION_GRID - wide.mean) / wide.sigma) ** 2
        log_elevation -= np.log(np.exp(log_elevation).sum())
        many, grid, spreads = len(turns.places), len(ELEVATION_GRID), len(ELEVATION_SIGMAS)
        self.turns, self.faces, self.paint, self.asked = turns, faces, paint, asked
        self.elevations = np.repeat(ELEVATION_GRID, spreads * many)
        self.sigmas = np.tile(np.repeat(ELEVATION_SIGMAS, many), grid)
        self.places = np.tile(turns.places, (grid * spreads, 1))
        log_prior = np.repeat(log_elevation, spreads * many)
        log_prior = log_prior + np.tile(turns.log_prior, grid * spreads)
        # the second half: the same hypotheses where faces are none (a hat band, a mask at the back)
        self.log_prior = np.concatenate([log_prior + np.log1p(-BROKEN), log_prior + np.log(BROKEN)])

    def choose(self, views: Sequence[Candidates]) -> tuple[list[int], Turn]:
        """Return each view's candidate under the best hypothesis, and its turn."""
        energies = [
            energy + self._unasked([fit.pose for fit in view.fits], i)
            for i, (energy, view) in enumerate(zip(self._of_candidates(views), views, strict=True))
        ]
        total = np.sum([e.min(axis=1) for e in energies], axis=0) - self.log_prior
        chosen = np.stack([e.argmin(axis=1) for e in energies], axis=1)
        total -= self._paint(views, chosen, total)
        best = int(np.argmin(total))
        return [int(c) for c in chosen[best]], self._turn(best)

    def weigh(self, sheets: Sequence[Sequence[Pose]]) -> tuple[Float[np.ndarray, " n"], list[Turn]]:
        """Return the negative log prior of every selection of poses, and the turn it fits best."""
        costs, turns = [], []
        for poses in sheets:
            terms = [self._energies([p], np.zeros(1), i)[:, 0] for i, p in enumerate(poses)]
            total = np.sum(terms, axis=0) - self.log_prior
            best = int(np.argmin(total))
            unasked = sum(float(self._unasked([p], i)[0]) for i, p in enumerate(poses))
            costs.append(float(total[best]) + unasked)
            turns.append(self._turn(best))
        if self.paint is None:
            return np.array(costs), turns
        yaws = np.array([[_yaw(pose) for pose in poses] for poses in sheets])
        return np.array(costs) - paint_log_likelihood(self.paint, yaws), turns

    def probabilities(self, views: Sequence[Candidates]) -> list[Float[np.ndarray, " n"]]:
        """Return every candidate's probability: P(c) = sum_h P(h | sheet) P(c | h)."""
        posterior, weights = self._posterior(views)
        return [posterior @ (w / w.sum(axis=1, keepdims=True)) for w in weights]

    def faces_contradict(self, views: Sequence[Candidates]) -> float:
        """Return the probability that the faces found are false, since outlines contradict them.

        High where the outlines can only be explained with the faces at the back: a drawing or a
        mannequin that is mirrored fits in its mirror twins' cameras, and all outlines agree.
        """
        posterior, _ = self._posterior(views)
        return float(posterior[len(posterior) // 2 :].sum())

    def _posterior(
        self, views: Sequence[Candidates]
    ) -> tuple[Float[np.ndarray, " h"], list[Float[np.ndarray, "h n"]]]:
        """Return the probability of every hypothesis, and its candidates' unscaled ones."""
        energies = self._of_candidates(views)
        lowest = [e.min(axis=1, keepdims=True) for e in energies]
        weights = [np.exp(low - e) for low, e in zip(lowest, energies, strict=True)]
        log_evidence = self.log_prior + np.sum(
            [np.log(w.sum(axis=1)) - low[:, 0] for w, low in zip(weights, lowest, strict=True)],
            axis=0,
        )
        chosen = np.stack([e.argmin(axis=1) for e in energies], axis=1)
        log_evidence += self._paint(views, chosen, -log_evidence)
        posterior = np.exp(log_evidence - log_evidence.max())
        return posterior / posterior.sum(), weights

    def _of_candidates(self, views: Sequence[Candidates]) -> list[Float[np.ndarray, "h n"]]:
        return [
            self._energies([fit.pose for fit in view.fits], view.energies, i)
            for i, view in enumerate(views)
        ]

    def _paint(
        self,
        views: Sequence[Candidates],
        chosen: Int[np.ndarray, "h views"],
        energies: Float[np.ndarray, " h"],
    ) -> Float[np.ndarray, " h"]:
        """Return the paint's log-likelihood of every hypothesis' own candidates."""
        if self.paint is None:
            return np.zeros(len(chosen))
        worth = energies < energies.min() + UNLIKELY
        picks, place = np.unique(chosen[worth], axis=0, return_inverse=True)
        yaws = [[_yaw(v.fits[c].pose) for v, c in zip(views, row, strict=True)] for row in picks]
        found = paint_log_likelihood(self.paint, np.array(yaws))
        all_of_them = np.full(len(chosen), found.min())
        all_of_them[worth] = found[place.reshape(-1)]
        return all_of_them

    def _unasked(self, poses: Sequence[Pose], index: int) -> Float[np.ndarray, " n"]:
        """Return the cost of poses that contradict a person's camera."""
        if self.asked is None:
            return np.zeros(len(poses))
        off = np.array([_yaw(pose) for pose in poses]) - self.asked[index]
        return np.where(np.abs((off + np.pi) % (2 * np.pi) - np.pi) > NEAR_ASKED, UNASKED, 0.0)

    def _turn(self, hypothesis: int) -> Turn:
        places = self.places[hypothesis % len(self.places)]
        return Turn(places, self.turns.anchored, self.turns.named)

    def _energies(
        self, poses: Sequence[Pose], data: Float[np.ndarray, " n"], index: int
    ) -> Float[np.ndarray, "h n"]:
        """Return the candidates' energies under every shared hypothesis.

        Tails are heavy (Student's t, 3 degrees of freedom): one view may differ from the rest.
        Without a turn yaw is uniform; the density's constant makes both comparable.
        """
        elevation = np.array([tilt(pose)[0][1] for pose in poses])
        yaw = np.array([_yaw(pose) for pose in poses])
        tilted = (elevation - self.elevations[:, None]) / self.sigmas[:, None]
        turned = (yaw - self.places[:, index, None] + np.pi) % (2 * np.pi) - np.pi
        peak = np.log(2 * np.pi / (2.72 * TURN_SIGMA))  # t's density at its mode over the uniform's
        turn = np.where(np.isnan(turned), 0.0, _tail(turned / TURN_SIGMA) - peak)
        unread = data + _tail(tilted) + np.log(self.sigmas)[:, None] + turn
        if self.faces is None:
            return np.concatenate([unread, unread])
        return np.concatenate([unread - face_log_likelihood(self.faces, index, yaw), unread])


def _yaw(pose: Pose) -> float:
    return angles_from_rotation(pose.rotation)[0]


def _tail(z: np.ndarray) -> np.ndarray:
    return 2.0 * np.log1p(z**2 / 3.0)
