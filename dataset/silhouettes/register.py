"""Register a sheet's drawings: the least displacements that make their outlines one body's.

The residuals of `toonset.dataset.silhouettes.tangency` are fitted by the numbers of all drawings
at once (`toonset.dataset.silhouettes.empirical_bayes`). What all drawings share is the body's own
place and size, and kept out (`common`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.dataset.silhouettes.displacement import Moves
from toonset.dataset.silhouettes.empirical_bayes import (
    Fit,
    Normal,
    Numbers,
    Prior,
    fit,
    unmoved,
    weighed,
)
from toonset.dataset.silhouettes.outlines import Outlines
from toonset.dataset.silhouettes.tangency import Placed, Touch, pixels_of, touch

NOISE, NOISE_PX = 0.003, 0.2  # of the square, but at least so many pixels: an outline's own error
FEWER = 7  # figure pixels of which one is looked at, where a mean is wanted
AFRESH = 4  # rounds after which whole rays are searched again, not only near the last best point


def fit_moves(outlines: Outlines, moves: Moves, tau: float, rounds: int) -> Fit:
    """Return the smallest displacements of a family that make outlines agree.

    Args:
        outlines: of three drawings or more.
        moves: the family.
        tau: first guess of the errors' size, of the square.
        rounds: of Gauss-Newton.
    """
    views, count = len(outlines.views), len(moves.covariance)
    prior = Prior(np.kron(np.eye(views), np.linalg.inv(moves.covariance)))
    normal, near = _linearised(outlines, moves, np.zeros((views, count)), None)
    found = unmoved([normal], prior, tau)
    if found is None:
        body, shares = common(outlines, moves)

        def linearise(flat: Numbers, round_: int) -> list[Normal]:
            nonlocal near
            numbers, known = flat.reshape(views, count), near if round_ % AFRESH else None
            normal, near = _linearised(outlines, moves, numbers, known)
            return [normal]

        def gauge(flat: Numbers) -> Numbers:
            return flat - body @ (shares @ flat[0])

        found = fit(linearise, [normal], prior, tau, rounds, gauge=gauge)
    return replace(found, numbers=found.numbers.reshape(views, count))


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
) -> tuple[Normal, list[np.ndarray]]:
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


def _normal(placed: Placed, touches: list[Touch]) -> Normal:
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
            weight, own_cost = weighed(residual, sigma, size)
            matrix[view, :, view] += here.T @ (weight[:, None] * here)
            matrix[other, :, other] += there.T @ (weight[:, None] * there)
            cross = here.T @ (weight[:, None] * there)
            matrix[view, :, other] += cross
            matrix[other, :, view] += cross.T
            slope[view] += here.T @ (weight * residual)
            slope[other] += there.T @ (weight * residual)
            cost += own_cost
            squares += float((residual**2).sum())
    flat = views * count
    points = sum(len(found.pixels) for found in touches)
    return Normal(matrix.reshape(flat, flat), slope.reshape(flat), cost, squares, points)


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
