"""Everything that the rest of a training depends on, between two of its steps."""

from __future__ import annotations

from dataclasses import dataclass, field

from torch import Tensor

from toonset.nerf.train.result import Step


@dataclass(frozen=True, eq=False)
class FitState:
    """A training between two steps.

    Attributes:
        history: every step so far.
        parameters: of the model, by name.
        means: Adam's running means of the gradients, by the same names.
        squares: and of their squares.
        queue: batches that this round through the rays still has to visit, the last one first.
        generator: state of the generator that shuffles the batches.
        torch_generator: state of torch's own generator.
        rays: what has changed about the rays.
    """

    history: tuple[Step, ...]
    parameters: dict[str, Tensor]
    means: dict[str, Tensor]
    squares: dict[str, Tensor]
    queue: tuple[int, ...]
    generator: Tensor
    torch_generator: Tensor
    rays: dict[str, Tensor] = field(default_factory=dict)

    @property
    def steps(self) -> int:
        """Return how many steps are done."""
        return len(self.history)

    @property
    def seconds(self) -> float:
        """Return how long they took."""
        return self.history[-1].seconds if self.history else 0.0
