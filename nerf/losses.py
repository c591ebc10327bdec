"""The terms of the training loss."""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from toonset.palette.labels import UNLABELLED

BACKDROP = 0.5  # grey behind the figure in training: neither white nor black parts hide holes
OPACITY_WEIGHT = 0.1
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
    color: Float[Tensor, "rays 3"], opacity: Float[Tensor, " rays"]
) -> Float[Tensor, "rays 3"]:
    """Return the colour without its opacity."""
    return color / opacity.clamp_min(OPAQUE_ENOUGH)[:, None]


def cross_entropy(
    logits: Float[Tensor, "rays colors"], labels: Int[Tensor, " rays"]
) -> Float[Tensor, ""]:
    """Return the mean cross-entropy over labelled rays, 0 if there is none."""
    known = labels != UNLABELLED
    return F.cross_entropy(logits[known], labels[known]) if bool(known.any()) else logits.sum() * 0


def total_variation(
    planes: Sequence[Float[Tensor, "height width channels"]],
) -> Float[Tensor, ""]:
    """Return the mean absolute step between neighbouring cells, summed over the channels."""
    steps, count = planes[0].new_zeros(()), 0
    for plane in planes:
        steps = steps + plane.diff(dim=0).abs().sum() + plane.diff(dim=1).abs().sum()
        count += plane.shape[0] * plane.shape[1]
    return steps / count


def smoothness_weight(smoothness: float, views: int) -> float:
    """Return the weight of the total variation: the fewer views, the more must be guessed."""
    return smoothness * max(1.0, REFERENCE_VIEWS / max(views, 1)) ** 2


def is_finite(loss: Tensor) -> bool:
    """Return whether a loss is a number."""
    return bool(torch.isfinite(loss))
