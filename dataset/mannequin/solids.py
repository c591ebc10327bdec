"""Blend solids given as signed distance functions (negative inside).

A solid is a function from points to distances: exact for a limb, of the right sign and to first
order at the surface for the others, which is what meshing needs.

Source: the smooth minimum and the ellipsoid's estimate are Inigo Quilez's "Distance functions",
2008 to 2023.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

Points: TypeAlias = Float[np.ndarray, "points 3"]
Distances: TypeAlias = Float[np.ndarray, " points"]
Solid: TypeAlias = Callable[[Points], Distances]
Vector: TypeAlias = tuple[float, float, float]

SMALLEST = 1e-9  # keeps the centre of an ellipsoid, where its slope is zero, from dividing by it


def ellipsoid(center: Vector, radii: Vector) -> Solid:
    """Return an ellipsoid along the axes."""
    middle, halves = np.array(center), np.array(radii)

    def distance(points: Points) -> Distances:
        local = (points - middle) / halves
        near = np.linalg.norm(local, axis=1)
        slope = np.linalg.norm(local / halves, axis=1)
        return near * (near - 1) / np.maximum(slope, SMALLEST)

    return distance


def limb(a: Vector, b: Vector, radius_a: float, radius_b: float) -> Solid:
    """Return a bone with flesh: a ball at `a` that shrinks or grows to one at `b`."""
    start, axis = np.array(a), np.array(b) - np.array(a)

    def distance(points: Points) -> Distances:
        along = np.clip((points - start) @ axis / (axis @ axis), 0, 1)
        nearest = start + along[:, None] * axis
        radius = radius_a + along * (radius_b - radius_a)
        return np.linalg.norm(points - nearest, axis=1) - radius

    return distance


def joined(*solids: Solid) -> Solid:
    """Return the union."""
    return lambda points: reduce(np.minimum, (solid(points) for solid in solids))


def blended(width: float, *solids: Solid) -> Solid:
    """Return the union with seams rounded where two solids are nearer than `width`."""

    def distance(points: Points) -> Distances:
        return reduce(lambda a, b: _smooth_minimum(a, b, width), (s(points) for s in solids))

    return distance


def both_sides(solid: Solid) -> Solid:
    """Return the solid at x > 0 together with its mirror image."""
    return lambda points: solid(np.abs(points) * [1, 0, 0] + points * [0, 1, 1])


def _smooth_minimum(a: Distances, b: Distances, width: float) -> Distances:
    overlap = np.maximum(width - np.abs(a - b), 0) / width
    return np.minimum(a, b) - overlap**2 * width / 4
