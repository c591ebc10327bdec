"""The vanilla radiance field: sines of the position, then a network.

Source: Mildenhall et al., "NeRF", 2020, section 5.1, without viewing direction. Theirs is 8 layers
of 256, about 30 times the multiplications of the 4 of 64 that a CPU trains in a minute or two.
"""

from __future__ import annotations

import itertools
import math

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.bounds import Box
from toonset.nerf.fields.base import DENSITY_SHIFT, Constants, Field, Places
from toonset.nerf.hull.hull import Hull

LAYERS, WIDTH = 4, 64
CELLS = 64  # of the box: density is per cell of this size, as in the other fields


class MlpField(Field):
    """A network on an encoded position; the encoding is computed again in every step."""

    low: Tensor
    decoder_rate = 0.003

    def __init__(self, box: Box, layers: int, hidden: int, octaves: int = 7) -> None:
        """Build the field.

        Args:
            box: what the encoding's longest wave spans, world units.
            layers: hidden layers.
            hidden: width of each.
            octaves: of the encoding.
        """
        super().__init__()
        self.size = float(box.size.max())
        self.octaves = octaves
        self.register_buffer("low", torch.as_tensor(box.low, dtype=torch.float32))
        widths = [3 + 6 * octaves, *[hidden] * layers]
        self.hidden = nn.ModuleList(nn.Linear(a, b) for a, b in itertools.pairwise(widths))
        self.out = nn.Linear(hidden, 4)

    @torch.no_grad()
    def thin(self, by: float) -> None:
        """Lower softplus's argument everywhere by so much."""
        self.out.bias[0] -= by

    def constants(self, points_world: Float[Tensor, "n 3"]) -> Places:
        """Return the points: their encoding is 15 times as large."""
        return Places(points_world)

    def shade(self, constants: Constants) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density and colour, differentiable in the network."""
        assert isinstance(constants, Places)
        return self(constants.points)

    def forward(
        self, points_world: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density per world unit and RGB in [0, 1] at world points."""
        unit = 2 * (points_world - self.low) / self.size - 1
        waves = torch.cat([unit * (math.pi * 2**i) for i in range(self.octaves)], dim=1)
        values = torch.cat([unit, waves.sin(), waves.cos()], dim=1)
        for layer in self.hidden:
            values = F.relu(layer(values))
        raw = self.out(values)
        density = F.softplus(raw[:, 0] + DENSITY_SHIFT) * (CELLS / self.size)
        return density, torch.sigmoid(raw[:, 1:])


def network(scene: Scene, hull: Hull) -> MlpField:
    """Return the untrained field for a scene."""
    del scene
    return MlpField(hull.box, LAYERS, WIDTH)
