"""A plain voxel grid: density and colour stored at corners, trilinear between them."""

from __future__ import annotations

import itertools

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor, nn

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.bounds import Box
from toonset.nerf.fields.base import DENSITY_SHIFT, Constants, Field, Places, shape_of
from toonset.nerf.hull.hull import Hull
from toonset.nerf.kernels import loss_terms as terms
from toonset.nerf.kernels.interpolation import Operator
from toonset.nerf.train.fit_field import finest_cells


class VoxelField(Field):
    """Softplus of one interpolated value is the density, sigmoids of three are the colour.

    Source: Sun et al., "Direct voxel grid optimization", 2022 (without its second stage).
    """

    low: Tensor

    def __init__(self, box: Box, resolution: int) -> None:
        """Build a grid of grey mist with `resolution` cells along the longest side of the box."""
        super().__init__()
        self.cell, self.shape = shape_of(box, resolution)
        self.register_buffer("low", torch.as_tensor(box.low, dtype=torch.float32))
        self.grid = nn.Parameter(torch.zeros(int(np.prod(self.shape)), 4))

    @torch.no_grad()
    def thin(self, by: float) -> None:
        """Lower softplus's argument everywhere by so much."""
        self.grid[:, 0] -= by

    def constants(self, points_world: Float[Tensor, "n 3"]) -> Operator:
        """Return the interpolation as a sparse matrix."""
        return Operator.of(*self.taps(points_world), len(self.grid))

    def shade(self, constants: Constants) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density and colour, differentiable in the grid."""
        if isinstance(constants, Places):
            return self(constants.points)
        assert isinstance(constants, Operator)
        return self._decode(constants(self.grid))

    def forward(
        self, points_world: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density per world unit and RGB in [0, 1] at world points."""
        most = torch.tensor(self.shape, device=points_world.device) - 1
        unit = (points_world - self.low) / self.cell * (2 / most) - 1
        volume = self.grid.view(1, *self.shape, 4).permute(0, 4, 1, 2, 3)
        places = unit.flip(-1)[None, None, None]  # grid_sample names the last axis first
        found = F.grid_sample(volume, places, padding_mode="border", align_corners=True)
        return self._decode(found[0, :, 0, 0].T)

    def tables(self) -> list[nn.Parameter]:
        """Return the grid."""
        return [self.grid]

    def roughness(self) -> Float[Tensor, ""]:
        """Return the mean absolute step between neighbouring corners, summed over the channels."""
        return terms.total_variation(self.grid, [self.shape])

    def corners(self) -> Float[Tensor, "corners 3"]:
        """Return the world positions of the grid's values, in the order of its rows."""
        counts = [torch.arange(n, dtype=torch.float32) for n in self.shape]
        return self.low + self.cell * torch.cartesian_prod(*counts)

    def taps(
        self, points_world: Float[Tensor, "n 3"]
    ) -> tuple[Int[Tensor, "n 8"], Float[Tensor, "n 8"]]:
        """Return the rows of the grid that each point reads, and their weights."""
        most = torch.tensor(self.shape, dtype=torch.float32, device=points_world.device) - 1
        at = ((points_world - self.low) / self.cell).clamp_min(0).minimum(most)
        corner = at.floor().minimum(most - 1)
        near, far = 1 - (at - corner), at - corner
        x, y, z = corner.int().unbind(1)
        rows, weights = [], []
        for a, b, c in itertools.product((0, 1), repeat=3):
            rows.append(((x + a) * self.shape[1] + y + b) * self.shape[2] + z + c)
            sides = [(near, far)[side][:, axis] for axis, side in enumerate((a, b, c))]
            weights.append(sides[0] * sides[1] * sides[2])
        return torch.stack(rows, dim=1), torch.stack(weights, dim=1)

    def _decode(
        self, values: Float[Tensor, "n 4"]
    ) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        density = F.softplus(values[:, 0] + DENSITY_SHIFT) / self.cell
        return density, torch.sigmoid(values[:, 1:])


def voxels(scene: Scene, hull: Hull) -> VoxelField:
    """Return the untrained grid for a scene; its cost grows with the cube of its cells."""
    return VoxelField(hull.box, max(1, finest_cells(scene) * 3 // 4))
