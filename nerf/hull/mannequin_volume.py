"""Convert a mannequin to a hull: the space that its surface encloses."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from scipy import ndimage

from toonset.nerf.hull.fairing import SLOPE, squared_distance
from toonset.nerf.hull.hull import LEVEL, Hull
from toonset.nerf.hull.mannequin_shape import Shape

ROOM = 6  # voxels round the shape
REACH = 3  # voxels from its surface to where the support is 0 or 1
DENSE = 0.45  # voxels between points of the surface: none is missed
AT_ONCE = 1 << 20  # points; bounds memory
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
    inside = torch.from_numpy(_enclosed(_touched(shape, low, voxel, counts)))
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


def _touched(
    shape: Shape, low: Float[np.ndarray, " 3"], voxel: float, counts: Int[np.ndarray, " 3"]
) -> Bool[np.ndarray, "x y z"]:
    """Return the voxels that the surface passes through, by points DENSE voxels apart on it.

    Rows of points run along every triangle's longest side, from it to the corner across.
    """
    touched = np.zeros(counts, dtype=bool)
    corners = ((shape.vertices[shape.faces] - low) / voxel).astype(np.float32)
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    order = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(corners, order[..., None], axis=1), 1, 0)
    longest = sides.max(axis=1)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(longest, 1e-6)
    along, rows = (np.ceil(size / DENSE).astype(np.int64) + 1 for size in (longest, height))
    each = along * rows
    ends = np.cumsum(each)
    for cut in np.split(np.arange(len(ends)), np.flatnonzero(np.diff(ends // AT_ONCE)) + 1):
        face = np.repeat(cut, each[cut])
        first = ends[cut] - each[cut]
        index = np.arange(len(face)) + first[0] - np.repeat(first, each[cut])
        u = (index % along[face] / np.maximum(along[face] - 1, 1))[:, None].astype(np.float32)
        v = (index // along[face] / np.maximum(rows[face] - 1, 1))[:, None].astype(np.float32)
        points = (1 - v) * (a[face] + u * (b[face] - a[face])) + v * c[face]
        touched[tuple(points.astype(np.int32).T)] = True
    return touched
