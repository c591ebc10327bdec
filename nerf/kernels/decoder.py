"""Evaluate the decoder's two layers, with the gradient written down.

Samples go through both layers in parts, so that the hidden values of a part are still in cache
when the second layer, or the other product of the gradient, reads them.
"""

from __future__ import annotations

from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

PART = 4096  # samples; half and double are as fast


def two_layers(
    features: Float[Tensor, "n channels"], hidden: nn.Linear, out: nn.Linear
) -> Float[Tensor, "outputs n"]:
    """Return out(relu(hidden(features))), an output a row."""
    return _TwoLayers.apply(features, hidden.weight, hidden.bias, out.weight, out.bias)


class _TwoLayers(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        features: Tensor,
        weight: Tensor,
        bias: Tensor,
        weight_out: Tensor,
        bias_out: Tensor,
    ) -> Tensor:
        hidden = features.new_empty(len(features), len(weight))
        raw = features.new_empty(len(weight_out), len(features))
        for x, h, y in zip(
            features.split(PART), hidden.split(PART), raw.split(PART, 1), strict=True
        ):
            torch.addmm(bias, x, weight.T, out=h).relu_()
            torch.addmm(bias_out[:, None], weight_out, h.T, out=y)
        ctx.save_for_backward(features, hidden, weight, weight_out)
        return raw

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, ...]:
        features, hidden, weight, weight_out = ctx.saved_tensors
        by_features = torch.empty_like(features)
        by_weight, by_weight_out = torch.zeros_like(weight), torch.zeros_like(weight_out)
        by_bias = weight.new_zeros(len(weight))
        parts = (features, hidden, by_features)
        (upstream,) = gradients
        for x, h, by_x, g in zip(
            *(t.split(PART) for t in parts), upstream.split(PART, 1), strict=True
        ):
            by_weight_out.addmm_(g, h)
            by_h = torch.mm(g.T, weight_out)
            by_h = torch.ops.aten.threshold_backward(by_h, h, 0)  # zero where the relu was
            by_weight.addmm_(by_h.T, x)
            by_bias += by_h.sum(dim=0)
            torch.mm(by_h, weight, out=by_x)
        return by_features, by_weight, by_bias, by_weight_out, upstream.sum(dim=1)
