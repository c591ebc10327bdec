"""Fair a visual hull: the smoothest surface inside it that touches every outline ray.

Between the drawn views a visual hull is too large: eight views of a cylinder carve an octagon, 8 %
wider at its corners. A body is rounder than that. Among all surfaces inside the hull that touch
every ray through a drawn outline, the one that bends least is taken: on a coarse grid, the signed
distance f (negative inside, in voxels) minimises

    mean over outline rays of (min f along the ray)^2  +  stiffness * mean of (Laplacian f)^2
    + the square of how far f dips below the hull's own signed distance, per ray

by Adam over a pyramid of grids, stiff first, then softer. Where a ray touches is found anew in
every step, so the contact may slide along the ray. Thin parts that the coarse grid loses come back
from the hull: a ray through a drawing's mask keeps at least the voxels that f likes best, and capes
and blades, which hide each other from most views, are taken over whole.

Sources: thin-plate energy of an implicit surface, Turk and O'Brien, "Shape transformation using
variational implicit functions", 1999; contact of an outline ray with its surface, Cipolla and
Giblin, "Visual motion of curves and surfaces", 2000, chapter 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int, Int16
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.hull.fairing_fit import Contacts, fit
from toonset.nerf.hull.hull import LEVEL, Hull, grow
from toonset.nerf.hull.march import Rays, march, rays_of
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.kernels.volume import Volume, trilinear

COARSE = 64  # voxels along the longest side of the grid on which the surface bends
OUTLINE_RAYS = 8000  # of all views together
SLOPE = 0.7  # of the support per voxel of distance, where the fair surface makes the border
SHEET = 0.8  # coarse voxels: half the thickness of what the coarse grid has no room for
NEAREST = 2.0  # times a lost ray's least distance: what is as near is kept, too
SPOT = 0.01  # coarse voxels more, lest a ray hangs on a single voxel
ALL = 1 << 20  # samples per ray: no limit
REACH = 6.0  # coarse voxels: distances are clipped beyond
BESIDE = 1.5  # voxels: nearer to the surface the support says where it lies
LEAST_SLOPE = 0.05  # of the support per voxel, where it says so
SLAB = 1 << 19  # cells whose passes stay in cache
UNKNOWN = 1 << 14  # more than any squared distance within reach, far from int16's end


def fair_hull(
    hull: Hull, cameras: Sequence[Camera], alphas: Sequence[Tensor], slack: float = 0.0
) -> Hull:
    """Return the hull without the corners that no drawing asks for.

    Drawings that disagree have no common hull: the space on which all of them agree is too small.
    With slack, the surface may leave the hull by so much to meet all outlines in the mean.

    Args:
        hull: as carved from the same views.
        cameras: one per view.
        alphas: (height, width) coverage in [0, 1] per view.
        slack: how far outlines are off, in the hull's voxels.
    """
    reach = math.ceil(slack)
    hull = _padded(hull, reach)
    factor = max(1, round(max(hull.support.shape) / COARSE))
    outside = signed_distance(hull, factor) - slack / factor
    fair = fit(outside, _contacts(hull, factor, outside, cameras, alphas), len(cameras))
    x, y, z = hull.support.shape
    fine = F.interpolate(fair[None, None], scale_factor=factor, mode="trilinear")[0, 0, :x, :y, :z]
    smooth = (LEVEL - SLOPE * factor * fine).clamp_(0, 1).minimum(grow(hull.support, reach))
    sure = [
        _shrunk(alpha, math.ceil(slack * hull.voxel * camera.scale))
        for camera, alpha in zip(cameras, alphas, strict=True)
    ]
    kept = _lost(replace(hull, support=smooth), fine, hull, cameras, sure)
    if slack < 1:  # the hull of drawings that disagree has shards which no drawing shows
        kept |= sheets(hull, factor)
    return replace(hull, support=torch.where(grow(kept, 1), smooth.maximum(hull.support), smooth))


def _padded(hull: Hull, voxels: int) -> Hull:
    low, support = hull.low - voxels * hull.voxel, F.pad(hull.support, [voxels] * 6)
    return Hull(low, hull.voxel, support)


def _shrunk(alpha: Float[Tensor, "height width"], radius: int) -> Float[Tensor, "height width"]:
    return -F.max_pool2d(-alpha[None], 2 * radius + 1, stride=1, padding=radius)[0]


def _contacts(
    hull: Hull, factor: int, outside: Volume, cameras: Sequence[Camera], alphas: Sequence[Tensor]
) -> Contacts:
    most = max(1, OUTLINE_RAYS // len(cameras))
    parts = []
    for camera, alpha in zip(cameras, alphas, strict=True):
        pixels = outline_points(alpha.numpy())
        chosen = np.linspace(0, len(pixels) - 1, min(most, len(pixels))).astype(int)
        parts.append(rays_of(camera, pixels[chosen], hull))
    rays = Rays(*(torch.cat([getattr(p, n) for p in parts]) for n in Rays.__annotations__))
    coarse = Hull(hull.low, hull.voxel * factor, (LEVEL - outside).clamp(0, 1))
    samples = march(rays, coarse, coarse.voxel, ALL)
    hit, ray = torch.unique_consecutive(samples.ray, return_inverse=True)
    low = torch.as_tensor(hull.low, dtype=torch.float32)
    rows, weights = trilinear((samples.points - low) / coarse.voxel - 0.5, outside.shape)
    return Contacts(rows, weights, ray, len(hit))


def outline_points(alpha: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "n 2"]:
    """Return where the mask's outline crosses the lines between neighbouring pixels' centres.

    (x, y) in pixels, the first pixel's centre at 0.5; beyond the picture nothing is drawn.
    """
    padded = np.pad(alpha, 1)
    points = []
    for first, second, axis in ((padded[:-1], padded[1:], 1), (padded[:, :-1], padded[:, 1:], 0)):
        crossing = (first >= LEVEL) != (second >= LEVEL)
        rows, columns = np.nonzero(crossing)
        place = np.stack([columns, rows], axis=1) - 0.5
        place[:, axis] += (first[crossing] - LEVEL) / (first[crossing] - second[crossing])
        points.append(place)
    return np.concatenate(points)


def sheets(hull: Hull, factor: int) -> Bool[Tensor, "x y z"]:
    """Return the thin parts of a hull, such as capes and blades.

    Balls of radius SHEET are put wherever they lie wholly inside. Thin is what is farther than
    2 SHEET from all their centres; what is nearer and in no ball is a corner of a thick part.

    Args:
        hull: as carved.
        factor: its voxels per coarse voxel, along an axis.
    """
    radius = SHEET * factor
    inside = hull.support >= LEVEL
    core = squared_distance(~inside, math.ceil(radius)) > radius**2
    return inside & (squared_distance(core, math.ceil(2 * radius)) > (2 * radius) ** 2)


def _lost(
    fair: Hull, distance: Volume, hull: Hull, cameras: Sequence[Camera], alphas: Sequence[Tensor]
) -> Bool[Tensor, "x y z"]:
    """Return, for rays through masks that no longer meet the inside, their nearest voxels.

    A ray that just misses the surface keeps a spot; one that runs along a sheet which is lost as a
    whole keeps the sheet.
    """

    def nearest(camera: Camera, alpha: Tensor) -> Int[Tensor, " n"]:
        drawn = (alpha >= LEVEL).numpy()
        seen = np.zeros_like(drawn)
        pixels = np.argwhere(drawn)
        rays = rays_of(camera, pixels[:, ::-1] + 0.5, fair)
        hit = march(rays, fair, hull.voxel, 1, LEVEL).ray
        seen[tuple(pixels[hit].T)] = True
        missed = np.argwhere(drawn & ~seen)
        samples = march(rays_of(camera, missed[:, ::-1] + 0.5, hull), hull, hull.voxel, ALL, LEVEL)
        cells = hull.cell_index(samples.points, hull.support.shape, 1)
        values = distance.reshape(-1)[cells]
        best = torch.full((samples.rays,), torch.inf)
        best = best.scatter_reduce(0, samples.ray, values, "amin").clamp_min(0)
        return cells[values <= NEAREST * best[samples.ray] + SPOT]

    views = zip(cameras, alphas, strict=True)
    kept = torch.zeros(hull.support.numel(), dtype=torch.bool)
    kept[torch.cat(side_by_side([partial(nearest, *view) for view in views]))] = True
    return kept.view(hull.support.shape)


def signed_distance(hull: Hull, factor: int) -> Volume:
    """Return the distance to the hull's surface in coarse voxels, negative inside."""
    x, y, z = (-n % factor for n in hull.support.shape)
    support = F.pad(hull.support, [0, z, 0, y, 0, x])
    inside = support >= LEVEL
    reach = math.ceil(REACH + 1) * factor
    sides = [partial(squared_distance, part, reach) for part in (inside, ~inside)]
    outer, inner = (squared.float().sqrt_() for squared in side_by_side(sides))
    distance = torch.where(inside, 0.5 - inner, outer - 0.5)
    beside = grow(inside, 1) & grow(~inside, 1)  # all with a distance below BESIDE, and no other
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
    support: Float[Tensor, "x y z"], beside: Bool[Tensor, "x y z"], distance: Float[Tensor, " n"]
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
