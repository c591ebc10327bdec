"""Compute the loss of one step: a batch of rays, rendered and compared with the drawings."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from toonset.nerf.fields.base import Field
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.kernels import loss_terms as terms
from toonset.nerf.kernels.compositing import composite_even, composite_packed
from toonset.nerf.train.batches import Batch

CLASSIFIED = 4  # of so many pixels of a batch one teaches the classifier, which learns in no time


class Model(nn.Module):
    """The parameters of a training: field and, with a palette, classifier."""

    def __init__(self, field: Field, classifier: PaletteClassifier | None) -> None:
        """Hold both."""
        super().__init__()
        self.field = field
        self.classifier = classifier


@dataclass(frozen=True)
class Weights:
    """Weights of the loss's terms.

    Attributes:
        palette: of the cross-entropy.
        smoothness: of the tables' total variation.
        backdrop: grey behind drawings and renderings.
        opacity: of the error of opacity; 0: silhouettes count through the backdrop alone.
    """

    palette: float
    smoothness: float
    backdrop: float = terms.BACKDROP
    opacity: float = terms.OPACITY_WEIGHT


def loss_terms(
    model: Model, batch: Batch, weights: Weights
) -> tuple[Float[Tensor, ""], Float[Tensor, ""], Float[Tensor, ""]]:
    """Return the weighted photometric, cross-entropy and smoothness terms of a batch."""
    color, opacity = render_batch(model.field, batch)
    photometric = terms.photometric(
        color, opacity, batch.rgb, batch.alpha, weights.backdrop, weights.opacity
    )
    entropy = photometric.new_zeros(())
    if model.classifier is not None:
        few = slice(0, None, CLASSIFIED)
        logits = model.classifier(terms.straight(color[few], opacity[few]))
        entropy = weights.palette * terms.cross_entropy(logits, batch.labels[few])
    smooth = photometric.new_zeros(())
    if weights.smoothness:
        smooth = weights.smoothness * model.field.roughness()
    return photometric, entropy, smooth


def render_batch(
    field: Field, batch: Batch
) -> tuple[Float[Tensor, "pixels 3"], Float[Tensor, " pixels"]]:
    """Return premultiplied colour and opacity of a batch's pixels."""
    density, rgb = field.shade(batch.constants)
    depth, rays = density * batch.length, batch.rays
    if batch.even:
        return composite_even(depth.view(rays, -1), rgb.T.reshape(3, rays, -1))
    color, opacity = composite_packed(depth, rgb, batch.ray, rays)
    if batch.pixel is None or batch.share is None:
        return color, opacity
    seen = torch.cat([color, opacity[:, None]], dim=1) * batch.share[:, None]
    mean = seen.new_zeros(len(batch.rgb), 4).index_add(0, batch.pixel, seen)
    return mean[:, :3], mean[:, 3]
