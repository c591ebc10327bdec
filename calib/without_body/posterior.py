"""Compute the posterior of a sheet's turns from paint, faces, shins and outlines.

- **Paint** moves as the body turns: which way round, and where the axis of symmetry lies.
- **Faces and detail** look to the front: heads have eyes, fronts have buttons.
- **Shins** stand behind the figure's middle: heads, arms and toes reach ahead of them.
- **Outlines** are those of one body, at eye level or from above, never from below.
- **Mirrored outlines** tell front and back, which look alike when one is mirrored, from sides.

Each may be wrong as a whole, so that none excludes a turn. Front and back, the way round and the
pattern are three doubts; they are told apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.cylinder import figure_height, read_sections
from toonset.calib.evidence.face import FaceEvidence, drawn_detail, face_log_likelihood, read_faces
from toonset.calib.evidence.mirrored_outlines import (
    MirroredOutlines,
    mirrored_log_likelihood,
    read_mirrored_outlines,
)
from toonset.calib.evidence.texture import Paint, paint_evidence, read_paint
from toonset.calib.fit.tilt import elevation_log_prior
from toonset.calib.without_body.placing import FEW_ELEVATIONS, Figures, coherence_log_likelihood
from toonset.calib.without_body.turns import (
    NEAR,
    P_MISPLACED,
    P_MISREAD,
    TurnHypotheses,
    misread,
    wrapped,
)
from toonset.dataset.split_folder.view_labels import Label
from toonset.view import View

HEIGHT_PX = 160  # working height of a figure
RIM_PX = 3.0
DETAIL = 1.0  # nats per relative difference of detail
# Nats per share by which detail leans to one side: in 52 side views it leans to the front by 0.4,
# spread 0.3, whence 0.4 / 0.3^2, less for what it shares with the heads
LEAN = 3.5
FAINTEST = 0.005  # OKLab per pixel: less is not detail
ROUGH = 0.006  # of the height: outlines whose places are not fitted are this far apart
SHINS_FROM, SHINS_TO = 0.05, 0.2  # of the height, from the ground
BEHIND = 30.0  # nats per height by which they stand behind the figure's middle
# Of sheets: where a cue means nothing
PAINT_BROKEN, FACES_BROKEN, SHINS_BROKEN, OUTLINES_BROKEN = 0.02, 0.02, 0.05, 0.05
MIRRORED_BROKEN = 0.02


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence of a sheet without a body.

    Attributes:
        paint: the colours, band by band.
        faces: what the heads say.
        detail: (views,) how much more is drawn in a view's upper half than in the others'.
        lean: (views,) by how much of the mean that detail leans to the image's left.
        shins: (views,) how far to the right of the figure's middle they stand, in heights, less
            the sheet's mean.
        mirrored: how alike outlines are, mirrored and not.
    """

    paint: Paint
    faces: FaceEvidence
    detail: Float[np.ndarray, " views"]
    lean: Float[np.ndarray, " views"]
    shins: Float[np.ndarray, " views"]
    mirrored: MirroredOutlines

    @classmethod
    def of(cls, views: Sequence[View]) -> Evidence:
        """Read the views of a sheet."""
        return cls(
            read_paint(views),
            read_faces(views),
            *_detail(views),
            _shins(views),
            read_mirrored_outlines(views),
        )

    def log_likelihood(
        self, yaws: Float[np.ndarray, "turns views"], outlines: Float[np.ndarray, " turns"]
    ) -> Float[np.ndarray, " turns"]:
        """Return the log-likelihoods of turns, nats; only their differences mean something.

        Args:
            yaws: radians.
            outlines: log-likelihood of the outlines under every turn.
        """
        heads = np.array(
            [sum(face_log_likelihood(self.faces, i, y) for i, y in enumerate(row)) for row in yaws]
        )
        sideways = np.sin(yaws)
        front = heads + DETAIL * np.cos(yaws) @ self.detail + LEAN * sideways @ self.lean
        behind = sideways @ self.shins / np.maximum(np.square(sideways).sum(axis=1), 1.0)
        return (
            _doubted(paint_evidence(self.paint, yaws), PAINT_BROKEN)
            + _doubted(front, FACES_BROKEN)
            + _doubted(BEHIND * behind, SHINS_BROKEN)
            + _doubted(outlines, OUTLINES_BROKEN)
            + _doubted(mirrored_log_likelihood(self.mirrored, yaws), MIRRORED_BROKEN)
        )


def outlines_log_likelihood(figures: Figures, turns: TurnHypotheses) -> Float[np.ndarray, " turns"]:
    """Return the log-likelihood of the outlines under every turn, elevations integrated out.

    A common yaw changes nothing, so one turn of every pattern is looked at.
    """
    found = np.zeros(len(turns.yaws))
    for pattern in np.unique(turns.pattern):
        rows = turns.pattern == pattern
        yaws = turns.yaws[rows][0]
        apart = figures.apart(yaws, FEW_ELEVATIONS)
        likely = coherence_log_likelihood(apart, len(yaws), ROUGH)
        found[rows] = np.logaddexp.reduce(likely + elevation_log_prior(FEW_ELEVATIONS))
    return found


