"""The fairest surface inside a visual hull that still touches every outline ray.

Between the drawn views a visual hull is too large: eight views of a cylinder carve an octagon, 8 %
wider at its corners. A body is rounder than that. Among all surfaces inside the hull that touch
every ray through a drawn outline, the one that bends least is taken: on a coarse grid, the signed
distance f (negative inside, in voxels) minimises

    mean over outline rays of (min f along the ray)^2  +  BENDING * mean of (Laplacian f)^2
    + the square of how far f dips below the hull's own signed distance, per ray

by Adam over a pyramid of grids. Where a ray touches is found anew in every step, so the contact
may slide along the ray. Thin parts that the coarse grid loses come back from the hull: a ray
through a drawing's mask keeps at least the voxels that f likes best.

Sources: thin-plate energy of an implicit surface, Turk and O'Brien, "Shape transformation using
variational implicit functions", 1999; contact of an outline ray with its surface, Cipolla and
Giblin, "Visual motion of curves and surfaces", 2000, chapter 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from scipy import ndimage
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.adam import Adam, Group
from toonset.nerf.hull import LEVEL, Hull
from toonset.nerf.march import Rays, march, rays_of

COARSE = 64  # voxels along the longest side of the grid on which the surface bends
BENDING = 1.0  # weight of the Laplacian; half and double cost 0.1 to 0.3 dB on left-out views
OUTLINE_RAYS = 4000  # of all views together; half as many bend 5 % worse
STEPS, RATE, LAST_RATE = 100, 0.1, 0.1  # of Adam; the rate decays exponentially to a tenth
PYRAMID = (1, 2, 4, 8)  # coarse voxels per cell of each level
REACH = 6.0  # coarse voxels: distances are clipped beyond
BAND = 5.0  # coarse voxels from the hull's surface within which bending counts
SLOPE = 0.7  # of the support per voxel of distance, where the fair surface makes the border
NEAR_BEST = 0.98  # of a ray's best support: also kept, lest the ray hangs on a single voxel
ALL = 1 << 20  # samples per ray: no limit

Volume = Float[Tensor, "1 1 x y z"]


def faired(
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
    outside = _signed_distance(hull, factor) - slack / factor
    fair = _fit(outside, _contacts(hull, factor, outside, cameras, alphas))
    x, y, z = hull.support.shape
    fine = F.interpolate(fair, scale_factor=factor, mode="trilinear")[0, 0, :x, :y, :z]
    smooth = (LEVEL - SLOPE * factor * fine).clamp(0, 1).minimum(_grown(hull.support, reach))
    sure = [
        _shrunk(alpha, math.ceil(slack * hull.voxel * camera.scale))
        for camera, alpha in zip(cameras, alphas, strict=True)
    ]
    kept = _lost(replace(hull, support=smooth), hull, cameras, sure)
    return replace(hull, support=smooth.maximum(_grown(kept.float(), 1).minimum(hull.support)))


def _padded(hull: Hull, voxels: int) -> Hull:
    low, support = hull.low - voxels * hull.voxel, F.pad(hull.support, [voxels] * 6)
    return Hull(low, hull.voxel, support)


def _grown(volume: Float[Tensor, "x y z"], radius: int) -> Float[Tensor, "x y z"]:
    return F.max_pool3d(volume[None, None], 2 * radius + 1, stride=1, padding=radius)[0, 0]


def _shrunk(alpha: Float[Tensor, "height width"], radius: int) -> Float[Tensor, "height width"]:
    return -F.max_pool2d(-alpha[None], 2 * radius + 1, stride=1, padding=radius)[0]


@dataclass(frozen=True, eq=False)
class _Contacts:
    """Where outline rays may touch the surface.

    Attributes:
        points: (n, 3) in the units of `grid_sample`, packed ray after ray.
        ray: (n,) which ray a point belongs to, ascending from 0.
        rays: how many rays there are.
    """

    points: Float[Tensor, "n 3"]
    ray: Int[Tensor, " n"]
    rays: int

    def lowest(self, volume: Volume) -> Float[Tensor, "rays 3"]:
        """Return each ray's point of the smallest value."""
        values = _at(volume, self.points)
        best = values.new_full((self.rays,), torch.inf).scatter_reduce(0, self.ray, values, "amin")
        hits = (values <= best[self.ray]).nonzero()[:, 0]
        last = torch.zeros(self.rays, dtype=torch.long)
        return self.points[last.scatter_reduce(0, self.ray[hits], hits, "amax")]


def _signed_distance(hull: Hull, factor: int) -> Volume:
    """Return the distance to the hull's surface in coarse voxels, negative inside."""
    x, y, z = (-n % factor for n in hull.support.shape)
    support = F.pad(hull.support, [0, z, 0, y, 0, x]).numpy()
    inside = support >= LEVEL
    outer, inner = (np.asarray(ndimage.distance_transform_edt(p)) for p in (~inside, inside))
    distance = np.where(inside, 0.5 - inner, outer - 0.5)
    # beside the surface the support says where between two voxels it lies
    slope = np.sqrt(sum(np.square(part) for part in np.gradient(support)))
    beside = (np.abs(distance) < 1.5) & (slope > 0.05)
    between = ((LEVEL - support) / np.maximum(slope, 0.05)).clip(-1.5, 1.5)
    signed = torch.as_tensor(np.where(beside, between, distance), dtype=torch.float32)
    return F.avg_pool3d(signed[None, None] / factor, factor).clamp(-REACH, REACH)


