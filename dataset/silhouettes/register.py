"""Register a sheet's drawings: the least displacements that make their outlines one body's.

Minimised over the numbers c_v of all drawings at once, by Gauss-Newton:

    sum over outline points and other views of rho(r / sigma)^2 / CORRELATED  +  c' K^-1 c / tau^2

What all drawings share is the body's own place and size, and kept out (`common`).
tau, the size of the drawings' errors, comes from the sheet itself (expectation maximisation, as
in MacKay 1992); whether there are errors at all is asked of the marginal likelihood against none,
which charges every number that the data determine.

Source: MacKay, "Bayesian interpolation", Neural Computation 1992.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.silhouettes.displacement import Moves
from toonset.dataset.silhouettes.outlines import Outlines
from toonset.dataset.silhouettes.tangency import Placed, Touch, pixels_of, touch

NOISE, NOISE_PX = 0.003, 0.2  # of the square, but at least so many pixels: an outline's own error
CORRELATED = 5.0  # outline points in a row that err together
FOREIGN = 0.02  # of the square: larger disagreements are more and more another shape, no error
LEAST, MOST = 0.001, 0.02  # of the square: limits of tau; a larger one would bend other shapes
SETTLED = 3  # rounds before tau is learned
FEWER = 7  # figure pixels of which one is looked at, where a mean is wanted
AFRESH = 4  # rounds after which whole rays are searched again, not only near the last best point


@dataclass(frozen=True, eq=False)
class Fit:
    """Registered drawings and the evidence for moving them.

    Attributes:
        numbers: (views, k) of the family, in units of the squares.
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
class _Normal:
    """The normal equations at one place: H, gradient/2, cost, and squared distances per point."""

    matrix: Float[np.ndarray, "m m"]
    slope: Float[np.ndarray, " m"]
    cost: float
    apart: float


def fit_moves(outlines: Outlines, moves: Moves, tau: float, rounds: int) -> Fit:
    """Return the smallest displacements of a family that make outlines agree.

    Args:
        outlines: of three drawings or more.
        moves: the family.
        tau: first guess of the errors' size, of the square.
        rounds: of Gauss-Newton.
    """
    views, count = len(outlines.views), len(moves.covariance)
    precision = np.kron(np.eye(views), np.linalg.inv(moves.covariance))
    numbers = np.zeros((views, count))
    first, near = _linearised(outlines, moves, numbers, None)
    idle = first.cost - log_volume(first.matrix, moves.covariance * tau**2, views)
    if idle <= 0:  # even a perfect fit would not be worth its numbers
        return Fit(numbers, 0.0, float(idle / 2), (first.apart, first.apart))
    normal, flat = first, numbers.reshape(-1)
    body, shares = common(outlines, moves)
    for round_ in range(1, rounds + 1):
        prior = precision / tau**2
        flat = flat - np.linalg.solve(normal.matrix + prior, normal.slope + prior @ flat)
        flat = flat - body @ (shares @ flat)
        numbers = flat.reshape(views, count)
        normal, near = _linearised(outlines, moves, numbers, near if round_ % AFRESH else None)
        if round_ >= SETTLED:
            tau = learn_error_size(energy(normal.matrix, precision, flat, tau), len(flat))
    spent = normal.cost + flat @ precision @ flat / tau**2
    volume = log_volume(normal.matrix, moves.covariance * tau**2, views)
    gain = (first.cost - spent - volume) / 2
    return Fit(numbers, tau, float(gain), (first.apart, normal.apart))


def common(
    outlines: Outlines, moves: Moves
) -> tuple[Float[np.ndarray, "m 4"], Float[np.ndarray, "4 m"]]:
    """Return the gauge directions, 3 translations and 1 scale, that outlines cannot see.

    That is no error of the drawings: of all numbers that differ by it, those are meant which move
    the figures least. (The equations leave it open but for perspective, through which errors
    would push the body.)

    Returns:
        A column per axis and one for size, and the rows that find each one's share in numbers.
    """
    columns, weighed = [], []
    for outline in outlines.views:
        figure = outline.camera.pixel_grid()[outline.distance[0] > 0][::FEWER]
        jacobian = moves.jacobian(outline.square.unit(figure)).reshape(-1, len(moves.covariance))
        ends = outlines.middle + outlines.radius * np.concatenate([np.eye(3), -np.eye(3)])
        ends_px = pixels_of(outline.camera, ends) / outlines.size_px
        own = [moves.even(shift, 0.0) for shift in ends_px[:3] - ends_px[3:]]
        own.append(moves.even(np.zeros(2), 1.0))
        columns.append(np.stack(own, axis=1))
        weighed.append(jacobian.T @ (jacobian @ columns[-1]) / max(1, len(jacobian)))
    body, weights = np.concatenate(columns), np.concatenate(weighed).T
    return body, np.linalg.pinv(weights @ body, rcond=1e-9) @ weights


