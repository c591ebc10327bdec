"""Solids as signed distance functions (negative inside), and triangles from them.

Source: the primitives and the smooth minimum are Inigo Quilez's "Distance functions", 2008 to 2023.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from skimage.measure import marching_cubes

Points = np.ndarray  # (n, 3)
Solid = Callable[[Points], np.ndarray]
Vector = tuple[float, float, float]

BOX = np.array([[-0.85, -0.1, -0.65], [0.85, 1.95, 0.65]])  # every solid lies in here
COARSE = 0.03  # grid on which a solid is searched for


def ellipsoid(center: Vector, radii: Vector) -> Solid:
    def distance(p: Points) -> np.ndarray:
        local = (p - np.array(center)) / np.array(radii)
        near = np.linalg.norm(local, axis=1)
        slope = np.linalg.norm(local / np.array(radii), axis=1)
        return near * (near - 1) / np.maximum(slope, 1e-9)

    return distance


def cone(a: Vector, b: Vector, radius_a: float, radius_b: float) -> Solid:
    """A limb: a ball at `a` that shrinks or grows to one at `b`."""

    def distance(p: Points) -> np.ndarray:
        axis = np.array(b) - np.array(a)
        t = np.clip((p - np.array(a)) @ axis / (axis @ axis), 0, 1)
        nearest = np.array(a) + t[:, None] * axis
        return np.linalg.norm(p - nearest, axis=1) - (radius_a + t * (radius_b - radius_a))

    return distance


def chain(points: list[Vector], radii: list[float], blend: float) -> Solid:
    """A bent limb through several points."""
    pieces = [cone(*pair, *radii[i : i + 2]) for i, pair in enumerate(pairwise(points))]
    return blended(blend, *pieces)


def ring(center: Vector, axis: Vector, radius: float, thickness: float) -> Solid:
    def distance(p: Points) -> np.ndarray:
        local = p - np.array(center)
        unit = np.array(axis) / np.linalg.norm(axis)
        along = local @ unit
        across = np.linalg.norm(local - along[:, None] * unit, axis=1) - radius
        return np.hypot(along, across) - thickness

    return distance


def box(center: Vector, halves: Vector, rounding: float) -> Solid:
    def distance(p: Points) -> np.ndarray:
        q = np.abs(p - np.array(center)) - np.array(halves) + rounding
        return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0) - rounding

    return distance


def slab(point: Vector, normal: Vector, half: float) -> Solid:
    def distance(p: Points) -> np.ndarray:
        unit = np.array(normal) / np.linalg.norm(normal)
        return np.abs((p - np.array(point)) @ unit) - half

    return distance


def below(point: Vector, normal: Vector) -> Solid:
    """The half space that `normal` points out of."""
    unit = np.array(normal) / np.linalg.norm(normal)
    return lambda p: (p - np.array(point)) @ unit


def blended(width: float, *solids: Solid) -> Solid:
    """The union with rounded seams `width` wide."""

    def distance(p: Points) -> np.ndarray:
        result = solids[0](p)
        for solid in solids[1:]:
            other = solid(p)
            h = np.clip(0.5 + 0.5 * (other - result) / width, 0, 1)
            result = other + (result - other) * h - width * h * (1 - h)
        return result

    return distance


def common(*solids: Solid) -> Solid:
    return lambda p: np.max([solid(p) for solid in solids], axis=0)


def rounded_common(width: float, *solids: Solid) -> Solid:
    """The common part, its edges rounded: coarse triangles follow it without teeth."""
    inverse = blended(width, *(negative(solid) for solid in solids))
    return negative(inverse)


def negative(solid: Solid) -> Solid:
    return lambda p: -solid(p)


def without(solid: Solid, hole: Solid) -> Solid:
    return lambda p: np.maximum(solid(p), -hole(p))


def grown(solid: Solid, by: float) -> Solid:
    return lambda p: solid(p) - by


def both_sides(solid: Solid) -> Solid:
    """The solid at x > 0 and its mirror image."""
    return lambda p: solid(np.column_stack([np.abs(p[:, 0]), p[:, 1:]]))


def flattened(solid: Solid, depth: float) -> Solid:
    """The solid with its z extent times `depth` (< 1)."""
    return lambda p: solid(p / [1, 1, depth]) * depth


def turned(solid: Solid, center: Vector, y_turn: float = 0.0, z_turn: float = 0.0) -> Solid:
    """The solid turned by radians about y, then z, through `center`."""
    cy, sy, cz, sz = np.cos(y_turn), np.sin(y_turn), np.cos(z_turn), np.sin(z_turn)
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return lambda p: solid((p - np.array(center)) @ (about_z @ about_y) + np.array(center))


def triangles(solid: Solid, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces (outside to the viewer's side) of a closed surface."""
    coarse = _grid(BOX[0], BOX[1], COARSE)
    inside = coarse.reshape(-1, 3)[solid(coarse.reshape(-1, 3)) < COARSE]
    low = inside.min(axis=0) - 2 * COARSE - 0.37 * cell  # no grid point on a mirror plane
    grid = _grid(low, inside.max(axis=0) + 2 * COARSE, cell)
    field = solid(grid.reshape(-1, 3)).reshape(grid.shape[:3])
    vertices, faces, _, _ = marching_cubes(field, 0.0, spacing=(cell,) * 3)
    return vertices + low, faces


def _grid(low: np.ndarray, high: np.ndarray, cell: float) -> np.ndarray:
    axes = [np.arange(a, b + cell, cell) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
