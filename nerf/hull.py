"""The visual hull: the part of space that the drawings agree may be filled.

support(x) = the (missing + 1)-th smallest over the views of alpha_v(project_v(x))

with alpha sampled bilinearly; x is inside where support >= 1/2. `missing` is the number of views
that may say "background" at a point: 0 is the classic hull, 1 forgives one drawing's slip and keeps
thin parts that pixels erode. Which is right differs from scene to scene, so `choose_missing` asks
the drawings (how well the hull of the other views predicts each view's mask).

Source: Laurentini, "The visual hull concept", 1994; n - 1 agreement: GaussianObject (Yang et al.
2024), section 3.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

from toonset.camera import MIN_RELATIVE_DEPTH, Camera
from toonset.errors import BundleError
from toonset.nerf.bounds import Box, box_of_masks

LEVEL = 0.5
EDGE = 0.02  # support from which a point can be part of the figure's soft border
BLOCK = 4  # voxels along a block's edge
COARSE = 48  # voxels along the cube in the first carving, which only finds the tight box
POINTS_PER_CHUNK = 1 << 17  # keeps a chunk's intermediate arrays in cache


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
        return _grown(self.support >= EDGE)

    @cached_property
    def blocks(self) -> Bool[Tensor, "bx by bz"]:
        """Return the blocks of BLOCK voxels that are, or touch, one with a near voxel."""
        pooled = F.max_pool3d(self.near[None, None].float(), BLOCK, ceil_mode=True)
        return _grown(pooled[0, 0] > 0)

    def lookup(
        self, cells: Bool[Tensor, "x y z"], points_world: Float[Tensor, "n 3"], edge: int
    ) -> Bool[Tensor, " n"]:
        """Return the cell (of `edge` voxels) in which each point lies; outside the nearest."""
        return cells.reshape(-1)[self.cell_index(points_world, cells.shape, edge)]

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
    return (support / LEVEL).clamp(0, 1)


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
    counts = np.maximum(1, np.ceil(box.size / voxel - 1e-9)).astype(int)
    axes = [
        torch.as_tensor(box.low[i] + voxel * (np.arange(counts[i]) + 0.5), dtype=torch.float32)
        for i in range(3)
    ]
    slabs = max(1, POINTS_PER_CHUNK // int(counts[1] * counts[2]))
    parts = []
    for start in range(0, counts[0], slabs):
        points = torch.cartesian_prod(axes[0][start : start + slabs], axes[1], axes[2])
        parts.append(agreement(points, cameras, alphas, missing))
    support = torch.cat(parts).reshape(*counts.tolist())
    return Hull(np.asarray(box.low), voxel, support)


def agreement(
    points_world: Float[Tensor, "n 3"],
    cameras: Sequence[Camera],
    alphas: Sequence[Float[Tensor, "height width"]],
    missing: int,
) -> Float[Tensor, " n"]:
    """Return the (missing + 1)-th smallest of the views' alphas at the points."""
    lowest = torch.full((missing + 1, len(points_world)), 1.0)
    for camera, alpha in zip(cameras, alphas, strict=True):
        value = alpha_at(points_world, camera, alpha)
        for row in lowest:  # insertion into the sorted list of the smallest values so far
            smaller, value = torch.minimum(row, value), torch.maximum(row, value)
            row.copy_(smaller)
    return lowest[missing]


def alpha_at(
    points_world: Float[Tensor, "n 3"], camera: Camera, alpha: Float[Tensor, "height width"]
) -> Float[Tensor, " n"]:
    """Return a view's alpha where the points appear in it; 0 behind the camera.

    Beyond the picture's edge the nearest pixel counts, so that a figure which the picture cuts
    off goes on, and background goes on as background.
    """
    pixels, in_front = project(points_world, camera)
    size = torch.tensor(camera.size_wh, dtype=torch.float32)
    grid = (pixels * (2 / size) - 1)[None, None]
    values = F.grid_sample(alpha[None, None], grid, padding_mode="border", align_corners=False)
    return torch.where(in_front, values[0, 0, 0], torch.zeros(()))


def project(
    points_world: Float[Tensor, "n 3"], camera: Camera
) -> tuple[Float[Tensor, "n 2"], Bool[Tensor, " n"]]:
    """Return the pixels of world points and whether they lie in front: `Camera.project` in torch.

    Pixels behind the camera have no meaning.
    """
    dtype = points_world.dtype
    rotation = torch.as_tensor(np.array(camera.rotation), dtype=dtype)
    local = (points_world - torch.as_tensor(np.array(camera.target), dtype=dtype)) @ rotation.T
    relative = 1 + camera.k * local[:, 2]
    in_front = relative > MIN_RELATIVE_DEPTH
    scale = torch.tensor([camera.scale, camera.scale * camera.pixel_aspect], dtype=dtype)
    center = torch.as_tensor(np.array(camera.center), dtype=dtype)
    pixels = center + scale * local[:, :2] / relative.clamp_min(MIN_RELATIVE_DEPTH)[:, None]
    return pixels, in_front


def _grown(cells: Bool[Tensor, "x y z"]) -> Bool[Tensor, "x y z"]:
    return F.max_pool3d(cells[None, None].float(), 3, stride=1, padding=1)[0, 0] > 0
