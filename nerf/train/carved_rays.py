"""Sample training rays inside the hull, and hand out a step's batches.

A training asks for a step's batches by their number and by the step, and tells when a step is done.
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
WORTH_IT = 2.0  # times that rays are asked for afterwards: dropping and laying out takes longer
HIDDEN_BELOW = 0.01  # light that reaches a sample which nobody sees any more


class TrainingRays(Protocol):
    """Source of a training's batches."""

    def __len__(self) -> int:
        """Return how many steps go through all rays once."""
        ...

    def batches(self, index: int, step: int) -> tuple[Batch, ...]:
        """Return the parts of a step's rays, to be rendered side by side."""
        ...

    def after(self, step: int, model: Model) -> None:
        """Take note that a step is done."""


class FixedRays:
    """Rays whose samples never move; once surfaces have formed, samples behind them are dropped.

    What a field knows of the samples' places is laid out then: for all of them it would take
    most of a training's memory, and longer than the few steps with them gain by it.
    """

    def __init__(
        self, steps: Sequence[tuple[Batch, ...]], field: Field | None = None, asked: int = 0
    ) -> None:
        """Take the batches of `make_batches`, and the field for which they are laid out.

        Args:
            steps: of each its batches.
            field: None: nothing is dropped nor laid out.
            asked: how many steps the training takes; too few: nothing is, either.
        """
        self._steps = list(steps)
        again = (asked - PRUNE_AFTER) / max(1, len(steps))
        self._field = field if again >= WORTH_IT else None

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
            kept = side_by_side([partial(seen_samples, model, b) for b in self._all()])
            self._keep(kept, self._field)

    @torch.no_grad()
    def _keep(self, kept: list[Tensor], field: Field) -> None:
        pairs = zip(self._all(), kept, strict=True)
        left = iter(side_by_side([partial(batch.kept, samples, field) for batch, samples in pairs]))
        self._steps = [tuple(next(left) for _ in batches) for batches in self._steps]

    def _all(self) -> list[Batch]:
        return [batch for batches in self._steps for batch in batches]


@torch.no_grad()
def seen_samples(model: Model, batch: Batch) -> Tensor:
    """Return which samples of a batch light still reaches: (samples,) bool."""
    density, _ = model.field.shade(batch.constants)
    return transmittance_packed(density * batch.length, batch.ray) >= HIDDEN_BELOW
