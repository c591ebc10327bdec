"""Cast a picture's rays through a baked field, skipping empty and hidden space.

The samples are those of `toonset.nerf.hull.march`, so a view shows what was trained. But a picture
needs only the front of what a ray meets: a ray begins where the hull may begin, goes on a few steps
at a time, steps over those that its voxel says are empty, and ends where it is opaque.

Source: steps by the distance to the nearest surface: Zuiderveld, Koning, Viergever, "Acceleration
of ray-casting using 3-D distance transforms", 1992.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import torch
from jaxtyping import Float, Int
from torch import Tensor

from toonset.nerf.render.baked import Baked
from toonset.nerf.render.rays import Paths, ViewRays

RAYS_PER_CHUNK = 1 << 14  # a chunk's arrays stay in a core's cache
FEWEST_STEPS, MOST_STEPS = 12, 32  # of a ray that are looked up together: more as rays get fewer
STEPS_PER_ROUND = 1 << 14  # in all, where rays are few enough
STEPS_PER_COLOR = 3  # that share one, read at their mean place
OPAQUE_FROM = 0.98  # opacity at which a ray ends; the colour seen until then stands for the rest
FAINTEST = 1e-12  # weight of steps whose mean place is asked for


def cast(
    sight: ViewRays, pixels: Float[Tensor, "2 rays"], *, colored: bool = True
) -> Float[Tensor, "5 rays"]:
    """Return premultiplied colour, opacity, and depth times opacity of rays through pixels.

    A ray that reaches OPAQUE_FROM ends and counts as opaque. Without colours all is black.
    """
    between = sight.between(pixels)
    result = torch.zeros(5, pixels.shape[1])
    for part in (between[0] <= between[1]).nonzero()[:, 0].split(RAYS_PER_CHUNK):
        paths = sight.paths(pixels.index_select(1, part), between.index_select(1, part))
        result.scatter_(1, part.expand(5, -1), _cast(sight.baked, paths, colored))
    return result


@dataclass(frozen=True, eq=False)
class _Rays:
    """State of some rays while they are cast.

    Attributes:
        ray: (n,) which they are.
        place: (3, n) of their next step.
        ahead: (3, n) from a step to the next.
        number: (n,) of their next step.
        last: (n,) number from which on nothing is met.
        left: (n,) light that reaches the next step.
        seen: (4, n) premultiplied colour, and numbers of steps weighted with their opacity.
    """

    ray: Int[Tensor, " n"]
    place: Float[Tensor, "3 n"]
    ahead: Float[Tensor, "3 n"]
    number: Float[Tensor, " n"]
    last: Float[Tensor, " n"]
    left: Float[Tensor, " n"]
    seen: Float[Tensor, "4 n"]

    def at(self, index: Int[Tensor, " n"]) -> _Rays:
        """Return some of them."""
        return _Rays(*(part.index_select(-1, index) for part in vars(self).values()))

    def advanced(self, baked: Baked, steps: int, colored: bool) -> _Rays:
        """Return them some steps on, and over what is empty behind these."""
        number = torch.arange(steps, dtype=torch.float32)[:, None]
        place, ahead = self.place[:, None], self.ahead[:, None]
        depth = baked.optical_depth(torch.addcmul(place, ahead, number))
        left = torch.zeros(steps + 1, len(self.ray))
        torch.cumsum(depth, dim=0, out=left[1:])
        left.neg_().exp_().mul_(self.left)
        weights, moments = (_sums(steps) @ left).view(2, -1, len(self.ray))
        mean = moments / weights.clamp_min(FAINTEST)
        seen = self.seen.clone()
        if colored:
            seen[:3] += baked.rgb(torch.addcmul(place, ahead, mean)).mul_(weights).sum(dim=1)
        seen[3] += moments.sum(dim=0).addcmul_(weights.sum(dim=0), self.number)
        passed = torch.full_like(self.left, steps)
        lost = (left[-1] == self.left).nonzero()[:, 0]  # nothing was met: look how far that goes
        ended = torch.add(self.place, self.ahead, alpha=steps).index_select(1, lost)
        passed.index_add_(0, lost, baked.leap(ended))
        return _Rays(
            self.ray,
            torch.addcmul(self.place, self.ahead, passed),
            self.ahead,
            self.number + passed,
            self.last,
            left[-1],
            seen,
        )


def _cast(baked: Baked, paths: Paths, colored: bool) -> Float[Tensor, "5 rays"]:
    count = len(paths.entry)
    place = torch.addcmul(paths.first, paths.ahead, paths.entry)
    nothing, light = torch.zeros(4, count), torch.ones(count)
    rays = _Rays(torch.arange(count), place, paths.ahead, paths.entry, paths.exit, light, nothing)
    result = torch.zeros(5, count)
    while len(rays.ray):
        steps = min(max(STEPS_PER_ROUND // len(rays.ray), FEWEST_STEPS), MOST_STEPS)
        rays = rays.advanced(baked, steps // STEPS_PER_COLOR * STEPS_PER_COLOR, colored)
        on = (rays.number < rays.last) & (rays.left > 1 - OPAQUE_FROM)
        ended = rays.at((~on).nonzero()[:, 0])
        result.scatter_(1, ended.ray.expand(5, -1), torch.cat([ended.seen, ended.left[None]]))
        rays = rays.at(on.nonzero()[:, 0])
    opacity = 1 - result[4]
    away = result[3] * paths.step + opacity * paths.depth
    seen = torch.cat([result[:3], opacity[None], away[None]])
    return torch.where(opacity >= OPAQUE_FROM, seen / opacity.clamp_min(OPAQUE_FROM), seen)


@cache
def _sums(steps: int) -> Float[Tensor, "sums steps+1"]:
    """Return what makes sums over every STEPS_PER_COLOR steps from the light between steps.

    Of their weights, which are differences of that light, and then of these times the numbers.
    """
    weights = torch.eye(steps, steps + 1) - torch.eye(steps, steps + 1).roll(1, dims=1)
    number = torch.arange(steps, dtype=torch.float32)[:, None]
    both = torch.stack([weights, weights * number])
    return both.view(2, -1, STEPS_PER_COLOR, steps + 1).sum(dim=2).view(-1, steps + 1)
