"""Fit yaws, shifts and sizes of a sheet's cameras until its outlines are those of one body.

The residuals of `toonset.dataset.silhouettes.tangency` are fitted by each camera's shift, growth
and yaw (`toonset.dataset.silhouettes.empirical_bayes`), whose prior is

    |shift, 2 growth|^2 / tau^2 + (yaw / its sigma)^2

What outlines cannot tell is left as it was: the mean yaw, and the body's place and size.

Source: Hernandez, Schmitt, Cipolla, "Silhouette coherence for camera calibration under circular
motion", PAMI 2007, with distances instead of overlaps and a prior on every number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from toonset.camera import Camera, rotation_from_angles
from toonset.dataset.silhouettes.displacement import ShiftAndScale
from toonset.dataset.silhouettes.empirical_bayes import (
    Fit,
    Normal,
    Numbers,
    Prior,
    fit,
    unmoved,
    weighed,
)
from toonset.dataset.silhouettes.outlines import Outline, Outlines, Square
from toonset.dataset.silhouettes.register import NOISE, NOISE_PX, common
from toonset.dataset.silhouettes.tangency import Placed, Touch, pixels_of, touch

PLACE, YAW, OWN = slice(0, 3), 3, 4  # a camera's numbers: shift x, shift y, growth; yaw
STEP = 1e-3  # of central differences: of the square, or radians
# As cameras move, best points slide along their rays, which takes away about half of a
# disagreement's curvature: steps that hold the points are too short by as much
LENGTHENED = 1.6
ENOUGH = 0.98  # of the disagreement before a round: what gains no more is settled

_PLACES = ShiftAndScale.expected()


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
    deviation = np.zeros((views, OWN))
    deviation[:, PLACE] = np.sqrt(np.diag(_PLACES.covariance))
    deviation[:, YAW] = yaw_sigmas
    free = deviation > 0
    scaled = np.arange(OWN) != YAW  # by tau
    precision = np.divide(1, deviation**2, out=np.zeros_like(deviation), where=free)
    prior = Prior(*(np.diag((precision * part)[free]) for part in (scaled, ~scaled)))

    def all_of(some: Numbers) -> Float[np.ndarray, "views 4"]:
        own = np.zeros((views, OWN))
        own[free] = some[0]
        return own

    def linearise(some: Numbers, _: int = 0) -> list[Normal]:
        return [_linearised(outlines, all_of(some), free)]

    first = linearise(np.zeros((1, int(free.sum()))))
    found = unmoved(first, prior, tau)
    if found is None:
        body, shares = common(outlines, _PLACES)

        def gauge(some: Numbers) -> Numbers:
            own = all_of(some)
            own[:, PLACE] -= (body @ (shares @ own[:, PLACE].reshape(-1))).reshape(views, -1)
            if yaw_sigmas.all():
                own[:, YAW] -= np.average(own[:, YAW], weights=yaw_sigmas**-2)
            return own[free][None]

        found = fit(
            linearise, first, prior, tau, rounds, gauge=gauge, length=LENGTHENED, enough=ENOUGH
        )
    return replace(found, numbers=all_of(found.numbers))


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


def _linearised(
    outlines: Outlines, own: Float[np.ndarray, "views 4"], free: Bool[np.ndarray, "views 4"]
) -> Normal:
    """Return the normal equations of the free numbers at `own`."""
    views = tuple(
        replace(view, camera=move_camera(view.camera, view.square, numbers))
        for view, numbers in zip(outlines.views, own, strict=True)
    )
    aside = [
        _aside(view, numbers, movable)
        for view, numbers, movable in zip(outlines.views, own, free, strict=True)
    ]
    placed = Placed.of(replace(outlines, views=views), _PLACES, np.zeros((len(views), 3)))
    size = outlines.size_px
    sigma = max(NOISE * size, NOISE_PX)
    matrix, slope = np.zeros((own.size, own.size)), np.zeros(own.size)
    cost = squares = 0.0
    points = 0
    for view, outline in enumerate(views):
        found = touch(placed, view, outline.points)
        points += len(found.pixels)
        for other in range(len(views)):
            if other == view:
                continue
            residual, jacobian = _pair(views, aside, view, other, found)
            weight, own_cost = weighed(residual, sigma, size)
            used = _columns(view, other)
            matrix[np.ix_(used, used)] += jacobian.T @ (weight[:, None] * jacobian)
            slope[used] += jacobian.T @ (weight * residual)
            cost += own_cost
            squares += float((residual**2).sum())
    used = free.reshape(-1)
    return Normal(matrix[np.ix_(used, used)], slope[used], cost, squares, points)


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
