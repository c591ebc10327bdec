"""Run Adam in public tensor operations.

`torch.optim` has the same, but imports torch's compiler, `torch._dynamo`, as soon as an optimiser
is made (docs/decisions.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

EPSILON = 1e-8


@dataclass(frozen=True, eq=False)
class Group:
    """Parameters with a learning rate of their own.

    Attributes:
        parameters: what is fitted, in place.
        rate: learning rate at the start.
    """

    parameters: Sequence[Tensor]
    rate: float


class Adam:
    """Adam with bias correction; the learning rates are multiplied by a common factor per step.

    Source: Kingma and Ba, "Adam: a method for stochastic optimization", 2015, algorithm 1.
    """

    def __init__(self, groups: Sequence[Group], betas: tuple[float, float] = (0.9, 0.99)) -> None:
        """Begin with zero moments."""
        self._betas, self._count = betas, 0
        self._moments = [
            (values, group.rate, torch.zeros_like(values), torch.zeros_like(values))
            for group in groups
            for values in group.parameters
        ]

    @torch.no_grad()
    def step(self, factor: float = 1.0) -> None:
        """Move every parameter that has a gradient, and forget the gradients.

        Args:
            factor: of all learning rates.
        """
        self._count += 1
        slow, fast = self._betas
        mean_of, root_of = 1 - slow**self._count, math.sqrt(1 - fast**self._count)
        for values, rate, mean, square in self._moments:
            gradient, values.grad = values.grad, None
            if gradient is not None:
                mean.lerp_(gradient, 1 - slow)
                square.mul_(fast).addcmul_(gradient, gradient, value=1 - fast)
                spread = square.sqrt().div_(root_of).add_(EPSILON)
                values.addcdiv_(mean, spread, value=-factor * rate / mean_of)
