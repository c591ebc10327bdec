"""Fit yaws, shifts and sizes of a sheet's cameras until its outlines are those of one body.

Minimised over each camera's shift, growth and yaw, by Gauss-Newton:

    sum over outline points and other views of rho(r / sigma)^2 / CORRELATED
      + |shift, 2 growth|^2 / tau^2 + (yaw / its sigma)^2

with r of `toonset.dataset.silhouettes.tangency`, noise and tau as in
`toonset.dataset.silhouettes.register`. What outlines cannot tell is left as it was: the mean yaw,
and the body's place and size.

Source: Hernandez, Schmitt, Cipolla, "Silhouette coherence for camera calibration under circular
motion", PAMI 2007, with distances instead of overlaps and a prior on every number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from toonset.camera import Camera, rotation_from_angles
from toonset.dataset.silhouettes.displacement import ShiftAndScale
from toonset.dataset.silhouettes.outlines import Outline, Outlines, Square
from toonset.dataset.silhouettes.register import (
    CORRELATED,
    FOREIGN,
    LEAST,
    MOST,
    NOISE,
    NOISE_PX,
    SETTLED,
    Fit,
    common,
)
from toonset.dataset.silhouettes.tangency import Placed, Touch, pixels_of, touch

PLACE, YAW, OWN = slice(0, 3), 3, 4  # a camera's numbers: shift x, shift y, growth; yaw
STEP = 1e-3  # of central differences: of the square, or radians
# As cameras move, best points slide along their rays, which takes away about half of a
# disagreement's curvature: steps that hold the points are too short by as much
LENGTHENED = 1.6
ENOUGH = 0.98  # of the disagreement before a round: what gains no more is settled

_PLACES = ShiftAndScale.expected()


@dataclass(frozen=True, eq=False)
class _Normal:
    """Normal equations: H, gradient / 2, cost and disagreement."""

    matrix: Float[np.ndarray, "m m"]
    slope: Float[np.ndarray, " m"]
    cost: float
    apart: float


def fit_turns(
    outlines: Outlines, yaw_sigmas: Float[np.ndarray, " views"], tau: float, rounds: int
) -> Fit:
    """Return the smallest moves of the cameras that make outlines agree.

    Numbers are shift x and y and growth in units of the squares, and yaw in radians.

    Args:
        outlines: of three drawings or more.
        yaw_sigmas: radians; 0: that camera does not turn.
        tau: first guess of the size of wrong places, of the square.
        rounds: of Gauss-Newton at most.
    """
    views = len(outlines.views)
    flat = np.zeros(OWN * views)
    deviation = _deviations(yaw_sigmas, tau)
    first = normal = _linearised(outlines, flat, deviation > 0)
    idle = first.cost - _log_volume(first.matrix, deviation)
    if idle <= 0:  # even a perfect fit would not be worth its numbers
        apart = (first.apart, first.apart)
        return Fit(flat.reshape(views, OWN), 0.0, idle / 2, apart)
    body, shares = common(outlines, _PLACES)
    for round_ in range(1, rounds + 1):
        flat = _improved(normal, deviation, flat)
        own = flat.reshape(views, OWN)  # a view of `flat`
        own[:, PLACE] -= (body @ (shares @ own[:, PLACE].reshape(-1))).reshape(views, -1)
        if yaw_sigmas.all():
            own[:, YAW] -= np.average(own[:, YAW], weights=yaw_sigmas**-2)
        before, normal = normal.apart, _linearised(outlines, flat, deviation > 0)
        if round_ >= SETTLED:
            tau = _learned(normal.matrix, deviation, flat, tau)
            deviation = _deviations(yaw_sigmas, tau)
            if normal.apart > ENOUGH * before:
                break
    free = deviation > 0
    spent = normal.cost + float(((flat[free] / deviation[free]) ** 2).sum())
    gain = (first.cost - spent - _log_volume(normal.matrix, deviation)) / 2
    apart = (first.apart, normal.apart)
    return Fit(flat.reshape(views, OWN), tau, gain, apart)


def move_camera(camera: Camera, square: Square, own: Float[np.ndarray, " 4"]) -> Camera:
    """Return the camera of a drawing after its numbers; `square` in the camera's pixels."""
    yaw, elevation, roll = camera.angles
    rotation = rotation_from_angles(yaw + float(own[YAW]), elevation, roll)
    return displace_camera(replace(camera, rotation=rotation), square, own[PLACE])


def displace_camera(camera: Camera, square: Square, own: Float[np.ndarray, " 3"]) -> Camera:
    """Return the camera whose pixel of a point is the moved one: u + d(u), exactly."""
    growth = 1 + 2 * own[2]
    middle = square.low + square.size / 2
    center = middle + growth * (camera.center - middle) + square.size * own[:2]
    return replace(camera, center=center, scale=camera.scale * growth)


def _deviations(yaw_sigmas: Float[np.ndarray, " views"], tau: float) -> Float[np.ndarray, " m"]:
    """Return every number's standard deviation before the outlines are looked at."""
    own = np.zeros((len(yaw_sigmas), OWN))
    own[:, PLACE] = tau * np.sqrt(np.diag(_PLACES.covariance))
    own[:, YAW] = yaw_sigmas
    return own.reshape(-1)


