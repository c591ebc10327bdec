"""The signed distance to a hull's surface, on a coarser grid."""

from __future__ import annotations

import math
from functools import partial

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int16
from torch import Tensor

from toonset.nerf.hull.hull import LEVEL, Hull, grown
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.kernels.volume import Volume

REACH = 6.0  # coarse voxels: distances are clipped beyond
BESIDE = 1.5  # voxels: nearer to the surface the support says where it lies
LEAST_SLOPE = 0.05  # of the support per voxel, where it says so
SLAB = 1 << 19  # cells whose passes stay in cache
UNKNOWN = 1 << 14  # more than any squared distance within reach, far from int16's end


def signed_distance(hull: Hull, factor: int) -> Volume:
    """Return the distance to the hull's surface in coarse voxels, negative inside."""
    x, y, z = (-n % factor for n in hull.support.shape)
    support = F.pad(hull.support, [0, z, 0, y, 0, x])
    inside = support >= LEVEL
    reach = math.ceil(REACH + 1) * factor
    sides = [partial(squared_distance, part, reach) for part in (inside, ~inside)]
    outer, inner = (squared.float().sqrt_() for squared in side_by_side(sides))
    distance = torch.where(inside, 0.5 - inner, outer - 0.5)
    beside = grown(inside, 1) & grown(~inside, 1)  # all with a distance below BESIDE, and no other
    distance[beside] = _between(support, beside, distance[beside])
    return F.avg_pool3d(distance[None] / factor, factor)[0].clamp_(-REACH, REACH)


def squared_distance(cells: Bool[Tensor, "x y z"], reach: int) -> Int16[Tensor, "x y z"]:
    """Return the squared distance to the nearest set cell, in cells; UNKNOWN or more beyond reach.

    Axis by axis, the least of the neighbours' values plus the squared way to them: under half the
    time of scipy's transform, which knows no limit. In slabs that stay in cache: half the time
    again.
    """
    volume = torch.full(cells.shape, UNKNOWN, dtype=torch.int16).masked_fill_(cells, 0)
    for axis, length in enumerate(cells.shape):
        least, across = volume.clone(), 0 if axis else 1
        thick = max(1, SLAB * cells.shape[across] // cells.numel())
        for here, nearest in zip(
            volume.split(thick, across), least.split(thick, across), strict=True
        ):
            for way in range(1, min(reach, length - 1) + 1):
                there = here + way**2
                for to, source in ((0, way), (way, 0)):
                    part = nearest.narrow(axis, to, length - way)
                    torch.minimum(part, there.narrow(axis, source, length - way), out=part)
        volume = least
    return volume


def _between(
    support: Float[Tensor, "x y z"],
    beside: Bool[Tensor, "x y z"],
    distance: Float[Tensor, " n"],
) -> Float[Tensor, " n"]:
    """Return how far from the voxels beside the surface the support is LEVEL, where it says so."""
    at = beside.nonzero()
    squares = torch.zeros(len(at))
    for axis, length in enumerate(support.shape):
        after, before = at.clone(), at.clone()
        after[:, axis] = (after[:, axis] + 1).clamp_max(length - 1)
        before[:, axis] = (before[:, axis] - 1).clamp_min(0)
        way = (after[:, axis] - before[:, axis]).clamp_min(1)
        squares += ((support[after.unbind(1)] - support[before.unbind(1)]) / way).square()
    slope = squares.sqrt()
    between = (LEVEL - support[beside]) / slope.clamp_min(LEAST_SLOPE)
    return torch.where(slope > LEAST_SLOPE, between.clamp(-BESIDE, BESIDE), distance)
