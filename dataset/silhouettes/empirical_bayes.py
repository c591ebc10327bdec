"""Fit small numbers to outlines by Gauss-Newton, with a prior whose size the data say.

Minimised over the numbers c of one block or more, whose priors share the size tau:

    sum over residuals r of rho(r / sigma)^2 / CORRELATED  +  c' K^-1 c / tau^2

with rho of Geman and McClure. tau, the size of the drawings' errors, is learned by expectation
maximisation; whether there are errors at all is asked of the marginal likelihood against none,
which charges every number that the data determine.

Source: MacKay, "Bayesian interpolation", Neural Computation 1992.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

CORRELATED = 5.0  # outline points in a row that err together
FOREIGN = 0.02  # of the square: larger disagreements are more and more another shape, no error
LEAST, MOST = 0.001, 0.02  # of the square: limits of tau; a larger one would bend other shapes
SETTLED = 3  # rounds before tau is learned

Numbers = Float[np.ndarray, "blocks m"]


@dataclass(frozen=True, eq=False)
class Fit:
    """Fitted numbers and the evidence for them.

    Attributes:
        numbers: (views, k) in units of the squares.
        tau: the size of errors that the sheet asks for, of the square.
        gain_nats: log marginal likelihood above that of drawings without error.
        apart_px: root mean square disagreement per outline point, before and after, in pixels of
            the small pictures.
    """

    numbers: Float[np.ndarray, "views k"]
    tau: float
    gain_nats: float
    apart_px: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Normal:
    """The normal equations of a block at one place.

    Attributes:
        matrix: H, of the residuals alone.
        slope: gradient / 2.
        cost: of the residuals.
        squares: sum of the outline points' squared disagreements, pixels.
        points: how many points there are.
    """

    matrix: Float[np.ndarray, "m m"]
    slope: Float[np.ndarray, " m"]
    cost: float
    squares: float
    points: int


@dataclass(frozen=True, eq=False)
class Prior:
    """The prior of a block's numbers: normal, about 0.

    Attributes:
        precision: (m, m) K^-1 of the numbers that tau scales, for tau = 1; 0 for the others.
        known: the precision of those others, whatever tau is.
    """

    precision: Float[np.ndarray, "m m"]
    known: Float[np.ndarray, "m m"] | float = 0.0

    @property
    def count(self) -> int:
        """Return how many numbers tau scales."""
        return int(np.count_nonzero(np.diag(self.precision)))

    def at(self, tau: float) -> Float[np.ndarray, "m m"]:
        """Return the precision of all numbers."""
        return self.precision / tau**2 + self.known


def weighed(
    residual: Float[np.ndarray, " n"], sigma: float, size: float
) -> tuple[Float[np.ndarray, " n"], float]:
    """Return the residuals' weights in the normal equations, and their cost.

    Args:
        residual: distances, pixels.
        sigma: an outline's own error, pixels.
        size: of the figure's square, pixels.
    """
    tame = 1 + (residual / (FOREIGN * size)) ** 2
    weight = 1 / (tame * sigma) ** 2 / CORRELATED
    return weight, float((residual**2 / tame).sum()) / sigma**2 / CORRELATED


def unmoved(first: Sequence[Normal], prior: Prior, tau: float) -> Fit | None:
    """Return the fit of drawings without error; None if moving them might be worth its numbers.

    Args:
        first: the normal equations at 0.
        prior: of every block's numbers.
        tau: first guess of the errors' size.
    """
    idle = sum(normal.cost - _log_volume(normal, prior, tau) for normal in first)
    if idle > 0:
        return None
    apart = apart_px(first)
    return Fit(np.zeros((len(first), len(prior.precision))), 0.0, idle / 2, (apart, apart))


def fit(
    linearise: Callable[[Numbers, int], Sequence[Normal]],
    first: Sequence[Normal],
    prior: Prior,
    tau: float,
    rounds: int,
    *,
    start: tuple[Numbers, Sequence[Normal]] | None = None,
    gauge: Callable[[Numbers], Numbers] | None = None,
    length: float = 1.0,
    enough: float = math.inf,
) -> Fit:
    """Return the smallest numbers that explain the residuals.

    Args:
        linearise: the blocks' normal equations at numbers, in a round (from 1).
        first: the normal equations at 0.
        prior: of every block's numbers.
        tau: first guess of the errors' size, of the square.
        rounds: of Gauss-Newton, at most.
        start: numbers to begin with, and the equations there; None: 0.
        gauge: takes from numbers what the residuals cannot see.
        length: of every step, in steps of Gauss-Newton.
        enough: share of the disagreement before a round above which the next is the last.
    """
    numbers, normals = start or (np.zeros((len(first), len(prior.precision))), first)
    for round_ in range(1, rounds + 1):
        precision, pairs = prior.at(tau), zip(normals, numbers, strict=True)
        numbers = np.stack([c - length * step(n.matrix, n.slope, precision, c) for n, c in pairs])
        if gauge is not None:
            numbers = gauge(numbers)
        before, normals = apart_px(normals), linearise(numbers, round_)
        if round_ >= SETTLED:
            tau = _learned(normals, prior, tau, numbers)
            if apart_px(normals) > enough * before:
                break
    gain = 0.0
    for c, idle, normal in zip(numbers, first, normals, strict=True):
        spent = normal.cost + float(c @ prior.at(tau) @ c)
        gain += (idle.cost - spent - _log_volume(normal, prior, tau)) / 2
    return Fit(numbers, tau, gain, (apart_px(first), apart_px(normals)))


def step(
    matrix: Float[np.ndarray, "m m"],
    slope: Float[np.ndarray, " m"],
    precision: Float[np.ndarray, "m m"],
    off: Float[np.ndarray, " m"],
) -> Float[np.ndarray, " m"]:
    """Return the step of Gauss-Newton, to be subtracted from the numbers.

    Args:
        matrix: H, of the residuals alone.
        slope: gradient / 2.
        precision: of the prior.
        off: the numbers, less the mean of their prior.
    """
    return np.linalg.solve(matrix + precision, slope + precision @ off)


def apart_px(normals: Sequence[Normal]) -> float:
    """Return the root mean square disagreement per outline point."""
    points = sum(normal.points for normal in normals)
    return float(np.sqrt(sum(normal.squares for normal in normals) / max(1, points)))


def _learned(normals: Sequence[Normal], prior: Prior, tau: float, numbers: Numbers) -> float:
    """Return the size of errors, by the numbers' expected energy (the expectation step)."""
    energy = sum(_energy(n, prior, tau, c) for n, c in zip(normals, numbers, strict=True))
    return float(np.clip(np.sqrt(energy / (prior.count * len(normals))), LEAST, MOST))


def _energy(normal: Normal, prior: Prior, tau: float, numbers: Float[np.ndarray, " m"]) -> float:
    """Return the expected energy of the numbers that tau scales, in variances of the prior."""
    from scipy.linalg import get_lapack_funcs

    precision = prior.precision
    potrf, potri = get_lapack_funcs(("potrf", "potri"), (normal.matrix,))
    factor, failed = potrf(normal.matrix + prior.at(tau), lower=True)
    assert not failed, "normal equations that are not positive definite"
    spread, _ = potri(factor, lower=True)  # its lower half: half the work of an inverse
    twice = 2 * float(np.sum(np.tril(precision, -1) * spread))
    trace = twice + float(np.sum(np.diag(precision) * np.diag(spread)))
    return float(numbers @ precision @ numbers) + trace


def _log_volume(normal: Normal, prior: Prior, tau: float) -> float:
    """Return log det(1 + K H): what the determined numbers cost."""
    before = prior.at(tau)
    whole = np.linalg.slogdet(normal.matrix + before)[1]
    return float(whole - np.linalg.slogdet(before)[1])
