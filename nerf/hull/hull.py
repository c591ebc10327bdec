"""Carve the visual hull: the part of space that the drawings' masks leave.

support(x) = the (missing + 1)-th smallest over the views of alpha_v(project_v(x))

with alpha sampled bilinearly; x is inside where support >= 1/2. `missing` is the number of views
that may say "background" at a point: 0 is the classic hull, 1 forgives one drawing's slip and keeps
thin parts that pixels erode. Which is right differs from scene to scene, so `choose_missing` asks
the drawings (how well the hull of the other views predicts each view's mask).

Source: Laurentini, "The visual hull concept", 1994; n - 1 agreement: GaussianObject (Yang et al.
2024), section 3.2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int, Shaped
from torch import Tensor

from toonset.camera import Camera
from toonset.dataset.silhouettes.bounds import Box, box_of_masks
from toonset.errors import BundleError
from toonset.nerf.hull.support import agreement, agreement_within
from toonset.nerf.kernels.threads import side_by_side

LEVEL = 0.5
# Support from which all of a point's density counts; at LEVEL, rays that graze a border would make
# figures too wide (docs/decisions.md)
FULL = 1.0
EDGE = 0.02  # support from which a point can be part of the figure's soft border
BLOCK = 4  # voxels along a block's edge
COARSE = 48  # voxels along the cube in the first carving, which only finds the tight box
POINTS_PER_CHUNK = 1 << 15  # keeps a chunk's intermediate arrays in cache


@dataclass(frozen=True, eq=False)
class Hull:
    """A field of support on a grid of cubic voxels.

    Attributes:
        low: (3,) world position of the grid's lowest corner (a corner, not a voxel's centre).
        voxel: edge of a voxel, world units.
        support: (x, y, z) agreement in [0, 1] at the voxels' centres; inside where >= LEVEL.
    """

    low: Float[np.ndarray, " 3"]
    voxel: float
    support: Float[Tensor, "x y z"]

    @property
    def box(self) -> Box:
        """Return the grid's outer box."""
        return Box(self.low, self.low + self.voxel * np.array(self.support.shape))

    @property
    def inside(self) -> Bool[Tensor, "x y z"]:
        """Return which voxels are inside."""
        return self.support >= LEVEL

    def centres(self) -> Float[Tensor, "n 3"]:
        """Return the voxels' centres in the world, in the order of `support`."""
        axes = [
            torch.as_tensor(low + self.voxel * (np.arange(n) + 0.5), dtype=torch.float32)
            for low, n in zip(self.low, self.support.shape, strict=True)
        ]
        return torch.cartesian_prod(*axes)

    @cached_property
    def near(self) -> Bool[Tensor, "x y z"]:
        """Return the voxels in which the trilinear support can reach EDGE."""
        return grow(self.support >= EDGE, 1)

    @cached_property
    def blocks(self) -> Bool[Tensor, "bx by bz"]:
        """Return the blocks of BLOCK voxels that are, or touch, one with a near voxel."""
        pooled = F.max_pool3d(self.near[None, None].float(), BLOCK, ceil_mode=True)
        return grow(pooled[0, 0] > 0, 1)

    def cell_index(
        self, points_world: Float[Tensor, "n 3"], shape: torch.Size, edge: int
    ) -> Int[Tensor, " n"]:
        """Return the flat index of each point's cell on a grid of `shape` cells."""
        low = torch.as_tensor(self.low, dtype=torch.float32)
        cell = ((points_world - low) / (self.voxel * edge)).floor().int()
        x, y, z = cell.clamp_min(0).minimum(torch.tensor(shape).int() - 1).unbind(1)
        return (x * shape[1] + y) * shape[2] + z

    def support_at(self, points_world: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
        """Return the support at world points, trilinear; 0 outside of the grid."""
        size = torch.tensor(self.support.shape, dtype=torch.float32, device=points_world.device)
        low = torch.as_tensor(self.low, dtype=torch.float32, device=points_world.device)
        unit = (points_world - low) * (2 / self.voxel / size) - 1
        grid = unit.flip(-1)[None, None, None]  # grid_sample names the last axis first
        volume = self.support[None, None]
        return F.grid_sample(volume, grid, align_corners=False)[0, 0, 0, 0]


def occupancy(support: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
    """Return how much of a point's density counts: 1 inside, falling to 0 across the border.

    A hard border would be as coarse as the samples; a soft one lets outlines fall between pixels.
    """
    return (support / FULL).clamp(0, 1)


def grow(volume: Shaped[Tensor, "x y z"], by: int) -> Shaped[Tensor, "x y z"]:
    """Return the largest value (of cells: whether any is set) within `by` cells along every axis.

    By shifted copies: thirty times faster than `max_pool3d`.
    """
    for axis, length in enumerate(volume.shape):
        widest = volume.clone()
        for shift in range(1, min(by, length - 1) + 1):
            for to, source in ((0, shift), (shift, 0)):
                part = widest.narrow(axis, to, length - shift)
                torch.maximum(part, volume.narrow(axis, source, length - shift), out=part)
        volume = widest
    return volume


def carve(
    cameras: Sequence[Camera],
    alphas: Sequence[Float[Tensor, "height width"]],
    resolution: int,
    missing: int,
) -> Hull:
    """Return the hull of the views with `resolution` voxels along its longest side.

    Args:
        cameras: one per view.
        alphas: coverage in [0, 1] per view.
        resolution: voxels along the longest side of the tight box.
        missing: how many views may say "background" at a point that is inside.

    Raises:
        BundleError: the views share no volume, or `box_of_masks` refuses.
    """
    masks = [(alpha >= LEVEL).numpy() for alpha in alphas]
    cube = box_of_masks(cameras, masks)
    coarse = _carve_box(cube, float(cube.size.max()) / COARSE, cameras, alphas, missing)
    # A coarse voxel can straddle a thin part that its centre misses: any support counts.
    filled = np.argwhere((coarse.support > 0).numpy())
    if not len(filled):
        raise BundleError(
            f"views: the masks of {len(cameras)} views share no volume; the cameras do not belong "
            "to these pictures (check the axes of transform_matrix and the intrinsics)"
        )
    low = cube.low + coarse.voxel * (filled.min(axis=0) - 1)
    high = cube.low + coarse.voxel * (filled.max(axis=0) + 2)
    return _carve_box(
        Box(low, high), float((high - low).max()) / resolution, cameras, alphas, missing
    )


def _carve_box(
    box: Box,
    voxel: float,
    cameras: Sequence[Camera],
    alphas: Sequence[Float[Tensor, "height width"]],
    missing: int,
) -> Hull:
    """Return the support on the grid of a box; only blocks that a border crosses are looked at."""
    counts = np.maximum(1, np.ceil(box.size / voxel - 1e-9)).astype(int).tolist()
    low = torch.as_tensor(box.low, dtype=torch.float32)
    blocks = [-(-n // BLOCK) for n in counts]
    number = torch.cartesian_prod(*(torch.arange(n) for n in blocks))
    middles = low + voxel * BLOCK * (number + 0.5)
    radius = voxel * (BLOCK - 1) / 2 * math.sqrt(3)
    least, most = agreement_within(middles, radius, cameras, alphas, missing)
    support = least[:, None].repeat(1, BLOCK**3)
    inner = voxel * (torch.cartesian_prod(*[torch.arange(BLOCK) - (BLOCK - 1) / 2] * 3))
    crossed = (least < most).nonzero()[:, 0]

    def within(chunk: Int[Tensor, " blocks"]) -> Float[Tensor, "blocks voxels"]:
        points = (middles[chunk, None] + inner).view(-1, 3)
        return agreement(points, cameras, alphas, missing).view(-1, BLOCK**3)

    chunks = crossed.split(POINTS_PER_CHUNK // BLOCK**3)
    support[crossed] = torch.cat(side_by_side([partial(within, chunk) for chunk in chunks]))
    volume = support.view(*blocks, BLOCK, BLOCK, BLOCK).permute(0, 3, 1, 4, 2, 5)
    volume = volume.reshape([n * BLOCK for n in blocks])
    x, y, z = counts
    return Hull(np.asarray(box.low), voxel, volume[:x, :y, :z].contiguous())
