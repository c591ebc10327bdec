"""Cast a picture's rays through a baked field, skipping empty and hidden space.

The samples are those of `toonset.nerf.hull.march`, so a view shows what was trained. But a picture
needs only the front of what a ray meets: a ray begins where the hull may begin, goes on a few steps
at a time, steps over those that its voxel says are empty, and ends where it is opaque.

Depths are past the plane through the hull's middle that is parallel to the picture, world units.
The voxels round what may be seen are drawn into a coarse picture of the nearest and farthest depth,
whose pixels are at least as large as a voxel appears: a place within a voxel lies in the pixel of
the voxel's centre or in one next to it, and not farther than CORNER from its depth.

Source: steps by the distance to the nearest surface: Zuiderveld, Koning, Viergever, "Acceleration
of ray-casting using 3-D distance transforms", 1992.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.render.baked import Baked

SQUARE = np.ones((3, 3), dtype=np.uint8)
CORNER = 0.87  # voxels from a voxel's centre
PARALLEL = 1e-9  # voxels per world unit: a ray's slope that counts as this


@dataclass(frozen=True, eq=False)
class Paths:
    """The steps of some rays: those of `toonset.nerf.hull.march`.

    Attributes:
        first: (3, rays) place of a ray's first step.
        ahead: (3, rays) from a step to the next.
        depth: (rays,) of the first step, past the plane through the camera's target.
        step: (rays,) depth from a step to the next.
        entry, exit: (rays,) number of the first step that may show anything, and of the one from
            which on none does; exit <= entry: the ray meets nothing.
    """

    first: Float[Tensor, "3 rays"]
    ahead: Float[Tensor, "3 rays"]
    depth: Float[Tensor, " rays"]
    step: Float[Tensor, " rays"]
    entry: Float[Tensor, " rays"]
    exit: Float[Tensor, " rays"]


@dataclass(frozen=True, eq=False)
class ViewRays:
    """A baked field as a camera sees it.

    Attributes:
        baked: the field.
        camera: where it is seen from.
        middle: depth of the hull's middle past the plane through the camera's target.
        tile: pixels along a side of the coarse picture's.
        reach: (2, rows, columns) the coarse picture, nearest and farthest; a pixel more all round.
    """

    baked: Baked
    camera: Camera
    middle: float
    tile: float
    reach: Float[Tensor, "2 rows columns"]

    @classmethod
    def of(cls, baked: Baked, camera: Camera) -> ViewRays:
        """Compute the rays of a camera."""
        hull, (width, height) = baked.trained.hull, camera.size_wh
        middle = float(camera.rotation[2] @ ((hull.box.low + hull.box.high) / 2 - camera.target))
        corner = camera.rotation @ (hull.low - hull.voxel / 2 - camera.target) - [0, 0, middle]
        turn = torch.as_tensor(hull.voxel * camera.rotation, dtype=torch.float32)
        x, y, depth = torch.as_tensor(corner[:, None], dtype=torch.float32).addmm(turn, baked.shell)
        relative = camera.k * depth + (1 + camera.k * middle)
        margin = camera.k * hull.voxel
        closest = float(relative.min()) - margin if len(depth) else 1.0
        if closest <= margin:  # the camera stands inside: nothing is sure
            everywhere = torch.tensor([-torch.inf, torch.inf])[:, None, None].expand(2, 3, 3)
            return cls(baked, camera, middle, float(max(width, height)), everywhere.contiguous())
        sides = camera.scale * np.array([1, camera.pixel_aspect])
        tile = max(1.0, hull.voxel * float(sides.max()) / closest)
        column, row = (
            (at / relative).mul_(side / tile).add_(center / tile + 1)
            for at, side, center in zip((x, y), sides.tolist(), camera.center.tolist(), strict=True)
        )
        rows, columns = int(height / tile) + 3, int(width / tile) + 3
        row, column = row.clamp_(0, rows - 1).long(), column.clamp_(0, columns - 1).long()
        index = row.mul_(columns).add_(column)  # what is beyond the picture goes to its rim
        extremes = (
            torch.full((rows * columns,), start).scatter_reduce_(0, index, depth, how)
            for how, start in (("amin", torch.inf), ("amax", -torch.inf))
        )
        nearest, farthest = (each.view(rows, columns).numpy() for each in extremes)
        reach = np.stack([cv2.erode(nearest, SQUARE), cv2.dilate(farthest, SQUARE)])
        around = np.array([-CORNER, CORNER])[:, None, None] * hull.voxel
        return cls(baked, camera, middle, tile, torch.as_tensor(reach + around.astype(np.float32)))

    def between(self, pixels: Float[Tensor, "2 n"]) -> Float[Tensor, "2 n"]:
        """Return between which depths rays through pixels (centres at 0.5) may meet anything."""
        u, v = (pixels / self.tile + 1).int()
        return self.reach.view(2, -1).index_select(1, v * self.reach.shape[2] + u)

    def paths(self, pixels: Float[Tensor, "2 n"], between: Float[Tensor, "2 n"]) -> Paths:
        """Return the steps of rays through pixels."""
        camera, trained = self.camera, self.baked.trained
        hull, k = trained.hull, camera.k
        sides = camera.scale * np.array([1, camera.pixel_aspect])
        offset = torch.tensor(camera.center[:, None], dtype=torch.float32)
        plane = (pixels - offset) / torch.as_tensor(sides[:, None], dtype=torch.float32)
        turn = camera.rotation.T / hull.voxel
        start = turn[:, 2] * self.middle + (camera.target - hull.low) / hull.voxel + 0.5
        across = torch.as_tensor(turn[:, :2]).float() @ plane
        place = across * (1 + k * self.middle) + torch.as_tensor(start[:, None]).float()
        slope = across * k + torch.as_tensor(turn[:, 2:]).float()
        safe = torch.where(slope.abs() < PARALLEL, PARALLEL, slope)
        size = torch.tensor(hull.support.shape)[:, None]
        a, b = (0.5 - place) / safe, (size + 0.5 - place) / safe
        near = torch.minimum(a, b).amax(dim=0)
        if not camera.is_orthographic:
            near.clamp_min_(-1 / k - self.middle)
        far = torch.maximum(a, b).amin(dim=0).minimum(between[1])
        step = trained.step / (plane.square().sum(dim=0) * k**2 + 1).sqrt_()
        entry = ((between[0] - near) / step - 0.5).floor_().clamp_min_(0)
        first = near + 0.5 * step
        return Paths(
            place.addcmul_(slope, first),
            slope * step,
            first + self.middle,
            step,
            entry,
            (far - near) / step,
        )


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
