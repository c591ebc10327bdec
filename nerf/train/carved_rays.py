"""The rays a training draws its steps from.

A training asks for a step's batches by their number and by the step, tells when a step is done, and
can put away and take back what changes on the way, so that an interrupted training goes on exactly.
"""

from __future__ import annotations

from functools import partial
from typing import Protocol

import torch
from torch import Tensor

from toonset.nerf.kernels.compositing import transmittance_packed
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.train.batches import Batch
from toonset.nerf.train.loss import Model

PRUNE_AFTER = 50  # steps: by then surfaces are where they will stay
HIDDEN_BELOW = 0.01  # light that reaches a sample which nobody sees any more


class TrainingRays(Protocol):
    """Where a training's batches come from."""

    def __len__(self) -> int:
        """Return how many steps go through all rays once."""
        ...

    def batches(self, index: int, step: int) -> tuple[Batch, ...]:
        """Return the parts of a step's rays, to be rendered side by side."""
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

    def __init__(self, steps: list[tuple[Batch, ...]]) -> None:
        """Take the batches of `make_batches`."""
        self._steps = list(steps)
        self._kept: list[Tensor] = []

    def __len__(self) -> int:
        """Return how many steps go through all rays once."""
        return len(self._steps)

    def batches(self, index: int, step: int) -> tuple[Batch, ...]:
        """Return some rays' batches, the same for every step."""
        del step
        return self._steps[index]

    def after(self, step: int, model: Model) -> None:
        """Drop the samples that hardly any light reaches, once."""
        if step + 1 == PRUNE_AFTER:
            self._keep(side_by_side([partial(seen_samples, model, b) for b in self._all()]))

    def state(self) -> dict[str, Tensor]:
        """Return which samples were kept."""
        return {f"kept.{i}": kept.to(torch.uint8) for i, kept in enumerate(self._kept)}

    def restore(self, state: dict[str, Tensor]) -> None:
        """Drop what was dropped when `state` was taken."""
        if state:
            self._keep([state[f"kept.{i}"].bool() for i in range(len(self._all()))])

    def _keep(self, kept: list[Tensor]) -> None:
        self._kept = [samples.cpu() for samples in kept]
        pairs = zip(self._all(), kept, strict=True)
        tasks = [partial(batch.kept, samples.to(batch.ray.device)) for batch, samples in pairs]
        left = iter(side_by_side(tasks))
        self._steps = [tuple(next(left) for _ in batches) for batches in self._steps]

    def _all(self) -> list[Batch]:
        return [batch for batches in self._steps for batch in batches]


@torch.no_grad()
def seen_samples(model: Model, batch: Batch) -> Tensor:
    """Return which samples of a batch light still reaches: (samples,) bool."""
    density, _ = model.field.shade(batch.constants)
    return transmittance_packed(density * batch.length, batch.ray) >= HIDDEN_BELOW
