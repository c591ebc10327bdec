"""Compute which part of a trained field is solid, by transmittance from all round.

Inside of its hull a field is a mist that is dense enough to look solid from where it was drawn, so
no density is "the surface". Rays tell: from all round, level, a ray stops where it has gathered
half of the opacity that it will ever have. What lies in front of that in some direction is air:

    s_d(x) = 1/2 + half(T_d) - T_d(x),   half(T_d) = (1 + T_d(end)) / 2

with T_d(x) the transmittance between x and the viewer in direction d; x is stopped at where s_d is
1/2 or more in all directions. By the inequality of means a ray's own middle is never in front of
its half, so thin parts stay. Rays sink into mist everywhere, also where the hull is right, as its
outlines prove: what they stop at is grown by that usual depth, never out of the hull. So the hull
keeps its outlines and loses what it has too much, such as the corners of hollows.

Source: Kutulakos and Seitz, "A theory of shape by space carving", 2000, with opacity for photos.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from scipy import ndimage
from skimage.measure import label
from torch import Tensor

from toonset.errors import BundleError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import LEVEL, Hull, occupancy

DIRECTIONS = 16  # level, all round
POINTS_PER_CHUNK = 1 << 16
SMALLEST_PART = 1e-3  # of the largest part's volume; what is smaller is a speck
SMOOTHING = 1.0  # voxels, of what rays say: their steps are as long as a voxel
RAMP = 4.0  # voxels on either side of the surface over which values rise from 0 to 1
SOLID_FROM = 0.5


@dataclass(frozen=True, eq=False)
class Solid:
    """A volume whose surface lies where `values` are SOLID_FROM; its outermost layer is empty.

    Attributes:
        low: (3,) world position of the first value.
        voxel: distance of values, world units.
        values: (x, y, z) solid where >= SOLID_FROM.
    """

    low: Float[np.ndarray, " 3"]
    voxel: float
    values: Float[np.ndarray, "x y z"]


@torch.no_grad()
def solid_of(trained: TrainedField, progress: Callable[[float], None] = lambda done: None) -> Solid:
    """Compute the solid part of a trained field, without cavities and specks.

    Args:
        trained: the field.
        progress: told which share is done.

    Raises:
        BundleError: nothing is.
    """
    hull = trained.hull
    stopped = _stopped(trained, progress)
    support = hull.support.numpy() * (SOLID_FROM / LEVEL)
    grown = _grown(stopped >= SOLID_FROM, support >= SOLID_FROM)
    values = np.pad(np.minimum(support, grown), 1)
    return Solid(hull.low - hull.voxel / 2, hull.voxel, _whole(values))


def _stopped(
    trained: TrainedField, progress: Callable[[float], None]
) -> Float[np.ndarray, "x y z"]:
    """Return the smallest s_d of all directions at the hull's voxels, smoothed; 0 far from it."""
    hull = trained.hull
    near = hull.near.reshape(-1).nonzero()[:, 0]
    points = hull.centres()[near]
    progress(0.0)
    depth = _optical_depth(trained, near, points)
    least = torch.ones(len(points))
    for number in range(DIRECTIONS // 2):
        angle = 2 * math.pi * number / DIRECTIONS
        least = torch.minimum(least, _both_ways(depth, hull, points, angle))
        progress((number + 1) / (DIRECTIONS // 2))
    table = torch.zeros(hull.support.numel())
    table[near] = least
    return ndimage.gaussian_filter(table.view(hull.support.shape).numpy(), SMOOTHING)


def _grown(
    stopped: Bool[np.ndarray, "x y z"], inside: Bool[np.ndarray, "x y z"]
) -> Float[np.ndarray, "x y z"]:
    """Grow the cells that rays stop at by their usual depth below the hull's surface."""
    if not (stopped & inside).any():
        return np.zeros(stopped.shape)
    outward = _distance(~stopped)
    distance = outward - _distance(stopped)
    surface = inside & np.logical_not(ndimage.binary_erosion(inside))
    usual = float(np.median(outward[surface])) + 1  # the surface lies up to a voxel farther out
    rise = ndimage.gaussian_filter((usual - distance).clip(-RAMP, RAMP), SMOOTHING)
    return rise * (SOLID_FROM / RAMP) + SOLID_FROM


def _optical_depth(
    trained: TrainedField, near: Tensor, points: Float[Tensor, "n 3"]
) -> Float[Tensor, "x y z"]:
    """Return density times a voxel's edge at the voxels' centres."""
    hull = trained.hull
    density = torch.cat([trained.field(part)[0] for part in points.split(POINTS_PER_CHUNK)])
    table = torch.zeros(hull.support.numel())
    table[near] = density * occupancy(hull.support.reshape(-1)[near]) * hull.voxel
    return table.view(hull.support.shape)


def _both_ways(
    depth: Float[Tensor, "x y z"], hull: Hull, points: Float[Tensor, "n 3"], angle: float
) -> Float[Tensor, " n"]:
    """Return the smaller s_d of the module's equation for a direction and the opposite one.

    The volume is turned about +Y until rays run along its last axis.
    """
    nx, ny, nz = depth.shape
    side = math.ceil(math.hypot(nx, nz)) + 2
    c, s = math.cos(angle), math.sin(angle)
    at = (torch.arange(side) + 0.5 - side / 2)[:, None], (torch.arange(side) + 0.5 - side / 2)
    x, z = c * at[0] - s * at[1], s * at[0] + c * at[1]
    grid = torch.stack([z * (2 / nz), x * (2 / nx)], dim=-1)  # of planes (x, z), one per y
    planes = depth.permute(1, 0, 2)[None]
    turned = F.grid_sample(planes, grid[None], align_corners=False)[0]
    passed = turned.cumsum(dim=2)
    total = passed[:, :, -1:]
    ahead = torch.exp(-(passed - turned / 2))
    behind = torch.exp(-(total - passed + turned / 2))
    end = torch.exp(-total)
    clear = 0.5 + (1 + end) / 2 - torch.maximum(ahead, behind)
    clear = torch.where(end > 1 - SOLID_FROM, torch.zeros(()), clear)
    middle = torch.as_tensor((hull.box.low + hull.box.high) / 2, dtype=torch.float32)
    local = (points - middle) / hull.voxel
    across, along = c * local[:, 0] + s * local[:, 2], c * local[:, 2] - s * local[:, 0]
    places = torch.stack([along * (2 / side), across * (2 / side), local[:, 1] * (2 / ny)], dim=-1)
    return F.grid_sample(clear[None, None], places[None, None, None], align_corners=False).view(-1)


def _distance(cells: Bool[np.ndarray, "x y z"]) -> Float[np.ndarray, "x y z"]:
    """Return how many voxels each cell is away from one that is not in `cells`."""
    return np.asarray(ndimage.distance_transform_edt(cells))


def _whole(values: Float[np.ndarray, "x y z"]) -> Float[np.ndarray, "x y z"]:
    """Return the volume without cavities and without specks."""
    inside = values >= SOLID_FROM
    if not inside.any():
        raise BundleError("run: nothing is opaque, so there is no surface; train it for longer")
    parts = np.asarray(label(inside, connectivity=1))
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    kept: Bool[np.ndarray, "x y z"] = (sizes >= SMALLEST_PART * sizes.max())[parts]
    filled = ndimage.binary_fill_holes(kept)
    assert filled is not None
    result = np.where(kept | ~inside, values, 0)
    return np.where(filled & ~kept, 1.0, result).astype(np.float32)
