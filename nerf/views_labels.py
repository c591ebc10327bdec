"""Which palette colours every pixel shows, and how much of it each covers.

A ray that falls between two colours sees a blend of both, and a blend may look like a third:
between green cloth and light skin lies brown. So what a ray on a border sees, c, is explained in
two ways, and the nearer one counts:

    one paint      the classifier's label,                     |c - a|
    two paints     out of the commonest in the pixels around,  min over t of |c - (1 - t) a - t b|

Of two paints each gets its share, made steeper: the field is softer than a drawing.
"""

from __future__ import annotations

import itertools

import cv2
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from toonset.nerf.classifier import PaletteClassifier
from toonset.nerf.losses import straight

RAYS_PER_CHUNK = 1 << 12  # that get labels together
REACH = 2  # pixels around in which a paint must be seen
LEAST_SEEN = 0.5  # pixels of it
PAINTS = 3  # around, that a blend may be made of
STEEPNESS = 2.0
TINY = 1e-6  # squared distance of two paints that count as one
NONE = -1


def labels_of(
    classifier: PaletteClassifier,
    color: Float[Tensor, "*rays 3"],
    opacity: Float[Tensor, " *rays"],
) -> Int[Tensor, " *rays"]:
    """Return the label of every ray's colour, NONE where it meets nothing."""
    labels = torch.full((opacity.numel(),), NONE)
    color, flat = color.reshape(-1, 3), opacity.reshape(-1)
    for hit in (flat > 0).nonzero()[:, 0].split(RAYS_PER_CHUNK):
        labels[hit] = classifier(straight(color[hit], flat[hit])).argmax(dim=1)
    return labels.view(opacity.shape)


def palette_shares(
    classifier: PaletteClassifier,
    paints: Float[Tensor, "colors 3"],
    seen: Float[Tensor, "height width 5"],
    labels: Int[Tensor, "height width"],
    border: Bool[Tensor, "height width"],
    more: Float[Tensor, "pixels rays 5"],
) -> Float[Tensor, "height width colors"]:
    """Return the share of every pixel that each palette colour covers, premultiplied.

    Args:
        classifier: colour to label.
        paints: what the field shows for each label; nan for one that it shows nowhere.
        seen: premultiplied colour and opacity (the rest is not read) at the pixels' middles.
        labels: of the same rays.
        border: pixels through which more rays went.
        more: what these rays saw.
    """
    color, opacity = more[..., :3], more[..., 3]
    whole = _shares(labels, seen[..., 3], len(paints))
    parts = _shares(labels_of(classifier, color, opacity), opacity, len(paints))
    whole[border] = parts.mean(dim=1)
    size = (2 * REACH + 1, 2 * REACH + 1)
    around = cv2.boxFilter(whole.numpy(), -1, size, normalize=False).reshape(whole.shape)
    around = torch.from_numpy(around)[border]
    mixed = ((around >= LEAST_SEEN).sum(dim=1) > 1).nonzero()[:, 0]
    if len(mixed):
        parts[mixed] = _unmixed(
            parts[mixed], straight(color[mixed], opacity[mixed]), around[mixed], paints
        )
        whole[border] = parts.mean(dim=1)
    return whole


def _unmixed(
    shares: Float[Tensor, "pixels rays colors"],
    color: Float[Tensor, "pixels rays 3"],
    around: Float[Tensor, "pixels colors"],
    paints: Float[Tensor, "colors 3"],
) -> Float[Tensor, "pixels rays colors"]:
    """Return the shares of single labels, with blends of two paints divided between these.

    `color` is straight; `around` counts pixels in which each paint is seen, two paints or more in
    LEAST_SEEN.
    """
    opacity = shares.sum(dim=2)
    off = (color - paints[shares.argmax(dim=2)]).square().sum(dim=2)
    least = torch.where(off.isnan(), torch.inf, off)
    seen, common = around.topk(min(PAINTS, around.shape[1]), dim=1)
    for i, j in itertools.combinations(range(common.shape[1]), 2):
        first, second = (paints[common[:, number], None] for number in (i, j))
        way = second - first
        part = ((color - first) * way).sum(dim=2) / way.square().sum(dim=2).clamp_min(TINY)
        part = part.clamp_(0, 1)
        off = (color - first - part[..., None] * way).square().sum(dim=2)
        nearer = (off < least) & (seen[:, j, None] >= LEAST_SEEN)
        part = ((part - 0.5) * STEEPNESS + 0.5).clamp_(0, 1) * opacity
        pair = torch.zeros_like(shares)
        for number, share in ((i, opacity - part), (j, part)):
            pair.scatter_(
                2, common[:, number, None, None].expand_as(share[..., None]), share[..., None]
            )
        shares = torch.where(nearer[..., None], pair, shares)
        least = torch.where(nearer, off, least)
    return shares


def _shares(
    labels: Int[Tensor, "*rays"], opacity: Float[Tensor, "*rays"], colors: int
) -> Float[Tensor, "*rays colors"]:
    """Return each ray's opacity in the column of its label."""
    shares = torch.zeros(*labels.shape, colors)
    return shares.scatter_(-1, labels.clamp_min(0)[..., None], opacity[..., None])
