"""Which of a view's local optima is right: probabilities under the sheet's common elevation.

Every view has several refined candidates; mirror twins are always among them. A candidate's
negative log-likelihood is n_eff / 2 * log(cost), noise profiled out, with the effective number of
independent outline samples. Views of one sheet share their elevation up to a few degrees, which a
twin (yaw -> 180 - yaw, elevation -> -elevation) breaks unless all flip together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from toonset.calib.align import INDEPENDENT_POINTS, Drawing, ElevationPrior, Fit, align, tilt
from toonset.calib.pose import Pose
from toonset.calib.rim import Surface
from toonset.camera import rotation_distance

SAME_POSE = np.radians(8.0)  # candidates nearer than this are one
MIRROR = np.radians(15.0)  # a candidate this near to the twin's rotation is the twin
ELEVATION_GRID = np.radians(np.arange(-30.0, 61.0, 2.5))
SHEET_ELEVATION = ElevationPrior(sigma=np.radians(4.0))  # of a view about its sheet's elevation


@dataclass(frozen=True, eq=False)
class Candidates:
    """A view's refined, distinct poses.

    Attributes:
        fits: best data fit first.
        energies: (n,) negative log-likelihood of the data, nats, relative to the best.
    """

    fits: tuple[Fit, ...]
    energies: Float[np.ndarray, " n"]


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


def choose_together(views: Sequence[Candidates]) -> list[int]:
    """Return each view's candidate under the best common elevation."""
    totals = []
    for prior in _common_elevations():
        best = [float(energies_with(view, prior).min()) for view in views]
        totals.append(sum(best) - _log_prior(prior))
    prior = _common_elevations()[int(np.argmin(totals))]
    return [int(energies_with(view, prior).argmin()) for view in views]


def probabilities(views: Sequence[Candidates]) -> list[Float[np.ndarray, " n"]]:
    """Return every candidate's probability, the common elevation summed out.

    P(c | sheet) = sum_e P(e | sheet) P(c | e); a flip of the whole sheet is the elevation -e.
    """
    given, evidence = [], []
    for prior in _common_elevations():
        energies = [energies_with(view, prior) for view in views]
        given.append([np.exp(e.min() - e) / np.exp(e.min() - e).sum() for e in energies])
        log_each = [-e.min() + np.log(np.exp(e.min() - e).sum()) for e in energies]
        evidence.append(float(np.sum(log_each)) + _log_prior(prior))
    weights = np.exp(np.array(evidence) - max(evidence))
    weights /= weights.sum()
    return [
        np.sum([w * per_view[i] for w, per_view in zip(weights, given, strict=True)], axis=0)
        for i in range(len(views))
    ]


def energies_with(view: Candidates, prior: ElevationPrior) -> Float[np.ndarray, " n"]:
    """Return energies with an elevation prior; its tails are heavy, as one view may differ."""
    elevations = np.array([tilt(fit.pose)[0][1] for fit in view.fits])
    off = (elevations - prior.mean) / prior.sigma
    return view.energies + 2.0 * np.log1p(off**2 / 4.0)


def is_twin(pose: Pose, other: Pose) -> bool:
    """Return whether `other` is the mirror twin of `pose` up to refinement."""
    return rotation_distance(pose.twin().rotation, other.rotation) < MIRROR


def _common_elevations() -> list[ElevationPrior]:
    return [ElevationPrior(float(e), SHEET_ELEVATION.sigma) for e in ELEVATION_GRID]


def _log_prior(sheet: ElevationPrior) -> float:
    wide = ElevationPrior()
    return -0.5 * ((sheet.mean - wide.mean) / wide.sigma) ** 2
