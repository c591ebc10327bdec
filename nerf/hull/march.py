"""March along rays, and keep the samples inside the hull.

Rays are cut into steps of one fixed length; a step's middle is a sample if the hull's support
reaches a level there. Marching runs on two grids: blocks of voxels first, voxels then.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.hull.hull import BLOCK, EDGE, LEVEL, Hull

RAYS_PER_CHUNK = 1 << 12  # intermediate arrays stay in cache
SPARE_STRIDES = 2  # looked up at first beyond those that would be enough if every step counted


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

    def at(self, index: slice | Tensor) -> Rays:
        """Return some of the rays."""
        parts = (self.origins, self.directions, self.start)
        if isinstance(index, slice):
            return Rays(*(part[index] for part in parts))
        return Rays(*(part.index_select(0, index) for part in parts))


@dataclass(frozen=True, eq=False)
class Samples:
    """The samples of many rays, packed ray after ray, near to far.

    Attributes:
        points: (n, 3) world positions.
        ray: (n,) which ray a sample belongs to, ascending.
        order: (n,) 0 for a ray's first sample, 1 for its second...
        distance: (n,) along the ray, world units, from the ray's origin.
        support: (n,) the hull's support there.
        rays: how many rays were asked for.
    """

    points: Float[Tensor, "n 3"]
    ray: Int[Tensor, " n"]
    order: Int[Tensor, " n"]
    distance: Float[Tensor, " n"]
    support: Float[Tensor, " n"]
    rays: int

    def at(self, index: Int[Tensor, " n"], order: Int[Tensor, " n"]) -> Samples:
        """Return some of the samples, with their numbers in their rays."""
        parts = (self.points, self.ray, self.distance, self.support)
        points, ray, distance, support = (part.index_select(0, index) for part in parts)
        return Samples(points, ray, order, distance, support, self.rays)

    def and_then(self, behind: Samples) -> Samples:
        """Return these samples and others of the same rays, all behind them."""
        names = ("points", "ray", "order", "distance", "support")
        pairs = {name: torch.cat([getattr(self, name), getattr(behind, name)]) for name in names}
        both = Samples(**pairs, rays=self.rays)
        in_front = torch.bincount(self.ray, minlength=self.rays)
        both.order[len(self.ray) :] += in_front[behind.ray]
        counts = in_front + torch.bincount(behind.ray, minlength=self.rays)
        place = both.order + (counts.cumsum(0) - counts)[both.ray]
        index = torch.empty_like(place).scatter_(0, place, torch.arange(len(place)))
        return both.at(index, both.order.index_select(0, index))

    def first(self, most: int) -> Samples:
        """Return the first `most` samples of every ray."""
        kept = (self.order < most).nonzero()[:, 0]
        return self if len(kept) == len(self.order) else self.at(kept, self.order[kept])


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


def pixels_near(camera: Camera, hull: Hull) -> Bool[np.ndarray, "height width"]:
    """Return the pixels whose rays may meet the hull; those left out certainly miss it.

    Every voxel that can hold a sample lies in a block, within 0.87 block edges of its centre.
    The picture is cut into tiles at least as large as a block appears, so the voxel appears in
    the tile of that centre or in one next to it.
    """
    width, height = camera.size_wh
    cells = np.argwhere(hull.blocks.numpy())
    edge = BLOCK * hull.voxel
    pixels, depth, in_front = camera.project(hull.low + edge * (cells + 0.5))
    relative = 1 + camera.k * (depth - edge)
    if not in_front.all() or relative.min(initial=1.0) <= 0:
        return np.ones((height, width), dtype=bool)  # the camera stands inside: nothing is sure
    scale = camera.scale * max(1.0, camera.pixel_aspect)
    tile = max(1.0, float((edge * scale / relative).max(initial=0.0)))
    shape = (int(height / tile) + 3, int(width / tile) + 3)  # one more tile on every side
    at = np.floor(pixels[:, ::-1] / tile).astype(int) + 1
    at = at[((at >= 0) & (at < shape)).all(axis=1)]
    tiles = np.zeros(shape, dtype=np.float32)
    tiles[at[:, 0], at[:, 1]] = 1
    near = F.max_pool2d(torch.as_tensor(tiles)[None], 3, stride=1, padding=1)[0].numpy() > 0
    rows, columns = (np.floor((np.arange(n) + 0.5) / tile).astype(int) + 1 for n in (height, width))
    return near[np.ix_(rows, columns)]


def march(rays: Rays, hull: Hull, step: float, most: int, level: float = EDGE) -> Samples:
    """Return the first `most` samples of every ray at which the support is `level` or more.

    Args:
        rays: where to look.
        hull: where samples may lie.
        step: distance of samples, world units.
        most: samples kept per ray.
        level: EDGE for the figure with its soft border, LEVEL for its inside alone.
    """
    total = len(rays.origins)
    bounds = range(0, max(total, 1), RAYS_PER_CHUNK)  # no rays: one empty chunk
    parts = [
        _march_chunk(rays.at(slice(i, i + RAYS_PER_CHUNK)), hull, step, most, level) for i in bounds
    ]
    ray = torch.cat([part.ray + i for part, i in zip(parts, bounds, strict=True)])
    points, order, distance, support = (
        torch.cat([getattr(part, name) for part in parts])
        for name in ("points", "order", "distance", "support")
    )
    return Samples(points, ray, order, distance, support, total)


def order_in_ray(ray: Int[Tensor, " n"], rays: int) -> Int[Tensor, " n"]:
    """Return each packed sample's number within its ray."""
    counts = torch.bincount(ray, minlength=rays)
    first = counts.cumsum(0) - counts
    return torch.arange(len(ray)) - first[ray]


