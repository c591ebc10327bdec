"""Compute the terms of the training loss."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from toonset.palette.pixels.labels import UNLABELLED

BACKDROP = 0.5  # grey behind the figure in training: neither white nor black parts hide holes
OPACITY_WEIGHT = 0.1
DISAGREEING = 64.0  # times the smoothness, of drawings that disagree (docs/decisions.md)
REFERENCE_VIEWS = 8  # views for which `TrainOptions.smoothness` is stated
OPAQUE_ENOUGH = 0.05  # opacity below which a rendered colour means nothing


def photometric(
    color: Float[Tensor, "rays 3"],
    opacity: Float[Tensor, " rays"],
    drawn: Float[Tensor, "rays 3"],
    alpha: Float[Tensor, " rays"],
    backdrop: float = BACKDROP,
    opacity_weight: float = OPACITY_WEIGHT,
) -> Float[Tensor, ""]:
    """Return the squared error of colours over a grey, plus that of opacity.

    Args:
        color: rendered, premultiplied.
        opacity: rendered.
        drawn: straight colour of the drawing.
        alpha: coverage of the drawing.
        backdrop: the grey, 0 to 1.
        opacity_weight: of the error of opacity; 0: pictures alone.
    """
    missing = alpha - opacity
    error = color - alpha[:, None] * drawn + missing[:, None] * backdrop
    return error.square().sum(dim=-1).mean() + opacity_weight * missing.square().mean()


def straight(
    color: Float[Tensor, "*rays 3"], opacity: Float[Tensor, "*rays"]
) -> Float[Tensor, "*rays 3"]:
    """Return the colour without its opacity."""
    return color / opacity.clamp_min(OPAQUE_ENOUGH)[..., None]


def cross_entropy(
    logits: Float[Tensor, "rays colors"], labels: Int[Tensor, " rays"]
) -> Float[Tensor, ""]:
    """Return the mean cross-entropy over labelled rays, 0 without labels."""
    known = labels != UNLABELLED
    return F.cross_entropy(logits[known], labels[known]) if bool(known.any()) else logits.sum() * 0


def total_variation(
    table: Float[Tensor, "entries channels"], shapes: Sequence[Sequence[int]]
) -> Float[Tensor, ""]:
    """Return the mean absolute step between neighbours, summed over the channels.

    The gradient is a count of signs, and the value its product with the table: half the time of
    differences that autograd follows.

    Args:
        table: the values of all grids, one grid after another.
        shapes: of every grid, e.g. (height, width).
    """
    return _TotalVariation.apply(table, shapes)


class _TotalVariation(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, table: Tensor, shapes: Sequence[Sequence[int]]) -> Tensor:
        signs, first = torch.zeros_like(table), 0
        for shape in shapes:
            last = first + math.prod(shape)
            grid, count = (t[first:last].view(*shape, -1) for t in (table, signs))
            for axis, length in enumerate(shape):
                step = grid.diff(dim=axis).sign_()
                count.narrow(axis, 1, length - 1).add_(step)
                count.narrow(axis, 0, length - 1).sub_(step)
            first = last
        ctx.save_for_backward(signs)
        return signs.view(-1).dot(table.view(-1)) / len(table)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (signs,) = ctx.saved_tensors
        return signs * (gradients[0] / len(signs)), None


def smoothness_weight(smoothness: float, views: int, *, agree: bool) -> float:
    """Return the weight of the total variation: the fewer views, the more must be guessed.

    Where drawings do not agree, fine planes would show every drawing's own version at once.
    """
    weight = smoothness * max(1.0, REFERENCE_VIEWS / max(views, 1)) ** 2
    return weight if agree else DISAGREEING * weight


def is_finite(loss: Tensor) -> bool:
    """Return whether a loss is a number."""
    return bool(torch.isfinite(loss))
