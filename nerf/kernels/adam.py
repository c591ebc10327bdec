"""Adam by torch's fused kernel, which goes through memory once.

`torch.optim` would call the same, but imports torch's compiler, `torch._dynamo`, as soon as an
optimiser is made. The state is plain tensors.
"""

from __future__ import annotations

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
        self.groups = tuple(groups)
        self.betas = betas
        self.count = 0
        parameters = [p for group in self.groups for p in group.parameters]
        self.first = [torch.zeros_like(p) for p in parameters]
        self.second = [torch.zeros_like(p) for p in parameters]

    @torch.no_grad()
    def step(self, factor: float = 1.0) -> None:
        """Move every parameter that has a gradient, and forget the gradients.

        Args:
            factor: of all learning rates.
        """
        self.count += 1
        slow, fast = self.betas
        moments = iter(zip(self.first, self.second, strict=True))
        for group in self.groups:
            for parameter in group.parameters:
                first, second = next(moments)
                if parameter.grad is None:
                    continue
                gradient = _laid_out_as(parameter, parameter.grad)
                count = torch.full((), float(self.count), device=parameter.device)
                torch._fused_adam_(
                    [parameter],
                    [gradient],
                    [first],
                    [second],
                    [],
                    [count],
                    lr=factor * group.rate,
                    beta1=slow,
                    beta2=fast,
                    weight_decay=0.0,
                    eps=EPSILON,
                    amsgrad=False,
                    maximize=False,
                )
                parameter.grad = None


def _laid_out_as(parameter: Tensor, gradient: Tensor) -> Tensor:
    """Return the gradient with the parameter's strides: the kernel walks memory and asks nobody."""
    if gradient.stride() == parameter.stride():
        return gradient
    return torch.empty_like(parameter).copy_(gradient)