def surface_depth(hull: Hull, camera: Camera) -> Float[np.ndarray, "height width"]:
    """Return the depth of the hull's surface past the camera's target, nan beside it."""
    width, height = camera.size_wh
    near = np.flatnonzero(pixels_near(camera, hull).reshape(-1))
    rays = rays_of(camera, camera.pixel_grid().reshape(-1, 2)[near], hull)
    samples = march(rays, hull, hull.voxel, 1, LEVEL)
    depth = np.full(width * height, np.nan)
    points = samples.points.numpy().astype(np.float64) - camera.target
    depth[near[samples.ray.numpy()]] = points @ camera.rotation[2]
    return depth.reshape(height, width)


def _march_chunk(rays: Rays, hull: Hull, step: float, most: int, level: float) -> Samples:
    near, far = clip(rays, hull)
    stride = max(1, int(BLOCK * hull.voxel / step + 1e-6))  # steps that stay next to one block
    strides = ((far - near) / (stride * step)).ceil().clamp_min(0)
    number = torch.arange(int(strides.max()) if len(strides) else 0)
    middle = near[:, None] + (stride * step) * (number + 0.5)
    hit = _along(rays, middle, hull, hull.blocks, BLOCK).logical_and_(number < strides[:, None])
    # most rays have what they need after few strides: the others go on
    front = hit & (hit.cumsum(1, dtype=torch.int16) <= most // stride + SPARE_STRIDES)
    lattice = _Lattice(rays, near, hull, step, stride, level)
    samples = lattice.samples(front)
    wanting = torch.bincount(samples.ray, minlength=len(near)) < most
    rest = (hit ^ front).logical_and_(wanting[:, None])
    if bool(rest.any()):
        samples = samples.and_then(lattice.samples(rest))
    return samples.first(most)


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Candidate samples of some rays; see `march` for the arguments.

    Attributes:
        rays: the rays.
        near: (rays,) where they enter the hull's box.
        hull, step, level: as of `march`.
        stride: steps that are looked up together.
    """

    rays: Rays
    near: Float[Tensor, " rays"]
    hull: Hull
    step: float
    stride: int
    level: float

    def samples(self, strides: Bool[Tensor, "rays strides"]) -> Samples:
        """Return the samples in these strides."""
        ray, number = strides.nonzero().unbind(1)
        step = (number * self.stride)[:, None] + torch.arange(self.stride)
        distance = self.near[ray][:, None] + self.step * (step + 0.5)
        close = _along(self.rays.at(ray), distance, self.hull, self.hull.near, 1)
        close = close.view(-1).nonzero()[:, 0]
        ray = ray.index_select(0, torch.div(close, self.stride, rounding_mode="floor"))
        distance = distance.view(-1).index_select(0, close)
        points = _points(self.rays, ray, distance)
        support = self.hull.support_at(points)
        every = Samples(points, ray, ray, distance, support, len(self.near))
        inside = every.at((support >= self.level).nonzero()[:, 0], ray)
        return replace(inside, order=order_in_ray(inside.ray, inside.rays))


def _along(
    rays: Rays,
    distance: Float[Tensor, "rays places"],
    hull: Hull,
    cells: Bool[Tensor, "x y z"],
    edge: int,
) -> Bool[Tensor, "rays places"]:
    """Return the cells (of `edge` voxels) in which places along rays lie; outside the nearest.

    Axis by axis, all rays at a time: a third of the time of making the points first.
    """
    index = torch.zeros(distance.shape, dtype=torch.int32)
    for axis, count in enumerate(cells.shape):
        slope = rays.directions[:, axis] / (hull.voxel * edge)
        start = (rays.origins[:, axis] - float(hull.low[axis])) / (hull.voxel * edge)
        cell = torch.addcmul(start[:, None], distance, slope[:, None]).int()
        index.mul_(count).add_(cell.clamp_(0, count - 1))
    return cells.reshape(-1).index_select(0, index.view(-1)).view(distance.shape)


def _points(
    rays: Rays, ray: Int[Tensor, " n"], distance: Float[Tensor, " n"]
) -> Float[Tensor, "n 3"]:
    origins, directions = rays.origins.index_select(0, ray), rays.directions.index_select(0, ray)
    return origins.addcmul_(directions, distance[:, None])


def clip(rays: Rays, hull: Hull) -> tuple[Float[Tensor, " n"], Float[Tensor, " n"]]:
    """Return where the rays enter and leave the hull's box (far < near: they miss it)."""
    low, high = (torch.as_tensor(c, dtype=torch.float32) for c in (hull.box.low, hull.box.high))
    parallel = rays.directions.abs() < 1e-9
    safe = torch.where(parallel, torch.full((), 1e-9), rays.directions)
    a, b = (low - rays.origins) / safe, (high - rays.origins) / safe
    near = torch.minimum(a, b).amax(dim=1).maximum(rays.start)
    return near, torch.maximum(a, b).amin(dim=1)
