"""Rounding a visual hull: the smooth body with the same outlines.

Between the drawn views a visual hull is too large: eight views of a cylinder carve an octagon, 8 %
wider at its corners. A body is rounder than that. So the hull is moved by its mean curvature
(blur, then keep what stays at least half full; Merriman, Bence, Osher 1992), but a ray through a
drawing's mask may never lose its last voxel: it keeps the one that the blur likes best. Outlines in
the drawn views stay, to the pixel; the corners between them go.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.hull import LEVEL, Hull
from toonset.nerf.march import march, rays_of

COARSE = 80  # voxels along the longest side while the surface moves
SIGMA = 1.5  # coarse voxels of blur per round, 2 % of the body's size
ROUNDS = 6
SOFTEN = 0.7  # coarse voxels: turns the last yes/no grid into a surface between the voxels
NEAR_BEST = 0.98  # of a ray's best value: also kept, lest the ray hangs on a single voxel
ALL = 1 << 20  # samples per ray: no limit


def rounded(hull: Hull, cameras: Sequence[Camera], alphas: Sequence[Tensor]) -> Hull:
    """Return the hull without the corners that no drawing asks for.

    Args:
        hull: as carved from the same views.
        cameras: one per view.
        alphas: (height, width) coverage in [0, 1] per view.
    """
    coarse = _coarse(hull)
    pins = _MaskRays.of(coarse, cameras, alphas, coarse.voxel * 0.7)
    inside = coarse.inside.float()
    filled = inside
    for _ in range(ROUNDS):
        smooth = _blurred(filled, SIGMA) * inside
        filled = torch.maximum((smooth >= LEVEL).float(), pins.last_voxels(smooth, 0.999).float())
    soft = _blurred(filled, SOFTEN)[None, None]
    x, y, z = hull.support.shape
    factor = round(coarse.voxel / hull.voxel)
    full = [factor * n for n in coarse.support.shape]
    smooth = F.interpolate(soft, size=full, mode="trilinear")[0, 0, :x, :y, :z]
    last = _MaskRays.of(hull, cameras, alphas, hull.voxel).last_voxels(smooth, NEAR_BEST)
    kept = F.max_pool3d(last[None, None].float(), 3, stride=1, padding=1)[0, 0]
    return replace(hull, support=torch.minimum(hull.support, torch.maximum(smooth, kept)))


def _coarse(hull: Hull) -> Hull:
    factor = max(1, round(max(hull.support.shape) / COARSE))
    x, y, z = (-n % factor for n in hull.support.shape)
    full = F.pad(hull.support[None, None], [0, z, 0, y, 0, x])
    return Hull(hull.low, hull.voxel * factor, F.avg_pool3d(full, factor)[0, 0])


def _blurred(volume: Float[Tensor, "x y z"], sigma: float) -> Float[Tensor, "x y z"]:
    radius = int(np.ceil(2.5 * sigma))
    kernel = torch.exp(-0.5 * (torch.arange(-radius, radius + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    result = volume[None, None]
    for axis in range(3):
        shape, padding = [1, 1, 1, 1, 1], [0, 0, 0]
        shape[2 + axis], padding[axis] = -1, radius
        result = F.conv3d(result, kernel.view(shape), padding=padding)
    return result[0, 0]


class _MaskRays:
    """Which voxels of a grid the rays through all masks' pixels meet inside the hull."""

    def __init__(self, cells: Int[Tensor, " n"], ray: Int[Tensor, " n"], rays: int) -> None:
        self.cells, self.ray, self.rays = cells, ray, rays

    @classmethod
    def of(
        cls, hull: Hull, cameras: Sequence[Camera], alphas: Sequence[Tensor], step: float
    ) -> _MaskRays:
        cells, ray, first = [], [], 0
        for camera, alpha in zip(cameras, alphas, strict=True):
            pixels = camera.pixel_grid()[(alpha >= LEVEL).numpy()]
            samples = march(rays_of(camera, pixels, hull), hull, step, ALL, LEVEL)
            cells.append(hull.cell_index(samples.points, hull.support.shape, 1))
            ray.append(samples.ray + first)
            first += samples.rays
        return cls(torch.cat(cells), torch.cat(ray), first)

    def last_voxels(self, volume: Float[Tensor, "x y z"], share: float) -> Bool[Tensor, "x y z"]:
        """Return, for rays that meet no value >= LEVEL, the voxels with >= `share` of the best."""
        values = volume.reshape(-1)[self.cells]
        best = torch.zeros(self.rays).scatter_reduce(0, self.ray, values, "amax")[self.ray]
        kept = torch.zeros(volume.numel(), dtype=torch.bool)
        kept[self.cells[(best < LEVEL) & (values >= share * best)]] = True
        return kept.view(volume.shape)
