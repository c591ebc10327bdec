"""Minimise the fairing energy with Adam and an analytic gradient.

The energy is that of `fairing`, with its gradient written down: the volume is linear in what Adam
moves, so the gradient is a few more linear operations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from toonset.nerf.kernels.adam import Adam, Group
from toonset.nerf.kernels.volume import Volume, add_bending, along_axes, inner

# Weights of the Laplacian at the start and, from 8 views on, at the end: stiff, the surface leaves
# what no outline asks for, soft, it meets the outlines (docs/decisions.md)
STIFF, SOFT, REFERENCE_VIEWS = 1.0, 0.1, 8
STEPS, RATE, LAST_RATE = 100, 0.1, 0.1  # of Adam; the rate decays exponentially to a tenth
PYRAMID = (1, 2, 4, 8)  # coarse voxels per cell of each level
BAND = 5.0  # coarse voxels from the hull's surface within which bending counts


@dataclass(frozen=True, eq=False)
class Contacts:
    """Places where outline rays may touch the surface.

    Attributes:
        rows: (n, 8) the voxels round a point, as numbers in the flat volume; packed ray after ray.
        weights: (n, 8) of the voxels in trilinear interpolation.
        ray: (n,) which ray a point belongs to, ascending from 0.
        rays: how many rays there are.
    """

    rows: Int[Tensor, "n 8"]
    weights: Float[Tensor, "n 8"]
    ray: Int[Tensor, " n"]
    rays: int

    def lowest(self, volume: Volume) -> Contacts:
        """Return each ray's point of the smallest value."""
        values = self.values(volume)
        best = values.new_full((self.rays,), torch.inf).scatter_reduce(0, self.ray, values, "amin")
        hits = (values <= best[self.ray]).nonzero()[:, 0]
        last = torch.zeros(self.rays, dtype=torch.long)
        last = last.scatter_reduce(0, self.ray[hits], hits, "amax")
        ray = torch.arange(self.rays)
        return Contacts(self.rows[last], self.weights[last], ray, self.rays)

    def values(self, volume: Volume) -> Float[Tensor, " n"]:
        """Return the volume's values at the points."""
        return volume.view(-1)[self.rows].mul_(self.weights).sum(dim=1)

    def add_to(self, volume: Volume, by_value: Float[Tensor, " n"]) -> None:
        """Add the transpose of `values`, times a vector, to a volume."""
        taps = self.weights * by_value[:, None]
        volume.view(-1).index_add_(0, self.rows.view(-1), taps.view(-1))


@torch.no_grad()
def fit(outside: Volume, contacts: Contacts, views: int) -> Volume:
    """Return the fair signed distance.

    Args:
        outside: the hull's own.
        contacts: where outline rays may touch.
        views: that the outlines are of.
    """
    pyramid = Pyramid.over(outside.shape)
    levels = pyramid.zeros()
    optimizer = Adam([Group(levels, RATE)])
    band = inner(outside.abs() < BAND).float()
    stiff = band * (2 * STIFF / band.sum())
    softer = min(1.0, SOFT / STIFF * max(1.0, REFERENCE_VIEWS / views) ** 2)
    fair, touching = outside, contacts
    for step in range(STEPS):
        if step % 2 == 0:
            touching = contacts.lowest(fair.maximum(outside))
        gradient = (fair - outside).clamp_(max=0).mul_(2 / contacts.rays)
        touching.add_to(gradient, touching.values(fair) * (2 / contacts.rays))
        add_bending(gradient, fair, stiff * softer ** (step / STEPS))
        for level, part in zip(levels, pyramid.gathered(gradient), strict=True):
            level.grad = part
        optimizer.step(LAST_RATE ** (step / STEPS))
        fair = outside + pyramid.spread(levels)
    return fair


@dataclass(frozen=True, eq=False)
class Pyramid:
    """Grids of coarser and coarser cells that add up to one volume, linearly interpolated.

    Attributes:
        matrices: per level and axis, (voxels, cells): the weights of cells in voxels.
    """

    matrices: Sequence[Sequence[Float[Tensor, "voxels cells"]]]

    @classmethod
    def over(cls, shape: torch.Size) -> Pyramid:
        """Return the levels that PYRAMID names."""
        levels = []
        for cell in PYRAMID:
            cells = [torch.eye(-(-n // cell))[None] for n in shape]
            wide = [F.interpolate(eye, scale_factor=cell, mode="linear")[0].T for eye in cells]
            levels.append([w[:n].contiguous() for w, n in zip(wide, shape, strict=True)])
        return cls(levels)

    def zeros(self) -> list[Tensor]:
        """Return the levels' cells, all zero."""
        return [torch.zeros([len(m.T) for m in level]) for level in self.matrices]

    def spread(self, levels: Sequence[Tensor]) -> Volume:
        """Return the sum of the levels."""
        parts = zip(levels, self.matrices, strict=True)
        return sum((along_axes(level, each) for level, each in parts), torch.zeros(()))

    def gathered(self, volume: Volume) -> list[Tensor]:
        """Return the transpose of `spread`: the gradient of each level."""
        return [along_axes(volume, [m.T for m in level]) for level in self.matrices]