def _linearised(
    outlines: Outlines, moves: Moves, numbers: np.ndarray, near: list[np.ndarray] | None
) -> tuple[_Normal, list[np.ndarray]]:
    """Return the normal equations at `numbers`, and where along the rays they were taken."""
    placed = Placed.of(outlines, moves, numbers)
    touches = _touches(placed, near)
    return _normal(placed, touches), [found.along for found in touches]


def _touches(placed: Placed, near: list[np.ndarray] | None) -> list[Touch]:
    return [
        touch(
            placed, view, placed.target(view, outline.points), None if near is None else near[view]
        )
        for view, outline in enumerate(placed.outlines.views)
    ]


def _normal(placed: Placed, touches: list[Touch]) -> _Normal:
    views, count = placed.numbers.shape
    matrix = np.zeros((views, count, views, count))
    slope = np.zeros((views, count))
    size = placed.outlines.size_px
    sigma = max(NOISE * size, NOISE_PX)
    cost = squares = 0.0
    for view, found in enumerate(touches):
        own = placed.moves.jacobian(placed.outlines.views[view].square.unit(found.pixels))
        for other in range(views):
            if other == view:
                continue
            residual, here, there = _pair(placed, view, other, found, own)
            tame = 1 + (residual / (FOREIGN * size)) ** 2
            weight = 1 / (tame * sigma) ** 2 / CORRELATED
            matrix[view, :, view] += here.T @ (weight[:, None] * here)
            matrix[other, :, other] += there.T @ (weight[:, None] * there)
            cross = here.T @ (weight[:, None] * there)
            matrix[view, :, other] += cross
            matrix[other, :, view] += cross.T
            slope[view] += here.T @ (weight * residual)
            slope[other] += there.T @ (weight * residual)
            cost += float((residual**2 / tame).sum()) / sigma**2 / CORRELATED
            squares += float((residual**2).sum())
    flat = views * count
    points = max(1, sum(len(found.pixels) for found in touches))
    return _Normal(matrix.reshape(flat, flat), slope.reshape(flat), cost, (squares / points) ** 0.5)


def _pair(
    placed: Placed, view: int, other: int, found: Touch, own: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the disagreements of `view`'s rays with `other`, and their derivatives by both."""
    mine, theirs = placed.outlines.views[view], placed.outlines.views[other]
    place = pixels_of(theirs.camera, found.points)
    distance, *slope = theirs.at(placed.source(other, place))
    off = distance < 0
    across = np.stack(slope, axis=-1)[off]
    turn = _pixel_jacobian(mine.camera, theirs.camera, found.pixels[off], found.points[off])
    size = placed.outlines.size_px  # numbers are in units of the square
    there = size * np.einsum(
        "ni,nik->nk", across, placed.moves.jacobian(theirs.square.unit(place[off]))
    )
    here = -size * np.einsum("ni,nij,njk->nk", across, turn, own[off], optimize=True)
    return distance[off], here, there


def _pixel_jacobian(
    camera: Camera, other: Camera, pixels: np.ndarray, points: np.ndarray
) -> Float[np.ndarray, "n 2 2"]:
    """Return how a pixel in `other` moves with one of `camera`, at the points' depths."""
    depth = camera.project(points)[1]
    columns = []
    for step in (np.array([0.5, 0.0]), np.array([0.0, 0.5])):
        ahead, behind = (camera.unproject(pixels + s, depth) for s in (step, -step))
        columns.append(pixels_of(other, ahead) - pixels_of(other, behind))
    return np.stack(columns, axis=-1)


def energy(
    matrix: Float[np.ndarray, "k k"],
    precision: Float[np.ndarray, "k k"],
    numbers: Float[np.ndarray, " k"],
    tau: float,
) -> float:
    """Return the expected energy of the numbers, in variances of the prior."""
    from scipy.linalg import get_lapack_funcs

    potrf, potri = get_lapack_funcs(("potrf", "potri"), (matrix,))
    factor, _ = potrf(matrix + precision / tau**2, lower=True)
    spread, _ = potri(factor, lower=True)  # its lower half: half the work of an inverse
    twice = 2 * float(np.sum(np.tril(precision, -1) * spread))
    trace = twice + float(np.sum(np.diag(precision) * np.diag(spread)))
    return float(numbers @ precision @ numbers) + trace


def learn_error_size(whole: float, count: int) -> float:
    """Return the size of errors, by the energy of `count` numbers."""
    return float(np.clip(np.sqrt(whole / count), LEAST, MOST))


def log_volume(
    matrix: Float[np.ndarray, "m m"], covariance: Float[np.ndarray, "k k"], views: int
) -> float:
    """Return log det(1 + K H): what the determined numbers cost."""
    prior = np.kron(np.eye(views), np.linalg.inv(covariance))
    before = views * np.linalg.slogdet(covariance)[1]
    return float(np.linalg.slogdet(matrix + prior)[1] + before)
