"""Compute a step's gradient, its parts side by side: batches and smoothness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.train.batches import Batch
from toonset.nerf.train.loss import Model, Weights, loss_terms

Part = tuple[Float[Tensor, " 3"], tuple[Tensor | None, ...]]


def gradients_of(model: Model, batches: Sequence[Batch], weights: Weights) -> Part:
    """Return a step's loss and its gradient.

    Sums run in the order of the batches, whoever came first: the same bits with any number of
    threads.

    Args:
        model: its parameters are left as they are.
        batches: a step's rays; each counts by the rays that it has.
        weights: of the loss's terms.

    Returns:
        the photometric, cross-entropy and smoothness terms, and for each of the model's parameters
        its gradient, None where the loss does not depend on it.
    """
    rays = sum(len(batch.rgb) for batch in batches)
    rough = replace(weights, smoothness=0.0)
    tasks = [partial(_of_rays, model, b, rough, len(b.rgb) / rays) for b in batches]
    if weights.smoothness:
        tasks.append(partial(_of_smoothness, model, weights.smoothness))
    (terms, total), *others = side_by_side(tasks)
    for more, gradients in others:
        terms = terms + more
        total = tuple(map(_added, total, gradients))
    return terms, total


def _of_rays(model: Model, batch: Batch, weights: Weights, share: float) -> Part:
    terms = torch.stack(loss_terms(model, batch, weights)) * share
    return terms.detach(), _gradients(model, terms.sum())


def _of_smoothness(model: Model, weight: float) -> Part:
    smoothness = weight * model.field.roughness()
    terms = smoothness.detach() * smoothness.new_tensor([0.0, 0.0, 1.0])
    return terms, _gradients(model, smoothness)


def _gradients(model: Model, loss: Float[Tensor, ""]) -> tuple[Tensor | None, ...]:
    if not loss.requires_grad:  # a network alone has nothing to smooth
        return tuple(None for _ in model.parameters())
    return torch.autograd.grad(loss, list(model.parameters()), allow_unused=True)


def _added(first: Tensor | None, second: Tensor | None) -> Tensor | None:
    if first is None or second is None:
        return second if first is None else first
    return first.add_(second)
