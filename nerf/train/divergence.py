"""Keep the last good state of a training, and detect divergence."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from toonset.nerf.kernels.loss_terms import is_finite

WINDOW = 20  # steps whose mean loss is judged; also the steps between kept states
DIVERGED = 10.0  # times the best window's loss
WORSE_THAN_START = 2.0  # times the loss before the first step
STILL_GOOD = 2.0  # times the best window's loss: worth keeping


class LastGood:
    """Looks at the loss before every update; a model that has gone wrong goes back.

    A field can go wrong without a loss that is not a number: colours and opacities have limits, so
    parameters that run away show as a loss that stays high.
    """

    def __init__(self, model: nn.Module) -> None:
        """Keep the model as it is before the first step."""
        self._model = model
        self._losses: list[float] = []
        self._first = self._best = float("inf")
        self._kept, self._kept_step = _copied(model), 0

    def wrong(self, loss: Tensor, value: float, step: int) -> str:
        """Return why the training must end before this step's update, or None.

        Args:
            loss: of the step.
            value: the same as a number.
            step: its number.
        """
        if not is_finite(loss):
            return self._back(f"loss not finite at step {step}")
        if step == 0:
            self._first = value
        self._losses.append(value)
        if step % WINDOW == 0:
            return self._judge(step)
        return ""

    def wrong_at_end(self, step: int) -> str:
        """Return what is wrong after the last update, or None."""
        if not all(bool(torch.isfinite(p).all()) for p in self._model.parameters()):
            return self._back("parameters not finite at the end")
        return self._judge(step)

    def _judge(self, step: int) -> str:
        """Keep the model, or go back, by the losses since the last judgement."""
        if not self._losses:
            return ""
        mean = sum(self._losses) / len(self._losses)
        count, self._losses = len(self._losses), []
        limit = min(DIVERGED * self._best, WORSE_THAN_START * self._first)
        if mean > limit:
            return self._back(f"diverged: mean loss {mean:.3g} in the {count} steps to {step}")
        self._best = min(self._best, mean)
        # The loss before this update was finite, so the state that gave it is good.
        if mean <= STILL_GOOD * self._best:
            self._kept, self._kept_step = _copied(self._model), step
        return ""

    def _back(self, reason: str) -> str:
        self._model.load_state_dict(self._kept)
        return f"{reason}, kept the state of step {self._kept_step}"


def _copied(model: nn.Module) -> dict[str, Tensor]:
    return {name: values.detach().clone() for name, values in model.state_dict().items()}
