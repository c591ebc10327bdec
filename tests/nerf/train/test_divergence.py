"""When a training has gone wrong, by its losses, and to which state it goes back."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from toonset.nerf.train.divergence import DIVERGED, WINDOW, LastGood


def judged(losses: list[float]) -> tuple[str, float, int]:
    """Return what is said of these losses, the weight kept, and at which step it was said."""
    model = nn.Linear(1, 1, bias=False)
    good = LastGood(model)
    for step, loss in enumerate(losses):
        with torch.no_grad():
            model.weight.fill_(step)
        if wrong := good.wrong(torch.tensor(loss), loss, step):
            return wrong, float(model.weight.detach()), step
    return good.wrong_at_end(len(losses)), float(model.weight.detach()), len(losses)


def test_a_loss_that_stays_high_goes_back_to_the_best_state() -> None:
    fine = [1.0] + [0.1] * (3 * WINDOW)
    wrong, kept, step = judged(fine + [0.1 * DIVERGED * 1.1] * 2 * WINDOW)
    assert step == 4 * WINDOW
    assert wrong == f"diverged: mean loss 1.1 in the 20 steps to 80, kept the state of step {60}"
    assert kept == 60
    wrong, kept, _ = judged([0.3] + [0.7] * 3 * WINDOW)  # worse than before the first step
    assert wrong.startswith("diverged: mean loss 0.7 in the 20 steps to 20")
    assert kept == 0
    wrong, kept, _ = judged([*fine, float("inf")])
    assert (wrong, kept) == (
        f"loss not finite at step {3 * WINDOW + 1}, kept the state of step 60",
        60,
    )


@pytest.mark.parametrize(
    "losses",
    [
        [1.0] + [0.1] * 100,
        [1.0] + [0.1] * 60 + [0.4] * 40,  # a harder part of the training
        [1.0] + [0.1, 0.1, 0.1, 0.9] * 40,  # single bad batches
        [0.5 * 0.97**step for step in range(300)],
        [0.01] * 100,
        [],
    ],
)
def test_a_loss_that_wanders_is_left_alone(losses: list[float]) -> None:
    assert judged(losses)[0] == ""
