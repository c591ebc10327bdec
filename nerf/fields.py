"""What every field has in common, so that one trainer and one renderer serve them all.

A field maps points to density and colour. In training the same points come again and again, so a
field splits the work: `constants` is what depends on the points alone and is computed once,
`shade` is what depends on the parameters.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol, Self

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn


class Constants(Protocol):
    """What a field precomputes about points."""

    def to(self, device: torch.device) -> Self:
        """Return them on a device."""

    def kept(self, samples: Bool[Tensor, " n"]) -> Self:
        """Return those of some of the points."""


class Field(nn.Module, ABC):
    """Density per world unit and RGB in [0, 1] anywhere in a box; colour has no highlights."""

    @abstractmethod
    def constants(self, points_world: Float[Tensor, "n 3"]) -> Constants:
        """Return what depends on the points alone."""

    @abstractmethod
    def shade(self, constants: Constants) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density and colour, differentiable in the parameters."""

    @abstractmethod
    def forward(
        self, points_world: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, " n"], Float[Tensor, "n 3"]]:
        """Return density and colour at points that come but once."""

    def tables(self) -> list[nn.Parameter]:
        """Return the parameters that hold values at places, which learn faster than decoders."""
        return []

    def roughness(self) -> Float[Tensor, ""]:
        """Return the mean absolute step between neighbours in the tables, 0 without tables."""
        return torch.zeros(())
