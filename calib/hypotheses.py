"""Which of a view's local optima is right: probabilities under what the views of a sheet share.

Every view has several refined candidates; mirror twins are always among them. A candidate's
negative log-likelihood is n / 2 * log(cost), noise profiled out, with the number n of independent
outline errors. Two things tie the views together, both unknown and summed out on a grid:

- one elevation, up to a few degrees: it separates twins (yaw -> 180 - yaw, elevation ->
  -elevation) unless all views flip together;
- an evenly spaced turn, yaw_i = start +- i * 360 / views, in either direction. Most sheets are one
  (and most start at the front), but a sheet that is none stays possible: "no turn" is one of the
  alternatives, and evidence decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.align import INDEPENDENT_POINTS, Drawing, ElevationPrior, Fit, align, tilt
from toonset.calib.pose import Pose, project
from toonset.calib.rim import Surface, silhouette_mask
from toonset.camera import angles_from_rotation, rotation_distance

SAME_POSE = np.radians(8.0)  # candidates nearer than this are one
MIRROR = np.radians(15.0)  # a candidate this near to the twin's rotation is the twin
ELEVATION_GRID = np.radians(np.arange(-30.0, 61.0, 2.5))
ELEVATION_SIGMA = np.radians(4.0)  # of a view about its sheet's elevation
TURN_VIEWS = 4  # fewer views make no turn
TURN_STARTS = 24  # of the first view's yaw
TURN_SIGMA = np.radians(8.0)  # of a view about its place in the turn
LOOK_PX = 192  # picture in which a pose and its twin are compared
ALIKE = 0.99  # overlap from which two silhouettes are one; a bag at one side makes it 0.94
P_TURN = 0.5  # before looking: half of all sheets are evenly spaced turns
# Of the turns: start at the front, at the back; the others start anywhere. A habit of artists is no
# evidence: at 4 to 1 it chooses between twins, but alone it leaves them ambiguous.
P_FRONT_FIRST, P_BACK_FIRST = 0.4, 0.1


@dataclass(frozen=True, eq=False)
class Candidates:
    """A view's refined, distinct poses.

    Attributes:
        fits: best data fit first.
        energies: (n,) negative log-likelihood of the data, nats, relative to the best.
    """

    fits: tuple[Fit, ...]
    energies: Float[np.ndarray, " n"]


@dataclass(frozen=True, eq=False)
class Shared:
    """What the views might share: a grid of hypotheses.

    Attributes:
        elevations: (h,) radians.
        yaws: (h, views) radians; nan where the hypothesis says nothing about yaw.
        log_prior: (h,).
    """

    elevations: Float[np.ndarray, " h"]
    yaws: Float[np.ndarray, "h views"]
    log_prior: Float[np.ndarray, " h"]


def refine(
    drawing: Drawing,
    surface: Surface,
    starts: Sequence[Pose],
    widths: Float[np.ndarray, " iterations"],
) -> Candidates:
    """Return the distinct optima that contour alignment reaches from `starts`."""
    fits = [align(drawing, surface, start, widths) for start in starts]
    distinct: list[Fit] = []
    for fit in sorted(fits, key=lambda fit: fit.cost):
        apart = (rotation_distance(fit.pose.rotation, f.pose.rotation) for f in distinct)
        if all(angle > SAME_POSE for angle in apart):
            distinct.append(fit)
    costs = np.array([fit.cost for fit in distinct])
    return Candidates(tuple(distinct), 0.5 * INDEPENDENT_POINTS * np.log(costs / costs[0]))


def with_twins(poses: Sequence[Pose]) -> list[Pose]:
    """Return the poses and their mirror twins."""
    return [*poses, *(pose.twin() for pose in poses)]


def is_twin(pose: Pose, other: Pose) -> bool:
    """Return whether `other` is the mirror twin of `pose` up to refinement."""
    return rotation_distance(pose.twin().rotation, other.rotation) < MIRROR


def level_twins(view: Candidates, surface: Surface, pose: Pose) -> Candidates:
    """Return the candidates with equal energies for `pose` and a twin that looks the same.

    Both outlines of a symmetric body are one curve, but sampled at other points; what their costs
    differ by is no evidence, and would add up over the views of a sheet.
    """
    if not _twins_look_alike(surface, pose):
        return view
    turns = [(fit.pose, rotation_distance(fit.pose.rotation, pose.rotation)) for fit in view.fits]
    pair = [i for i, (p, turn) in enumerate(turns) if turn < SAME_POSE or is_twin(pose, p)]
    energies = view.energies.copy()
    energies[pair] = energies[pair].min(initial=np.inf)
    return Candidates(view.fits, energies)


def _twins_look_alike(surface: Surface, pose: Pose) -> bool:
    size = (LOOK_PX, LOOK_PX)
    scale = 0.5 * LOOK_PX / surface.radius
    centred = replace(pose, shift=np.full(2, LOOK_PX / 2), scale=scale)
    a, b = (
        silhouette_mask(project(p, surface.vertices), surface.faces, size)
        for p in (centred, centred.twin())
    )
    return float((a & b).sum() / max((a | b).sum(), 1)) >= ALIKE


def choose_together(views: Sequence[Candidates]) -> list[int]:
    """Return each view's candidate under the best shared hypothesis."""
    shared = shared_hypotheses(len(views))
    energies = [_energies(view, shared, i) for i, view in enumerate(views)]
    total = np.sum([e.min(axis=1) for e in energies], axis=0) - shared.log_prior
    best = int(np.argmin(total))
    return [int(e[best].argmin()) for e in energies]


