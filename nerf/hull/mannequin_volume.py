"""A mannequin as a hull: the space that its surface encloses."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
import torch
from jaxtyping import Bool, Float
from scipy import ndimage

from toonset.nerf.hull.fairing import SLOPE, squared_distance
from toonset.nerf.hull.hull import LEVEL, Hull
from toonset.nerf.hull.mannequin_shape import Shape

ROOM = 6  # voxels round the shape
REACH = 3  # voxels from its surface to where the support is 0 or 1
DENSE = 0.45  # voxels between points of the surface: none is missed
PROTRUDES = 0.4  # voxels that are taken off: a voxel that the surface only touches counts whole


def hull_of_shape(shape: Shape, voxel: float) -> Hull:
    """Return the hull of a shape.

    Voxels that the surface passes through, and those that it encloses, are inside. A mesh with
    holes encloses what it hides from all six sides.

    Args:
        shape: the surface.
        voxel: edge, world units.
    """
    beyond = shape.beyond / voxel
    reach = math.ceil(REACH + beyond)
    low = shape.vertices.min(axis=0) - (ROOM + beyond) * voxel
    extent = shape.vertices.max(axis=0) - low
    counts = np.ceil(extent / voxel + beyond).astype(int) + ROOM
    touched = np.zeros(counts, dtype=bool)
    touched[tuple(((_points(shape, DENSE * voxel) - low) / voxel).astype(np.int32).T)] = True
    inside = torch.from_numpy(_enclosed(touched))
    outer, inner = (
        squared_distance(part, reach).float().sqrt_().clamp_(max=reach + 1)
        for part in (inside, ~inside)
    )
    distance = torch.where(inside, 0.5 - inner, outer - 0.5) + PROTRUDES - beyond
    return Hull(low, voxel, (LEVEL - SLOPE * distance).clamp_(0, 1))


def _enclosed(touched: Bool[np.ndarray, "x y z"]) -> Bool[np.ndarray, "x y z"]:
    """Return the voxels that are touched, that no way leads to, or that are hidden on all sides."""
    free, _ = cast("tuple[np.ndarray, int]", ndimage.label(~touched))
    hidden = np.ones_like(touched)
    for axis in range(3):
        for way in (slice(None), slice(None, None, -1)):
            at = tuple(way if k == axis else slice(None) for k in range(3))
            hidden &= np.logical_or.accumulate(touched[at], axis=axis)[at]
    return touched | hidden | (free != free[0, 0, 0])


def _points(shape: Shape, gap: float) -> Float[np.ndarray, "n 3"]:
    """Return points of the surface, no two neighbours farther apart than `gap`."""
    a, b, c = (shape.vertices[shape.faces[:, i]].astype(np.float32) for i in range(3))
    sides = [np.linalg.norm(one - other, axis=1) for one, other in ((a, b), (b, c), (c, a))]
    count = np.ceil(np.max(sides, axis=0) / gap).astype(int) + 1
    found = []
    for parts in np.unique(count):
        at = count == parts
        i, j = (grid.reshape(-1) for grid in np.indices((parts + 1, parts + 1)))
        u, v = (k[i + j <= parts, None].astype(np.float32) / parts for k in (i, j))
        one, two = b[at] - a[at], c[at] - a[at]
        found.append((a[at][:, None] + u * one[:, None] + v * two[:, None]).reshape(-1, 3))
    return np.concatenate(found)
