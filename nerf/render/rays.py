"""Compute a camera's rays through a baked field, and their depth range.

Depths are past the plane through the hull's middle that is parallel to the picture, world units.
The voxels round what may be seen are drawn into a coarse picture of the nearest and farthest depth,
whose pixels are at least as large as a voxel appears: a place within a voxel lies in the pixel of
the voxel's centre or in one next to it, and not farther than CORNER from its depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Float
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
