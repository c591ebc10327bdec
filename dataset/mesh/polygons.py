"""Divide polygons into triangles.

Triangles stay, convex polygons are fanned from their first corner, others are clipped ear by ear.
Source: ear clipping, G. H. Meisters, Polygons have ears, American Mathematical Monthly 82 (1975).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

FLAT = 1e-9  # of a polygon's area: a triangle with less turned the other way is only rounded


@dataclass(frozen=True, eq=False)
class Triangles:
    """The triangles of polygons.

    Attributes:
        corners: (m, 3) numbers of the polygons' corners, all polygons' one after the other.
        polygons: the polygon that every triangle is of, ascending.
    """

    corners: Int[np.ndarray, "triangles 3"]
    polygons: Int[np.ndarray, " triangles"]


def triangulate(
    vertices: Float[np.ndarray, "vertices 3"],
    indices: Int[np.ndarray, " corners"],
    sizes: Int[np.ndarray, " polygons"],
) -> Triangles:
    """Return the triangles of polygons, n - 2 of one with n corners, none of fewer than three.

    A polygon with a corner that does not exist, or that crosses itself, is fanned.

    Args:
        vertices: points.
        indices: of the corners of all polygons, one polygon after the other.
        sizes: number of corners of every polygon.
    """
    starts = np.cumsum(sizes) - sizes
    counts = np.maximum(sizes - 2, 0)
    polygons = np.repeat(np.arange(len(sizes)), counts)
    number = np.arange(len(polygons)) - np.repeat(np.cumsum(counts) - counts, counts)
    first = starts[polygons]
    corners = np.stack([first, first + number + 1, first + number + 2], axis=1)
    for polygon in _not_convex(vertices, indices, sizes, corners, polygons).tolist():
        own = slice(starts[polygon], starts[polygon] + sizes[polygon])
        place = np.searchsorted(polygons, polygon)
        clipped = _ears(vertices[indices[own]])
        corners[place : place + counts[polygon]] = starts[polygon] + clipped
    return Triangles(corners, polygons)


def _not_convex(
    vertices: Float[np.ndarray, "vertices 3"],
    indices: Int[np.ndarray, " corners"],
    sizes: Int[np.ndarray, " polygons"],
    corners: Int[np.ndarray, "triangles 3"],
    polygons: Int[np.ndarray, " triangles"],
) -> Int[np.ndarray, " some"]:
    """Return the polygons whose fan has a triangle that is turned the other way."""
    several = sizes[polygons] > 3
    corners, polygons = corners[several], polygons[several]
    if not len(polygons):
        return polygons
    inside = np.asarray((indices >= 0) & (indices < len(vertices)))
    known = np.asarray(inside[corners].all(axis=1))
    a, b, c = (vertices[np.where(inside, indices, 0)[corners[:, i]]] for i in range(3))
    with np.errstate(invalid="ignore", over="ignore"):
        crosses = np.where(known[:, None], np.cross(b - a, c - a), np.nan)
        normals = np.zeros((len(sizes), 3))  # twice the area
        np.add.at(normals, polygons, crosses)
        along = (crosses * normals[polygons]).sum(axis=1)
        turned = along < -FLAT * np.square(normals[polygons]).sum(axis=1)
        turned &= np.isfinite(normals[polygons]).all(axis=1)
    return np.unique(polygons[turned])


def _ears(points: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "n-2 3"]:
    """Return the triangles of one polygon as numbers of its corners."""
    flat = _projected(points)
    left, ears = list(range(len(points))), []
    place = misses = 0
    while len(left) > 3:
        place %= len(left)
        before, at, after = left[place - 1], left[place], left[(place + 1) % len(left)]
        if misses < len(left) and not _is_ear(flat, before, at, after, left):
            place, misses = place + 1, misses + 1
            continue
        if misses >= len(left):  # it crosses itself: the rest is fanned
            ears += [(left[0], left[i], left[i + 1]) for i in range(1, len(left) - 1)]
            return np.array(ears)
        ears.append((before, at, after))
        del left[place]
        misses = 0
    return np.array([*ears, tuple(left)])


def _projected(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
    """Return a polygon in its plane, counter-clockwise."""
    shifted = points - points[0]
    normal = np.cross(shifted[1:-1], shifted[2:]).sum(axis=0)
    axis = int(np.abs(normal).argmax())
    flat = np.delete(shifted, axis, axis=1)
    return flat if (normal[axis] > 0) == (axis != 1) else flat * [-1, 1]


def _is_ear(
    flat: Float[np.ndarray, "n 2"], before: int, at: int, after: int, left: list[int]
) -> bool:
    """Return whether a corner sticks out, and no other one lies in its triangle."""
    a, b, c = flat[before], flat[at], flat[after]
    if _side(a, b, c) <= 0:
        return False
    others = flat[[i for i in left if i not in (before, at, after)]]
    inside = (_side(a, b, others) >= 0) & (_side(b, c, others) >= 0) & (_side(c, a, others) >= 0)
    corner = [(others == point).all(axis=1) for point in (a, b, c)]  # a slit to a hole comes twice
    return not (inside & ~np.any(corner, axis=0)).any()


def _side(
    a: Float[np.ndarray, " 2"], b: Float[np.ndarray, " 2"], points: Float[np.ndarray, "*n 2"]
) -> Float[np.ndarray, "*n"]:
    """Return twice the area of (a, b, point), positive where it lies to the left."""
    (x, y), away = b - a, points - a
    return np.asarray(x * away[..., 1] - y * away[..., 0])