@dataclass(frozen=True)
class ErrorProbabilities:
    """Probabilities that the chosen turn is wrong, by kind of error.

    Attributes:
        front: front and back are confused, the axis is right.
        way: views run the other way round.
        spacing: anything else: where the axis lies, or the pattern.
    """

    front: float
    way: float
    spacing: float


def doubts(
    turns: TurnHypotheses, posterior: Float[np.ndarray, " turns"], chosen: int
) -> ErrorProbabilities:
    """Return the doubts about a turn."""
    yaws = turns.yaws[chosen]

    def mass(other: Float[np.ndarray, " views"]) -> float:
        there = (np.abs(wrapped(turns.yaws - other)) <= NEAR).all(axis=1)
        return float(posterior[there].sum())

    right, front = mass(yaws), mass(yaws + np.pi)
    way = mass(2 * yaws[0] - yaws) + mass(2 * yaws[0] + np.pi - yaws)
    if np.abs(wrapped(2 * (yaws - yaws[0]))).max() < NEAR:  # front and back only
        way = 0.0
    return ErrorProbabilities(front, way, max(0.0, 1 - right - front - way))


def view_doubt(
    turns: TurnHypotheses, posterior: Float[np.ndarray, " turns"], chosen: int
) -> Float[np.ndarray, " views"]:
    """Return the probability of every view that it is seen from elsewhere."""
    away = np.abs(wrapped(turns.yaws - turns.yaws[chosen])) > NEAR
    return np.asarray(posterior @ away)


def label_doubt(
    turns: TurnHypotheses,
    log_likelihood: Float[np.ndarray, " turns"],
    chosen: int,
    labels: Sequence[Label],
) -> Float[np.ndarray, " views"]:
    """Return the probability of every view that the labels are wrong together, and it with them.

    They may be half a turn off, or mirrored, as whoever takes the picture's left for the
    character's gives them, or belong to the turn that the drawings speak for. Cameras stay where a
    person says; the drawings only say whether to believe it.

    Args:
        turns: alternatives.
        log_likelihood: of the drawings alone, nats.
        chosen: the turn that agrees with the labels.
        labels: which yaws a person named, per view; () for none.
    """
    yaws, doubt = turns.yaws[chosen], np.zeros(len(turns.yaws[chosen]))
    named = np.array([bool(label) for label in labels] or [False] * len(yaws))
    better = log_likelihood - log_likelihood[chosen]
    likeliest = turns.yaws[better.argmax()]
    for other, p in [*((row, P_MISREAD) for row in misread(yaws)), (likeliest, P_MISPLACED)]:
        away = np.abs(wrapped(other - yaws)) > NEAR
        there = (np.abs(wrapped(turns.yaws - other)) <= NEAR).all(axis=1)
        if there.any() and (away & named).any():
            odds = p * float(np.exp(better[there].max()))
            doubt = np.maximum(doubt, away * odds / (1 + odds))
    return doubt


def _doubted(
    log_likelihood: Float[np.ndarray, " turns"], broken: float
) -> Float[np.ndarray, " turns"]:
    """Return log-likelihoods of a cue that is wrong as a whole on some sheets.

    Heavy tails: the order of turns stays, but no turn is worse than the best one by far more nats
    than the odds of the cue being wrong.
    """
    worst = -np.log(broken)
    return -worst * np.log1p((log_likelihood.max() - log_likelihood) / worst)


def _detail(
    views: Sequence[View],
) -> tuple[Float[np.ndarray, " views"], Float[np.ndarray, " views"]]:
    """Return how much is drawn in the upper halves, and how far it leans to the image's left."""
    factor = HEIGHT_PX / figure_height(views)
    shown, lean = [], []
    for view in views:
        sections = read_sections(view, factor, RIM_PX, HEIGHT_PX)
        upper = sections.inside.copy()
        upper[HEIGHT_PX // 2 :] = False
        across, detail = sections.across[upper], drawn_detail(sections.lab)[upper]
        facing = np.sqrt(np.clip(1 - across**2, 0, 1))
        shown.append((detail @ facing) / max(facing.sum(), 1.0))
        mean = detail.mean() if len(detail) else 0.0
        lean.append(-3 * ((detail - mean) @ across) / max(len(detail), 1) / (mean + FAINTEST))
    mean = float(np.mean(shown))
    return (np.array(shown) - mean) / (mean + FAINTEST), np.array(lean)


def _shins(views: Sequence[View]) -> Float[np.ndarray, " views"]:
    offsets = []
    for view in views:
        row, column = np.nonzero(view.mask)
        height = row.max() + 1 - row.min()
        above_ground = (row.max() + 0.5 - row) / height
        low = (above_ground > SHINS_FROM) & (above_ground < SHINS_TO)
        at = column[low].mean() if low.any() else column.mean()
        offsets.append((at - column.mean()) / height)
    return np.array(offsets) - np.mean(offsets)