def _improved(normal: _Normal, deviation: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """Return the numbers after a step of Gauss-Newton, in units in which priors are standard."""
    unit = np.divide(flat, deviation, out=np.zeros_like(flat), where=deviation > 0)
    matrix = deviation[:, None] * normal.matrix * deviation + np.eye(len(flat))
    step = np.linalg.solve(matrix, deviation * normal.slope + unit)
    return deviation * (unit - LENGTHENED * step)


def _learned(matrix: np.ndarray, deviation: np.ndarray, flat: np.ndarray, tau: float) -> float:
    """Return the size of placing errors, by the numbers and their uncertainty."""
    spread = np.linalg.inv(deviation[:, None] * matrix * deviation + np.eye(len(flat)))
    place = np.arange(len(flat)).reshape(-1, OWN)[:, PLACE].reshape(-1)
    unit = flat[place] / deviation[place]
    energy = float(unit @ unit + np.diag(spread)[place].sum())
    return float(np.clip(tau * np.sqrt(energy / len(place)), LEAST, MOST))


def _log_volume(matrix: np.ndarray, deviation: np.ndarray) -> float:
    """Return log det(1 + D H D): what the determined numbers cost."""
    whole = np.eye(len(matrix)) + deviation[:, None] * matrix * deviation
    return float(np.linalg.slogdet(whole)[1])


def _linearised(outlines: Outlines, flat: np.ndarray, free: Bool[np.ndarray, " m"]) -> _Normal:
    """Return the normal equations at `flat`; numbers that are not free have no slope."""
    own = flat.reshape(-1, OWN)
    views = tuple(
        replace(view, camera=move_camera(view.camera, view.square, numbers))
        for view, numbers in zip(outlines.views, own, strict=True)
    )
    aside = [
        _aside(view, numbers, movable)
        for view, numbers, movable in zip(outlines.views, own, free.reshape(-1, OWN), strict=True)
    ]
    placed = Placed.of(replace(outlines, views=views), _PLACES, np.zeros((len(views), 3)))
    size = outlines.size_px
    sigma = max(NOISE * size, NOISE_PX)
    matrix, slope = np.zeros((len(flat), len(flat))), np.zeros(len(flat))
    cost = squares = 0.0
    points = 0
    for view, outline in enumerate(views):
        found = touch(placed, view, outline.points)
        points += len(found.pixels)
        for other in range(len(views)):
            if other == view:
                continue
            residual, jacobian = _pair(views, aside, view, other, found)
            tame = 1 + (residual / (FOREIGN * size)) ** 2
            weight = 1 / (tame * sigma) ** 2 / CORRELATED
            used = _columns(view, other)
            matrix[np.ix_(used, used)] += jacobian.T @ (weight[:, None] * jacobian)
            slope[used] += jacobian.T @ (weight * residual)
            cost += float((residual**2 / tame).sum()) / sigma**2 / CORRELATED
            squares += float((residual**2).sum())
    return _Normal(matrix, slope, cost, (squares / max(1, points)) ** 0.5)


Aside = list[tuple[Camera, Camera] | None]


def _aside(outline: Outline, own: np.ndarray, movable: Bool[np.ndarray, " 4"]) -> Aside:
    """Return a camera a STEP ahead and behind in each number that may move."""
    return [
        (
            move_camera(outline.camera, outline.square, own + step),
            move_camera(outline.camera, outline.square, own - step),
        )
        if free
        else None
        for step, free in zip(STEP * np.eye(OWN), movable, strict=True)
    ]


def _columns(view: int, other: int) -> np.ndarray:
    """Return where the numbers of a pair stand: `view`'s, then `other`'s."""
    own = np.arange(OWN)
    return np.concatenate([OWN * view + own, OWN * other + own])


def _pair(
    views: Sequence[Outline], aside: Sequence[Aside], view: int, other: int, found: Touch
) -> tuple[np.ndarray, np.ndarray]:
    """Return the disagreements of `view`'s rays with `other`, and derivatives as `_columns`.

    A ray's best point keeps its depth: there the cost is level along the ray.
    """
    mine, theirs = views[view].camera, views[other].camera
    distance, *gradient = views[other].at(pixels_of(theirs, found.points))
    off = distance < 0
    across, points, pixels = np.stack(gradient, axis=-1)[off], found.points[off], found.pixels[off]
    depth = mine.project(points)[1]

    def slope(
        pair: tuple[Camera, Camera] | None, seen: Callable[[Camera], np.ndarray]
    ) -> np.ndarray:
        if pair is None:
            return np.zeros(len(pixels))
        ahead, behind = pair
        return ((seen(ahead) - seen(behind)) * across).sum(axis=-1) / (2 * STEP)

    def moved_here(camera: Camera) -> np.ndarray:
        return pixels_of(theirs, camera.unproject(pixels, depth))

    def moved_there(camera: Camera) -> np.ndarray:
        return pixels_of(camera, points)

    here = [slope(pair, moved_here) for pair in aside[view]]
    there = [slope(pair, moved_there) for pair in aside[other]]
    return distance[off], np.stack([*here, *there], axis=-1)