def _contacts(
    hull: Hull,
    factor: int,
    outside: Volume,
    cameras: Sequence[Camera],
    alphas: Sequence[Tensor],
) -> _Contacts:
    most = max(1, OUTLINE_RAYS // len(cameras))
    parts = []
    for camera, alpha in zip(cameras, alphas, strict=True):
        pixels = outline_points(alpha.numpy())
        chosen = np.linspace(0, len(pixels) - 1, min(most, len(pixels))).astype(int)
        parts.append(rays_of(camera, pixels[chosen], hull))
    rays = Rays(*(torch.cat([getattr(p, n) for p in parts]) for n in Rays.__annotations__))
    coarse = Hull(hull.low, hull.voxel * factor, (LEVEL - outside[0, 0]).clamp(0, 1))
    samples = march(rays, coarse, coarse.voxel, ALL)
    hit, ray = torch.unique_consecutive(samples.ray, return_inverse=True)
    low = torch.as_tensor(hull.low, dtype=torch.float32)
    size = torch.tensor(outside.shape[2:], dtype=torch.float32) * coarse.voxel
    return _Contacts(((samples.points - low) * (2 / size) - 1).flip(-1), ray, len(hit))


def outline_points(alpha: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "n 2"]:
    """Return where the mask's outline crosses the lines between neighbouring pixels' centres.

    (x, y) in pixels, the first pixel's centre at 0.5; beyond the picture nothing is drawn.
    """
    padded = np.pad(alpha, 1)
    points = []
    for first, second, axis in (
        (padded[:-1], padded[1:], 1),
        (padded[:, :-1], padded[:, 1:], 0),
    ):
        crossing = (first >= LEVEL) != (second >= LEVEL)
        rows, columns = np.nonzero(crossing)
        place = np.stack([columns, rows], axis=1) - 0.5
        place[:, axis] += (first[crossing] - LEVEL) / (first[crossing] - second[crossing])
        points.append(place)
    return np.concatenate(points)


def _fit(outside: Volume, contacts: _Contacts) -> Volume:
    """Return the fair signed distance; `outside` is the hull's."""
    sizes = [[-(-n // cell) for n in outside.shape[2:]] for cell in PYRAMID]
    levels = [torch.zeros(1, 1, *size, requires_grad=True) for size in sizes]
    optimizer = Adam([Group(levels, RATE)])
    band = _inner(outside.abs() < BAND).float()
    bending = BENDING / band.sum()
    touching = contacts.points[:0]
    for step in range(STEPS):
        fair = outside + _sum(levels, outside.shape)
        if step % 2 == 0:
            touching = contacts.lowest(fair.detach().maximum(outside))
        dip = F.relu(outside - fair).square().sum() / contacts.rays
        bend = (_laplacian(fair) * band).square().sum()
        loss = _at(fair, touching).square().mean() + bending * bend + dip
        loss.backward()
        optimizer.step(LAST_RATE ** (step / STEPS))
    with torch.no_grad():
        return outside + _sum(levels, outside.shape)


def _sum(levels: Sequence[Tensor], shape: torch.Size) -> Volume:
    x, y, z = shape[2:]
    total = levels[0]
    for cell, level in zip(PYRAMID[1:], levels[1:], strict=True):
        up = F.interpolate(level, scale_factor=cell, mode="trilinear")
        total = total + up[..., :x, :y, :z]
    return total


def _inner(volume: Tensor) -> Tensor:
    return volume[..., 1:-1, 1:-1, 1:-1]


def _laplacian(f: Volume) -> Volume:
    """Return the sum of the six neighbours less six times the voxel, without the border."""
    around = f[..., 2:, 1:-1, 1:-1] + f[..., :-2, 1:-1, 1:-1]
    around = around + f[..., 1:-1, 2:, 1:-1] + f[..., 1:-1, :-2, 1:-1]
    around = around + f[..., 1:-1, 1:-1, 2:] + f[..., 1:-1, 1:-1, :-2]
    return around - 6 * _inner(f)


def _at(volume: Volume, points: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
    grid = points[None, None, None]
    return F.grid_sample(volume, grid, padding_mode="border", align_corners=False)[0, 0, 0, 0]


def _lost(
    fair: Hull, hull: Hull, cameras: Sequence[Camera], alphas: Sequence[Tensor]
) -> Bool[Tensor, "x y z"]:
    """Return, for rays through masks that no longer meet the inside, their best voxels."""
    kept = torch.zeros(hull.support.numel(), dtype=torch.bool)
    for camera, alpha in zip(cameras, alphas, strict=True):
        drawn = (alpha >= LEVEL).numpy()
        seen = np.zeros_like(drawn)
        pixels = np.argwhere(drawn)
        rays = rays_of(camera, pixels[:, ::-1] + 0.5, fair)
        hit = march(rays, fair, hull.voxel, 1, LEVEL).ray
        seen[tuple(pixels[hit].T)] = True
        missed = np.argwhere(drawn & ~seen)
        samples = march(rays_of(camera, missed[:, ::-1] + 0.5, hull), hull, hull.voxel, ALL, LEVEL)
        cells = hull.cell_index(samples.points, hull.support.shape, 1)
        values = fair.support.reshape(-1)[cells]
        best = torch.zeros(samples.rays).scatter_reduce(0, samples.ray, values, "amax")
        kept[cells[values >= NEAR_BEST * best[samples.ray]]] = True
    return kept.view(hull.support.shape)
