"""The rays a training draws its steps from.

A training asks for a batch by its number and by the step it is for, tells when a step is done, and
can put away and take back what changes on the way, so that an interrupted training goes on exactly.
"""

from __future__ import annotations

from typing import Protocol

import torch
from torch import Tensor

from toonset.nerf.batches import Batch
from toonset.nerf.field_loss import Model
from toonset.nerf.rendering import transmittance_packed

PRUNE_AFTER = 50  # steps: by then surfaces are where they will stay
HIDDEN_BELOW = 0.01  # light that reaches a sample which nobody sees any more


class TrainingRays(Protocol):
    """Where a training's batches come from."""

    def __len__(self) -> int:
        """Return how many batches go through all rays once."""
        ...

    def batch(self, index: int, step: int) -> Batch:
        """Return a batch for a step."""
        ...

    def after(self, step: int, model: Model) -> None:
        """Take note that a step is done."""

    def state(self) -> dict[str, Tensor]:
        """Return what has changed since the start."""
        ...

    def restore(self, state: dict[str, Tensor]) -> None:
        """Become what `state` was taken from."""


class FixedRays:
    """Rays whose samples never move; once surfaces have formed, samples behind them are dropped."""

    def __init__(self, batches: list[Batch]) -> None:
        """Take the batches of `make_batches`."""
        self._batches = list(batches)
        self._kept: list[Tensor] = []

    def __len__(self) -> int:
        """Return how many batches go through all rays once."""
        return len(self._batches)

    def batch(self, index: int, step: int) -> Batch:
        """Return a batch, the same for every step."""
        del step
        return self._batches[index]

    def after(self, step: int, model: Model) -> None:
        """Drop the samples that hardly any light reaches, once."""
        if step + 1 == PRUNE_AFTER:
            self._keep([seen_samples(model, batch) for batch in self._batches])

    def state(self) -> dict[str, Tensor]:
        """Return which samples were kept."""
        return {f"kept.{i}": kept.to(torch.uint8) for i, kept in enumerate(self._kept)}

    def restore(self, state: dict[str, Tensor]) -> None:
        """Drop what was dropped when `state` was taken."""
        if state:
            self._keep([state[f"kept.{i}"].bool() for i in range(len(self))])

    def _keep(self, kept: list[Tensor]) -> None:
        self._kept = [samples.cpu() for samples in kept]
        pairs = zip(self._batches, kept, strict=True)
        self._batches = [batch.kept(samples.to(batch.ray.device)) for batch, samples in pairs]


@torch.no_grad()
def seen_samples(model: Model, batch: Batch) -> Tensor:
    """Return which samples of a batch light still reaches: (samples,) bool."""
    density, _ = model.field.shade(batch.constants)
    return transmittance_packed(density * batch.length, batch.ray) >= HIDDEN_BELOW
