"""Build a sheet's hierarchical prior: common elevation and scale, no roll, evenly spaced yaws.

Each shared quantity q_i = mean + deviation_i, deviation_i ~ N(0, spread^2), with the mean free (or
near a known value) and the spread itself estimated on the sheet: an inverse-gamma prior worth a few
views keeps it from collapsing, the drawings' evidence moves it (a hierarchical model, empirical
Bayes; Gelman et al., Bayesian Data Analysis, chapter 5). So precise drawings are hardly pulled and
rough ones are pulled to what artists mean to draw.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from toonset.calib.fit.tilt import ElevationPrior, tilt
from toonset.calib.outline.pose import PARAMETERS, Pose
from toonset.camera import angles_from_rotation

PRIOR_VIEWS = 4.0  # how many views the expected spread is worth
LABEL_SIGMA = np.radians(5.0)  # of a sheet's mean yaw about its labels
LOCK_SIGMA = 1e-5  # of what a person keeps
TAIL = 4.0  # degrees of freedom of a view's yaw about its place: one bad view pulls little


@dataclass(frozen=True)
class Spreads:
    """Standard deviations between the views of a sheet; radians, relative for scale."""

    elevation: float = np.radians(3.0)
    roll: float = np.radians(2.0)
    scale: float = 0.01
    yaw: float = np.radians(3.0)


@dataclass(frozen=True, eq=False)
class Turn:
    """Nominal yaws of a sheet's views.

    Attributes:
        places: (views,) yaw in radians; nan where nothing is known of a view.
        anchored: the places are known (labels), not only their differences.
        named: which views' places are, where the turn goes beyond what is labelled; empty for all.
    """

    places: Float[np.ndarray, " views"]
    anchored: bool = False
    named: tuple[bool, ...] = ()


@dataclass(frozen=True, eq=False)
class SharedPrior:
    """One shared quantity: its values, derivatives, and how its deviations are measured.

    Attributes:
        values: (views,).
        slopes: (views, unknowns).
        centre: (m, views) takes deviations; identity where the mean is known.
        weights: (m,) of the deviations.
    """

    values: Float[np.ndarray, " views"]
    slopes: Float[np.ndarray, "views unknowns"]
    centre: Float[np.ndarray, "m views"]
    weights: Float[np.ndarray, " m"] = field(default_factory=lambda: np.ones(1))

    def equations(
        self, sigma: float
    ) -> tuple[Float[np.ndarray, "unknowns unknowns"], Float[np.ndarray, " unknowns"]]:
        """Return the prior's part of normal matrix and gradient."""
        scaled = self.centre * (np.sqrt(self.weights) / sigma)[:, None]
        rows = scaled @ self.slopes
        return rows.T @ rows, rows.T @ (scaled @ self.values)

    def spread(self, covariance: Float[np.ndarray, "unknowns unknowns"], expected: float) -> float:
        """Return the spread that the deviations ask for, with their own uncertainty included."""
        scaled = self.centre * np.sqrt(self.weights)[:, None]
        rows = scaled @ self.slopes
        squared = ((scaled @ self.values) ** 2).sum() + np.einsum(
            "iu,uv,iv->", rows, covariance, rows
        )
        count = float(np.trace(self.centre))
        return float(np.sqrt((PRIOR_VIEWS * expected**2 + squared) / (PRIOR_VIEWS + count)))


def sheet_priors(
    poses: Sequence[Pose], turn: Turn | None, yaw_spread: float, size: int
) -> dict[str, SharedPrior]:
    """Return the priors of a sheet by the name of their spread.

    Args:
        poses: of the views, whose unknowns come first, six each.
        turn: where the views are meant to be seen from, if known.
        yaw_spread: current spread about the turn, for the weights of far views.
        size: number of unknowns.
    """
    views = len(poses)
    tilts = [tilt(pose) for pose in poses]
    slopes = np.zeros((4, views, size))
    for i, (pose, (_, by_turn)) in enumerate(zip(poses, tilts, strict=True)):
        own = slice(PARAMETERS * i, PARAMETERS * i + 3)
        slopes[0, i, own], slopes[1, i, own] = by_turn
        slopes[2, i, PARAMETERS * i + 5] = 1
        slopes[3, i, own] = yaw_slope(pose)
    about_mean = np.eye(views) - 1 / views
    ones = np.ones(views)
    priors = {
        "roll": SharedPrior(np.array([a[0] for a, _ in tilts]), slopes[0], np.eye(views), ones),
        "elevation": SharedPrior(np.array([a[1] for a, _ in tilts]), slopes[1], about_mean, ones),
        "scale": SharedPrior(np.log([pose.scale for pose in poses]), slopes[2], about_mean, ones),
    }
    if turn is not None and np.isfinite(turn.places).any():
        priors["yaw"] = _yaw_tie(poses, turn, slopes[3], yaw_spread)
    return priors


