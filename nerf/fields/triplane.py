"""Define the triplane field: three feature planes, summed, and a small decoder.

    f(x) = P_xy(x, y) + P_xz(x, z) + P_yz(y, z)       bilinear on each plane
    (density, rgb) = decoder(f)                        two layers

The planes cover a box of any size, place and proportions; cells are squares of one size in the
world. Density is per world unit. Colour does not depend on the viewing direction: a drawing has no
highlights that move.

Source: Chan et al., "Efficient geometry-aware 3D generative adversarial networks", 2022, section 4
(whose released code builds the planes xy, xz, zx, of which two are the same).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor, nn

from toonset.dataset.silhouettes.bounds import Box
from toonset.nerf.fields.base import DENSITY_SHIFT, Constants, Field, Places, shape_of
from toonset.nerf.kernels import loss_terms as terms
from toonset.nerf.kernels.decoder import two_layers
from toonset.nerf.kernels.interpolation import Operator, apply_once

PLANES = ((0, 1), (0, 2), (1, 2))  # axes of each plane: xy, xz, yz


class TriplaneField(Field):
    """Density and colour anywhere in a box; see the module docstring."""

    low: Tensor

    def __init__(self, box: Box, resolution: int, channels: int, hidden: int) -> None:
        """Build the field with small random features.

        Args:
            box: what the planes cover, world units.
            resolution: cells along the longest side of the box.
            channels: features per plane.
            hidden: width of the decoder's hidden layer.
        """
        super().__init__()
        self.resolution = resolution
        self.cell, self.shape = shape_of(box, resolution)
        self.register_buffer("low", torch.as_tensor(box.low, dtype=torch.float32))
        rows = sum(self.shape[a] * self.shape[b] for a, b in PLANES)
        self.planes = nn.Parameter(0.1 * torch.randn(rows, channels))
        self.hidden = nn.Linear(channels, hidden)
        self.out = nn.Linear(hidden, 4)

    def forward(
        self, points_world: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density per world unit and RGB in [0, 1] at world points."""
        rows, weights = self.taps(points_world)
        features = F.embedding_bag(
            rows, self.planes, per_sample_weights=weights.to(self.planes.dtype), mode="sum"
        )
        return self.decode(features)

    @torch.no_grad()
    def thin(self, by: float) -> None:
        """Lower softplus's argument everywhere by so much."""
        self.out.bias[0] -= by

    def constants(self, points_world: Float[Tensor, "n 3"]) -> Operator:
        """Return the interpolation as a sparse matrix."""
        return Operator.of(*self.taps(points_world), len(self.planes))

    def shade(self, constants: Constants) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density and colour, differentiable in the parameters."""
        if isinstance(constants, Places):
            return self.decode(apply_once(self.planes, *self.taps(constants.points)))
        assert isinstance(constants, Operator)
        return self.decode(constants(self.planes))

    def tables(self) -> list[nn.Parameter]:
        """Return the planes."""
        return [self.planes]

    def roughness(self) -> Float[Tensor, ""]:
        """Return the planes' total variation."""
        sizes = [(self.shape[a], self.shape[b]) for a, b in PLANES]
        return terms.total_variation(self.planes, sizes)

    def decode(
        self, features: Float[Tensor, "n channels"]
    ) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density per world unit and RGB in [0, 1] of summed features."""
        raw = two_layers(features, self.hidden, self.out)
        return F.softplus(raw[0] + DENSITY_SHIFT) / self.cell, torch.sigmoid(raw[1:]).T

    def taps(
        self, points_world: Float[Tensor, "n 3"]
    ) -> tuple[Int[Tensor, "n 12"], Float[Tensor, "n 12"]]:
        """Return the rows of the plane table that each point reads, and their weights.

        Points outside of the box read its border.
        """
        most = (
            torch.tensor(self.shape, dtype=torch.float32, device=points_world.device)[:, None] - 1
        )
        axes = points_world.T.contiguous()  # each operation runs along one axis of all points
        at = ((axes - self.low[:, None]) / self.cell).clamp_min(0).minimum(most)
        corner = at.floor().minimum(most - 1)
        fraction = at - corner
        corner = corner.int()
        rows, weights, first = [], [], 0
        for a, b in PLANES:
            stride = self.shape[b]
            base = first + corner[a] * stride + corner[b]
            s, t = fraction[a], fraction[b]
            rows += [base, base + 1, base + stride, base + stride + 1]
            weights += [(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t]
            first += self.shape[a] * stride
        return torch.stack(rows, dim=1), torch.stack(weights, dim=1)

    def plane_images(self) -> list[Float[Tensor, "height width channels"]]:
        """Return the planes as pictures, views into the parameters, in the order of PLANES."""
        sizes = [(self.shape[a], self.shape[b]) for a, b in PLANES]
        parts = self.planes.split([h * w for h, w in sizes])
        return [part.view(h, w, -1) for part, (h, w) in zip(parts, sizes, strict=True)]
