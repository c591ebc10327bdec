"""Define the interface that all fields share, so that one trainer and one renderer serve them.

A field maps points to density and colour. In training the same points come again and again, so a
field splits the work: `constants` is what depends on the points alone and is computed once,
`shade` is what depends on the parameters.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from toonset.dataset.silhouettes.bounds import Box

OPAQUE_AT_START = 0.1  # optical depth of one cell before training: space starts as a mist
DENSITY_SHIFT = math.log(math.expm1(OPAQUE_AT_START))  # softplus of it is the above


class Constants(Protocol):
    """Precomputed values of a field at points."""

    def to(self, device: torch.device) -> Self:
        """Return them on a device."""
        ...


@dataclass(frozen=True, eq=False)
class Places:
    """Points as they are: for fields that precompute nothing, and for points that come once."""

    points: Float[Tensor, "n 3"]

    def to(self, device: torch.device) -> Places:
        """Return them on a device."""
        return Places(self.points.to(device))


class Field(nn.Module, ABC):
    """Density per world unit and RGB in [0, 1] anywhere in a box.

    Colour does not depend on the viewing direction: a drawing has no highlights that move.
    """

    decoder_rate = 0.05  # Adam's, for everything that is not a table

    @abstractmethod
    def constants(self, points_world: Float[Tensor, "n 3"]) -> Constants:
        """Precompute what depends on the points alone."""

    @abstractmethod
    def shade(self, constants: Constants) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density and colour, differentiable in the parameters; any field takes `Places`."""

    @abstractmethod
    def forward(
        self, points_world: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density and colour at points that come but once."""

    @abstractmethod
    def thin(self, by: float) -> None:
        """Lower softplus's argument, whose value is the density, everywhere by so much."""

    def tables(self) -> list[nn.Parameter]:
        """Return the parameters that hold values at places, which learn faster than decoders."""
        return []

    def roughness(self) -> Float[Tensor, ""]:
        """Return the mean absolute step between neighbours in the tables, 0 without tables."""
        return torch.zeros(())


def shape_of(box: Box, resolution: int) -> tuple[float, tuple[int, ...]]:
    """Return the edge of a cell and how many corners there are along x, y, z."""
    cell = float(box.size.max()) / resolution
    # Values sit on the cells' corners, hence one more than cells.
    return cell, tuple(int(n) + 1 for n in np.ceil(box.size / cell - 1e-6))
