"""Samples along rays, kept only inside the hull.

Rays are cut into steps of one fixed length; a step's middle is a sample if the hull's support is at
least one half there. Marching runs on the inside of two grids: blocks of voxels first, voxels then.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.hull import BLOCK, LEVEL, Hull

RAYS_PER_CHUNK = 1 << 14


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays in the world.

    Attributes:
        origins: (n, 3) the ray's point nearest to the middle of the hull (single precision loses
            nothing there, however far the camera is).
        directions: (n, 3) unit length, away from the viewer.
        start: (n,) distance at which the ray begins: the camera's centre, or -inf.
    """

    origins: Float[Tensor, "n 3"]
    directions: Float[Tensor, "n 3"]
    start: Float[Tensor, " n"]


@dataclass(frozen=True, eq=False)
class Samples:
    """The samples of many rays, packed ray after ray, near to far.

    Attributes:
        points: (n, 3) world positions.
        ray: (n,) which ray a sample belongs to, ascending.
        order: (n,) 0 for a ray's first sample, 1 for its second...
        distance: (n,) along the ray, world units, from the ray's origin.
        rays: how many rays were asked for.
    """

    points: Float[Tensor, "n 3"]
    ray: Int[Tensor, " n"]
    order: Int[Tensor, " n"]
    distance: Float[Tensor, " n"]
    rays: int


def rays_of(camera: Camera, pixels: Float[np.ndarray, "n 2"], hull: Hull) -> Rays:
    """Return the rays through `pixels` (first pixel's centre at 0.5)."""
    points, directions = camera.rays(pixels)
    middle = (hull.box.low + hull.box.high) / 2
    along = ((middle - points) * directions).sum(axis=-1, keepdims=True)
    origins = points + along * directions
    start = np.full(len(pixels), -np.inf)
    if not camera.is_orthographic:
        start = -((origins - camera.world_from_camera[:3, 3]) * directions).sum(axis=-1)
    return Rays(*(torch.as_tensor(a, dtype=torch.float32) for a in (origins, directions, start)))


def march(rays: Rays, hull: Hull, step: float, most: int) -> Samples:
    """Return the first `most` samples inside the hull of every ray.

    Args:
        rays: where to look.
        hull: where samples may lie.
        step: distance of samples, world units.
        most: samples kept per ray.
    """
    total = len(rays.origins)
    bounds = range(0, total, RAYS_PER_CHUNK)
    parts = [_march_chunk(rays, slice(i, i + RAYS_PER_CHUNK), hull, step) for i in bounds]
    ray = torch.cat([part[0] + i for part, i in zip(parts, bounds, strict=True)])
    distance = torch.cat([part[1] for part in parts])
    order = order_in_ray(ray, total)
    kept = order < most
    ray, distance, order = ray[kept], distance[kept], order[kept]
    return Samples(_points(rays, ray, distance), ray, order, distance, total)


def order_in_ray(ray: Int[Tensor, " n"], rays: int) -> Int[Tensor, " n"]:
    """Return each packed sample's number within its ray."""
    counts = torch.bincount(ray, minlength=rays)
    first = counts.cumsum(0) - counts
    return torch.arange(len(ray)) - first[ray]


def _march_chunk(
    rays: Rays, part: slice, hull: Hull, step: float
) -> tuple[Int[Tensor, " n"], Float[Tensor, " n"]]:
    rays = Rays(rays.origins[part], rays.directions[part], rays.start[part])
    near, far = _clip(rays, hull)
    stride = max(1, int(BLOCK * hull.voxel / step + 1e-6))  # steps that stay next to one block
    strides = ((far - near) / (stride * step)).ceil().clamp_min(0).long()
    ray = torch.repeat_interleave(torch.arange(len(near)), strides)
    number = order_in_ray(ray, len(near)) * stride
    middle = near[ray] + step * (number + stride / 2)
    hit = hull.lookup(hull.blocks, _points(rays, ray, middle), BLOCK)
    ray, number = ray[hit], number[hit]
    ray = ray.repeat_interleave(stride)
    number = (number[:, None] + torch.arange(stride)).reshape(-1)
    distance = near[ray] + step * (number + 0.5)
    close = hull.lookup(hull.near, _points(rays, ray, distance), 1)
    ray, distance = ray[close], distance[close]
    inside = hull.support_at(_points(rays, ray, distance)) >= LEVEL
    return ray[inside], distance[inside]


def _points(
    rays: Rays, ray: Int[Tensor, " n"], distance: Float[Tensor, " n"]
) -> Float[Tensor, "n 3"]:
    return torch.addcmul(rays.origins[ray], rays.directions[ray], distance[:, None])


def _clip(rays: Rays, hull: Hull) -> tuple[Float[Tensor, " n"], Float[Tensor, " n"]]:
    """Return where the rays enter and leave the hull's box (far < near: they miss it)."""
    low, high = (torch.as_tensor(c, dtype=torch.float32) for c in (hull.box.low, hull.box.high))
    parallel = rays.directions.abs() < 1e-9
    safe = torch.where(parallel, torch.full((), 1e-9), rays.directions)
    a, b = (low - rays.origins) / safe, (high - rays.origins) / safe
    near = torch.minimum(a, b).amax(dim=1).maximum(rays.start)
    return near, torch.maximum(a, b).amin(dim=1)
