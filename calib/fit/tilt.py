"""Measure how cameras are tilted, and say which tilts are usual: roll and elevation.

Artists draw figures upright and look slightly down. Where no outline is fitted to a mannequin,
elevations are a mixture: all of 45 collected sheets are drawn at eye level, sprites from anywhere
up to `STEEPEST` (docs/decisions.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from toonset.calib.outline.pose import PARAMETERS, Pose

ROLL_SIGMA = np.radians(4.0)  # drawings stand upright
LEVEL_SPREAD, P_STEEP = np.radians(3.0), 0.05
P_LEVEL = 0.7  # that a sheet is drawn from exactly eye level; for its elevation, not its turn
STEEPEST = np.radians(50.0)  # elevation that sprites are drawn from


@dataclass(frozen=True)
class ElevationPrior:
    """Prior of a view's elevation, radians."""

    mean: float = np.radians(5.0)  # artists look slightly down
    sigma: float = np.radians(20.0)


LEVEL, ANYWHERE = ElevationPrior(0.0, LEVEL_SPREAD), ElevationPrior()


def tilt(pose: Pose) -> tuple[tuple[float, float], Float[np.ndarray, "2 3"]]:
    """Return (roll, elevation) in radians and their derivatives by the left increment w.

    With up = R e_y: roll = atan2(up_x, -up_y), elevation = atan2(-up_z, |up_xy|), d up = w x up.
    """
    x, y, z = pose.rotation[:, 1].tolist()
    flat = max(math.hypot(x, y), 1e-6)
    d_roll = [-x * z / flat**2, -y * z / flat**2, (x * x + y * y) / flat**2]
    d_elevation = [-y / flat, x / flat, 0.0]
    return (math.atan2(x, -y), math.atan2(-z, flat)), np.array([d_roll, d_elevation])


def upright_prior(
    pose: Pose, prior: ElevationPrior
) -> tuple[Float[np.ndarray, "6 6"], Float[np.ndarray, " 6"]]:
    """Return the Gauss-Newton matrix and gradient of the roll and elevation priors."""
    (roll, elevation), slopes = tilt(pose)
    precision = np.array([1 / ROLL_SIGMA**2, 1 / prior.sigma**2])
    matrix, gradient = np.zeros((PARAMETERS, PARAMETERS)), np.zeros(PARAMETERS)
    matrix[:3, :3] = (slopes.T * precision) @ slopes
    gradient[:3] = (np.array([roll, elevation - prior.mean]) * precision) @ slopes
    return matrix, gradient


def level_or_steep(mean: float) -> ElevationPrior:
    """Return the prior of a sheet's elevation: eye level, as far as its mean is likely to be that.

    The mixture of both as one normal distribution of their mean precision (expectation step).
    """
    level, steep = (
        p * np.exp(-0.5 * ((mean - prior.mean) / prior.sigma) ** 2) / prior.sigma
        for p, prior in ((1 - P_STEEP, LEVEL), (P_STEEP, ANYWHERE))
    )
    near = level / (level + steep)
    precisions = near / LEVEL.sigma**2, (1 - near) / ANYWHERE.sigma**2
    middle = precisions[1] * ANYWHERE.mean / sum(precisions)
    return ElevationPrior(float(middle), float(sum(precisions) ** -0.5))


def elevation_log_prior(elevations: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return how usual elevations >= 0 are, nats: eye level, or, of sprites, anything up to 50."""
    level = np.exp(-0.5 * (elevations / LEVEL_SPREAD) ** 2) * np.sqrt(2 / np.pi) / LEVEL_SPREAD
    return np.log((1 - P_STEEP) * level + P_STEEP / STEEPEST)


def elevation_shares(elevations: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the prior probabilities of two or more rising elevations, the first of them eye level.

    A sheet is drawn from exactly there with P_LEVEL, else from anywhere in the mixture.
    """
    shares = np.exp(elevation_log_prior(elevations)) * np.gradient(elevations)
    shares *= (1 - P_LEVEL) / shares.sum()
    shares[0] += P_LEVEL
    return shares
