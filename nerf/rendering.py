"""Differentiable volume rendering of packed samples."""

from __future__ import annotations

import torch
from jaxtyping import Float, Int
from torch import Tensor


def composite(
    density: Float[Tensor, "*rays samples"],
    color: Float[Tensor, "*rays samples colors"],
    edges: Float[Tensor, "*rays samples+1"],
) -> tuple[Float[Tensor, "*rays colors"], Float[Tensor, " *rays"]]:
    """Composite samples front to back; return premultiplied color and opacity.

    Stable for any density >= 0: products of transmittances are sums of optical depths.

    Args:
        density: per world unit, >= 0.
        color: of every sample.
        edges: where samples begin and end along the ray, world units, ascending.

    Source: NeRF (Mildenhall et al. 2020), equation 3.
    """
    weights = compositing_weights(density * edges.diff(dim=-1))
    return (weights[..., None] * color).sum(dim=-2), weights.sum(dim=-1)


def compositing_weights(
    optical_depth: Float[Tensor, "*rays samples"],
) -> Float[Tensor, "*rays samples"]:
    """Return how much each sample contributes to its ray, given density times length."""
    before = optical_depth.cumsum(dim=-1) - optical_depth  # between the viewer and the sample
    return torch.exp(-before) * -torch.expm1(-optical_depth)


def padded(
    packed: Float[Tensor, "n channels"],
    ray: Int[Tensor, " n"],
    order: Int[Tensor, " n"],
    rays: int,
    most: int,
) -> Float[Tensor, "rays most channels"]:
    """Return packed samples as a (rays, most) table, zero where a ray has fewer samples.

    A zero density is empty space, so padding changes no rendering.
    """
    table = packed.new_zeros(rays * most, packed.shape[1])
    return table.index_copy(0, ray * most + order, packed).view(rays, most, -1)