def anchors(
    priors: dict[str, SharedPrior], turn: Turn | None, prior: ElevationPrior
) -> list[tuple[SharedPrior, float]]:
    """Return priors on the sheet's means: (prior of one row, sigma)."""
    elevation = priors["elevation"]
    views = len(elevation.values)
    mean = np.full((1, views), 1 / views)
    known = [
        (
            SharedPrior(elevation.values - prior.mean, elevation.slopes, mean, np.ones(1)),
            prior.sigma,
        )
    ]
    if turn is not None and turn.anchored and "yaw" in priors:
        yaw = priors["yaw"]
        placed = np.array(turn.named) if turn.named else np.isfinite(turn.places)
        over = (placed / placed.sum())[None]
        known.append((SharedPrior(yaw.values, yaw.slopes, over, np.ones(1)), LABEL_SIGMA))
    return known


def locks(
    priors: dict[str, SharedPrior],
    poses: Sequence[Pose],
    values: Mapping[str, Float[np.ndarray, " views"]],
) -> list[tuple[SharedPrior, float]]:
    """Return priors that keep views' yaw, elevation or log scale at given values; nan is free."""
    kept = []
    views = len(poses)
    for name, wanted in values.items():
        if name == "yaw":
            slopes = np.zeros_like(priors["roll"].slopes)
            for i, pose in enumerate(poses):
                slopes[i, PARAMETERS * i : PARAMETERS * i + 3] = yaw_slope(pose)
            now = np.array([angles_from_rotation(pose.rotation)[0] for pose in poses])
            off = (now - wanted + np.pi) % (2 * np.pi) - np.pi
        else:
            slopes, off = priors[name].slopes, priors[name].values - wanted
        held = np.isfinite(wanted)
        off = np.where(held, off, 0.0)
        kept.append((SharedPrior(off, slopes, np.eye(views), held.astype(float)), LOCK_SIGMA))
    return kept


def yaw_slope(pose: Pose) -> Float[np.ndarray, " 3"]:
    """Return the derivative of yaw by the left rotation increment w.

    With the viewing direction f = row 2 of R: yaw = atan2(-f_x, -f_z), d f = w_x R_1 - w_y R_0.
    """
    forward = pose.rotation[2]
    flat = max(float(forward[0] ** 2 + forward[2] ** 2), 1e-12)

    def along(change: Float[np.ndarray, " 3"]) -> float:
        return float(forward[2] * change[0] - forward[0] * change[2]) / flat

    return np.array([along(pose.rotation[1]), along(-pose.rotation[0]), 0.0])


def off_places(poses: Sequence[Pose], turn: Turn) -> Float[np.ndarray, " views"]:
    """Return how far views are turned off their places, which turn together; 0 without a place."""
    placed = np.isfinite(turn.places)
    if not placed.any():
        return np.zeros(len(poses))
    off, mean = _off_places(poses, turn)
    return np.where(placed, off - mean, 0.0)


def _off_places(poses: Sequence[Pose], turn: Turn) -> tuple[Float[np.ndarray, " views"], float]:
    placed = np.isfinite(turn.places)
    yaw = np.array([angles_from_rotation(pose.rotation)[0] for pose in poses])
    off = np.where(placed, yaw - np.where(placed, turn.places, 0.0), 0.0)
    mean = float(np.angle(np.exp(1j * off[placed]).mean()))
    return np.where(placed, mean + (off - mean + np.pi) % (2 * np.pi) - np.pi, 0.0), mean


def _yaw_tie(
    poses: Sequence[Pose], turn: Turn, slopes: Float[np.ndarray, "views unknowns"], spread: float
) -> SharedPrior:
    placed = np.isfinite(turn.places)
    off, mean = _off_places(poses, turn)
    centre = np.diag(placed.astype(float)) - np.outer(placed, placed) / placed.sum()
    weights = (TAIL + 1) / (TAIL + ((off - mean) / spread) ** 2)
    return SharedPrior(off, slopes, centre, np.where(placed, np.minimum(weights, 1.0), 0.0))
