"""Rays through a baked field, for a picture: no work in empty space or behind what is opaque.

The samples are those of `toonset.nerf.march`, so a view shows what was trained. But a picture needs
only the front of what a ray meets: a ray leaps over the steps that its voxel says are empty, looks
at a few where it says nothing, and ends where it is opaque.

Source: leaps by the distance to the nearest surface: Zuiderveld, Koning, Viergever, "Acceleration
of ray-casting using 3-D distance transforms", 1992.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from toonset.nerf.march import Rays, clip
from toonset.nerf.views_bake import Baked

RAYS_PER_CHUNK = 1 << 14  # a chunk's arrays stay in a core's cache
FEWEST_STEPS, MOST_STEPS = 8, 32  # of a ray that are looked up together: more as rays get fewer
STEPS_PER_ROUND = 1 << 15  # in all, where rays are few enough
SHORT = 0.25  # of these steps: less empty space is not worth a leap
OPAQUE_FROM = 0.98  # opacity at which a ray ends; the colour seen until then stands for the rest


def cast(baked: Baked, rays: Rays) -> Float[Tensor, "rays 5"]:
    """Return premultiplied colour, opacity, and distance weighted with opacity, of every ray.

    A ray that reaches OPAQUE_FROM ends and counts as opaque.
    """
    starts = range(0, max(len(rays.origins), 1), RAYS_PER_CHUNK)
    return torch.cat([_cast(baked, rays.at(slice(i, i + RAYS_PER_CHUNK))) for i in starts])


def _cast(baked: Baked, rays: Rays) -> Float[Tensor, "rays 5"]:
    paths = _Paths.of(rays, baked)
    result = torch.zeros(len(rays.origins), 5)
    ray = (paths.count > 0).nonzero()[:, 0]
    number = torch.zeros(len(ray))
    while len(ray):
        steps = min(max(STEPS_PER_ROUND // len(ray), FEWEST_STEPS), MOST_STEPS)
        empty = paths.empty_steps(baked, ray, number)
        meets = (empty <= SHORT * steps).nonzero()[:, 0]
        if len(meets):
            seen = ray.index_select(0, meets)
            first = number.index_select(0, meets)
            front = result.index_select(0, seen)
            result.index_copy_(
                0, seen, front + _seen(baked, paths, seen, first, steps, front[:, 3])
            )
            empty.index_fill_(0, meets, steps)
        number += empty
        inside = number < paths.count.index_select(0, ray)
        on = (inside & (result[:, 3].index_select(0, ray) < OPAQUE_FROM)).nonzero()[:, 0]
        ray, number = ray.index_select(0, on), number.index_select(0, on)
    full = result[:, 3:4] >= OPAQUE_FROM
    return torch.where(full, result / result[:, 3:4].clamp_min(OPAQUE_FROM), result)


def _seen(
    baked: Baked,
    paths: _Paths,
    ray: Int[Tensor, " n"],
    first: Float[Tensor, " n"],
    steps: int,
    before: Float[Tensor, " n"],
) -> Float[Tensor, "n 5"]:
    """Return what some steps of some rays add, `before` being the opacity in front of them."""
    number = first[:, None] + torch.arange(steps)
    found = baked.at(paths.places(ray, number))
    left = torch.exp(-found.depth.cumsum(dim=1)) * (1 - before)[:, None]
    weights = torch.cat([(1 - before)[:, None], left], dim=1).diff(dim=1).neg_()
    distance = (weights * number).sum(dim=1) + 0.5 * weights.sum(dim=1)
    color = found.color(weights)
    away = paths.near.index_select(0, ray) * color[:, 3] + paths.step * distance
    return torch.cat([color, away[:, None]], dim=1)


@dataclass(frozen=True, eq=False)
class _Paths:
    """The steps of some rays.

    Attributes:
        near: (rays,) where they enter the hull's box.
        count: (rays,) steps until they leave it.
        step: distance of samples.
        first: (3, rays) a ray's first sample, in voxels.
        ahead: (3, rays) from a sample to the next, in voxels.
        leap: steps in a voxel's edge.
    """

    near: Float[Tensor, " rays"]
    count: Float[Tensor, " rays"]
    step: float
    first: Float[Tensor, "3 rays"]
    ahead: Float[Tensor, "3 rays"]
    leap: float

    @classmethod
    def of(cls, rays: Rays, baked: Baked) -> _Paths:
        hull, step = baked.trained.hull, baked.trained.step
        near, far = clip(rays, hull)
        middle = rays.origins + rays.directions * (near + step / 2)[:, None]
        ahead = (rays.directions * (step / hull.voxel)).T.contiguous()
        return cls(near, (far - near) / step, step, baked.place(middle), ahead, hull.voxel / step)

    def places(
        self, ray: Int[Tensor, " n"], number: Float[Tensor, "n steps"]
    ) -> list[Float[Tensor, "n steps"]]:
        """Return the coordinates, axis by axis, of steps of some rays."""
        first, ahead = (at.index_select(1, ray)[..., None] for at in (self.first, self.ahead))
        return [torch.addcmul(first[i], ahead[i], number) for i in range(3)]

    def empty_steps(
        self, baked: Baked, ray: Int[Tensor, " n"], number: Float[Tensor, " n"]
    ) -> Float[Tensor, " n"]:
        """Return how many steps, from these numbers on, certainly hold nothing."""
        clear = baked.clearance(self.places(ray, number[:, None]))[:, 0].float()
        return torch.where(clear > 0, ((clear - 1) * self.leap).floor() + 1, 0.0)
