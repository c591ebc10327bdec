"""Rays through a baked field, for a picture: no work behind what is opaque.

The samples are those of `toonset.nerf.march`, so a view shows what was trained. But a picture needs
only the front of what a ray meets: a stretch of each ray is looked up at its middle, the first
stretches that may hold anything are shaded, and only rays that are not opaque yet go on.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from toonset.nerf.march import Rays, clip
from toonset.nerf.rendering import compositing_weights
from toonset.nerf.views_bake import REACH, Baked

RAYS_PER_CHUNK = 1 << 12  # a chunk's arrays stay in a core's cache
STRETCHES = 4  # shaded together
OPAQUE_FROM = 0.98  # opacity at which a ray ends; the colour seen until then stands for the rest


def cast(baked: Baked, rays: Rays) -> Float[Tensor, "rays 5"]:
    """Return premultiplied colour, opacity, and distance weighted with opacity, of every ray.

    A ray that reaches OPAQUE_FROM ends and counts as opaque.
    """
    starts = range(0, max(len(rays.origins), 1), RAYS_PER_CHUNK)
    return torch.cat([_cast(baked, rays.at(slice(i, i + RAYS_PER_CHUNK))) for i in starts])


def _cast(baked: Baked, rays: Rays) -> Float[Tensor, "rays 5"]:
    lattice = _Lattice.of(rays, baked)
    result = torch.zeros(len(rays.origins), 5)
    filled = lattice.filled(baked)
    ray = torch.arange(len(result))
    going_on = filled.any(dim=1)
    while bool(going_on.any()):
        ray, filled = ray[going_on], filled[going_on]
        first = filled.to(torch.uint8).argmax(dim=1)
        result.index_add_(0, ray, _shaded(baked, lattice, ray, first, result[ray, 3]))
        filled &= torch.arange(filled.shape[1]) >= (first + STRETCHES)[:, None]
        going_on = filled.any(dim=1) & (result[ray, 3] < OPAQUE_FROM)
    full = result[:, 3:4] >= OPAQUE_FROM
    return torch.where(full, result / result[:, 3:4].clamp_min(OPAQUE_FROM), result)


def _shaded(
    baked: Baked,
    lattice: _Lattice,
    ray: Int[Tensor, " n"],
    first: Int[Tensor, " n"],
    before: Float[Tensor, " n"],
) -> Float[Tensor, "n 5"]:
    """Return what some stretches of some rays add, `before` being the opacity in front of them."""
    distance = lattice.distances(ray, first)
    points = lattice.points(ray, distance)
    shaded = baked.at(points.view(-1, 3)).view(*distance.shape, 4)
    weights = compositing_weights(shaded[..., 0]) * (1 - before)[:, None]
    shaded[..., 0] = distance
    sums = torch.bmm(weights[:, None], shaded)[:, 0]
    return torch.cat([sums[:, 1:], weights.sum(1, keepdim=True), sums[:, :1]], dim=1)


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Where the steps of some rays lie.

    Attributes:
        rays: the rays.
        near, length: (rays,) where they enter the hull's box, and how long they stay in it.
        step: distance of samples.
        steps: in a stretch, which is no longer than what one look-up answers for.
    """

    rays: Rays
    near: Float[Tensor, " rays"]
    length: Float[Tensor, " rays"]
    step: float
    steps: int

    @classmethod
    def of(cls, rays: Rays, baked: Baked) -> _Lattice:
        hull, step = baked.trained.hull, baked.trained.step
        near, far = clip(rays, hull)
        steps = max(1, int(2 * REACH * hull.voxel / step + 1e-6))
        return cls(rays, near, far - near, step, steps)

    def filled(self, baked: Baked) -> Bool[Tensor, "rays stretches"]:
        """Return which stretches of every ray may meet anything."""
        long = self.steps * self.step
        longest = float(self.length.max()) if len(self.length) else 0.0
        begin = long * torch.arange(max(0, int(longest / long) + 1))
        middle = self.near[:, None] + begin + long / 2
        points = self.points(torch.arange(len(middle)), middle).view(-1, 3)
        found = baked.near_something(points).view(middle.shape)
        return found & (begin < self.length[:, None])

    def distances(
        self, ray: Int[Tensor, " n"], first: Int[Tensor, " n"]
    ) -> Float[Tensor, "n steps"]:
        """Return how far along the rays the steps of STRETCHES stretches lie."""
        inside = self.step * (torch.arange(STRETCHES * self.steps) + 0.5)
        return (self.near[ray] + first * (self.steps * self.step))[:, None] + inside

    def points(
        self, ray: Int[Tensor, " n"], distance: Float[Tensor, "n steps"]
    ) -> Float[Tensor, "n steps 3"]:
        """Return the places at some distances along some rays."""
        origins, directions = self.rays.origins[ray, None], self.rays.directions[ray, None]
        return torch.addcmul(origins, directions, distance[..., None])