def probabilities(views: Sequence[Candidates]) -> list[Float[np.ndarray, " n"]]:
    """Return every candidate's probability: P(c) = sum_h P(h | sheet) P(c | h)."""
    shared = shared_hypotheses(len(views))
    energies = [_energies(view, shared, i) for i, view in enumerate(views)]
    lowest = [e.min(axis=1, keepdims=True) for e in energies]
    weights = [np.exp(low - e) for low, e in zip(lowest, energies, strict=True)]
    log_evidence = shared.log_prior + np.sum(
        [np.log(w.sum(axis=1)) - low[:, 0] for w, low in zip(weights, lowest, strict=True)], axis=0
    )
    posterior = np.exp(log_evidence - log_evidence.max())
    posterior /= posterior.sum()
    return [posterior @ (w / w.sum(axis=1, keepdims=True)) for w in weights]


def shared_hypotheses(views: int) -> Shared:
    """Return the grid of common elevations and turns for a sheet of `views` drawings."""
    wide = ElevationPrior()
    log_elevation = -0.5 * ((ELEVATION_GRID - wide.mean) / wide.sigma) ** 2
    log_elevation -= np.log(np.exp(log_elevation).sum())
    turns = np.full((1, views), np.nan)
    log_turn = np.zeros(1)
    if views >= TURN_VIEWS:
        starts = np.arange(TURN_STARTS) * 2 * np.pi / TURN_STARTS
        steps = np.arange(views) * 2 * np.pi / views
        places = np.concatenate([starts[:, None] + steps, starts[:, None] - steps])
        p_start = np.full(TURN_STARTS, (1 - P_FRONT_FIRST - P_BACK_FIRST) / TURN_STARTS)
        p_start[0] += P_FRONT_FIRST
        p_start[TURN_STARTS // 2] += P_BACK_FIRST
        turns = np.concatenate([turns, places])
        log_turn = np.log(np.concatenate([[1 - P_TURN], np.tile(P_TURN * p_start / 2, 2)]))
    many, grid = len(turns), len(ELEVATION_GRID)
    return Shared(
        np.repeat(ELEVATION_GRID, many),
        np.tile(turns, (grid, 1)),
        np.repeat(log_elevation, many) + np.tile(log_turn, grid),
    )


def _energies(view: Candidates, shared: Shared, index: int) -> Float[np.ndarray, "h n"]:
    """Return the candidates' energies under every shared hypothesis.

    Tails are heavy (Student's t, 3 degrees of freedom): one view may differ from the rest. Without
    a turn yaw is uniform; the density's constant makes both comparable.
    """
    elevation = np.array([tilt(fit.pose)[0][1] for fit in view.fits])
    yaw = np.array([angles_from_rotation(fit.pose.rotation)[0] for fit in view.fits])
    tilted = (elevation - shared.elevations[:, None]) / ELEVATION_SIGMA
    turned = (yaw - shared.yaws[:, index, None] + np.pi) % (2 * np.pi) - np.pi
    peak = np.log(2 * np.pi / (2.72 * TURN_SIGMA))  # t's density at its mode over the uniform's
    turn = np.where(np.isnan(turned), 0.0, _tail(turned / TURN_SIGMA) - peak)
    return view.energies + _tail(tilted) + turn


def _tail(z: np.ndarray) -> np.ndarray:
    return 2.0 * np.log1p(z**2 / 3.0)
