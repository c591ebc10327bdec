"""The rays a training draws its steps from.

A training asks for a step's batches by their number and by the step, tells when a step is done, and
can put away and take back what changes on the way, so that an interrupted training goes on exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Protocol

import torch
from torch import Tensor

from toonset.nerf.fields.base import Field
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
    """Rays whose samples never move; once surfaces have formed, samples behind them are dropped.

    What a field knows of the samples' places is laid out then: for all of them it would take
    most of a training's memory, and longer than the few steps with them gain by it.
    """

    def __init__(self, steps: Sequence[tuple[Batch, ...]], field: Field | None = None) -> None:
        """Take the batches of `make_batches`, and the field for which they are laid out.

        Args:
            steps: of each its batches.
            field: None: nothing is dropped nor laid out.
        """
        self._steps, self._field = list(steps), field
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
        if step + 1 == PRUNE_AFTER and self._field is not None:
            self._keep(side_by_side([partial(seen_samples, model, b) for b in self._all()]))

    def state(self) -> dict[str, Tensor]:
        """Return which samples were kept."""
        return {f"kept.{i}": kept.to(torch.uint8) for i, kept in enumerate(self._kept)}

    def restore(self, state: dict[str, Tensor]) -> None:
        """Drop what was dropped when `state` was taken."""
        if state:
            self._keep([state[f"kept.{i}"].bool() for i in range(len(self._all()))])

    @torch.no_grad()
    def _keep(self, kept: list[Tensor]) -> None:
        assert self._field is not None
        self._kept, field = [samples.cpu() for samples in kept], self._field
        pairs = zip(self._all(), kept, strict=True)
        tasks = [
            partial(batch.kept, samples.to(batch.ray.device), field) for batch, samples in pairs
        ]
        left = iter(side_by_side(tasks))
        self._steps = [tuple(next(left) for _ in batches) for batches in self._steps]

    def _all(self) -> list[Batch]:
        return [batch for batches in self._steps for batch in batches]


@torch.no_grad()
def seen_samples(model: Model, batch: Batch) -> Tensor:
    """Return which samples of a batch light still reaches: (samples,) bool."""
    density, _ = model.field.shade(batch.constants)
    return transmittance_packed(density * batch.length, batch.ray) >= HIDDEN_BELOW
