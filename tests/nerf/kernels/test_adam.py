"""Our Adam against torch's."""

from __future__ import annotations

import pytest
import torch

from toonset.nerf.kernels.adam import Adam, Group


def _gradient(values: torch.Tensor, step: int) -> torch.Tensor:
    return torch.sin(3 * values + step)


@pytest.mark.parametrize("betas", [(0.9, 0.999), (0.9, 0.99), (0.5, 0.9)])
def test_steps_are_those_of_torch(betas: tuple[float, float]) -> None:
    start = torch.linspace(-1, 1, 50, dtype=torch.float64)
    ours, theirs = start.clone().requires_grad_(), start.clone().requires_grad_()
    adam = Adam([Group([ours], 0.1)], betas)
    reference = torch.optim.Adam([theirs], lr=0.1, betas=betas)
    for step in range(30):
        ours.grad, theirs.grad = _gradient(ours.detach(), step), _gradient(theirs.detach(), step)
        adam.step(0.9**step)
        reference.param_groups[0]["lr"] = 0.1 * 0.9**step
        reference.step()
    torch.testing.assert_close(ours, theirs, rtol=1e-9, atol=1e-9)


def test_what_has_no_gradient_stays() -> None:
    moved, still = (torch.ones(3, requires_grad=True) for _ in range(2))
    adam = Adam([Group([moved], 0.1), Group([still], 0.1)])
    moved.grad = torch.ones(3)
    adam.step()
    assert still.tolist() == [1, 1, 1]
    assert moved.tolist() == pytest.approx([0.9] * 3)
    assert moved.grad is None


def test_a_gradient_by_columns_moves_its_own_rows() -> None:
    rows, columns = (torch.arange(6.0).view(2, 3).requires_grad_() for _ in range(2))
    gradient = torch.tensor([[1.0, -1.0, 1.0], [1.0, 1.0, -1.0]])
    for values, given in ((rows, gradient), (columns, gradient.T.contiguous().T)):
        values.grad = given
        Adam([Group([values], 0.1)]).step()
    torch.testing.assert_close(columns, rows, rtol=0, atol=0)
