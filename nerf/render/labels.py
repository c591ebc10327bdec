"""Compute which palette colours cover every pixel, and how far.

A ray that falls between two colours sees a blend of both, and a blend may look like a third:
between green cloth and light skin lies brown. So what a ray on a border sees, c, is explained in
two ways, and the nearer one counts:

    one paint      the classifier's label,                     |c - a|
    two paints     out of the commonest in the pixels around,  min over t of |c - (1 - t) a - t b|

Of two paints each gets its share, made steeper: the field is softer than a drawing.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.kernels.loss_terms import OPAQUE_ENOUGH

LEVELS = 64  # levels of a channel in the table of labels
COLORS_PER_CHUNK = 1 << 12  # that get labels together
REACH = 2  # pixels around in which a paint must be seen
LEAST_SEEN = 0.5  # pixels of it
PAINTS = 3  # around, that a blend may be made of
STEEPNESS = 2.0
TINY = 1e-6  # squared distance of two paints that count as one
NONE = -1


def label_table(classifier: PaletteClassifier) -> UInt8[Tensor, "red green blue"]:
    """Return the label of every colour, in LEVELS levels a channel."""
    level = (torch.arange(LEVELS) + 0.5) / LEVELS
    colors = torch.cartesian_prod(level, level, level).split(COLORS_PER_CHUNK)
    labels = torch.cat([classifier(chunk).argmax(dim=1).byte() for chunk in colors])
    return labels.view(LEVELS, LEVELS, LEVELS)


def labels_of(
    table: UInt8[Tensor, "red green blue"],
    color: Float[Tensor, "3 ..."],
    opacity: Float[Tensor, " *rays"],
) -> Int[Tensor, " *rays"]:
    """Return the label of every ray's premultiplied colour, NONE for empty rays."""
    red, green, blue = _straight(color, opacity).mul_(LEVELS).clamp_(0, LEVELS - 1).int()
    index = (red * LEVELS + green) * LEVELS + blue
    labels = table.view(-1).index_select(0, index.view(-1)).view(index.shape).long()
    return torch.where(opacity > 0, labels, NONE)


def palette_shares(
    table: UInt8[Tensor, "red green blue"],
    paints: Float[Tensor, "colors 3"],
    opacity: Float[Tensor, "height width"],
    labels: Int[Tensor, "height width"],
    border: Bool[Tensor, "height width"],
    more: Float[Tensor, "5 pixels rays"],
) -> Float[Tensor, "height width colors"]:
    """Return the share of every pixel that each palette colour covers, premultiplied.

    Args:
        table: colour to label.
        paints: what the field shows for each label; nan for one that it shows nowhere.
        opacity: at the pixels' middles.
        labels: of the same rays.
        border: pixels through which more rays went.
        more: premultiplied colour and opacity (the rest is not read) that these rays saw.
    """
    whole = torch.zeros(*labels.shape, len(paints))
    whole.scatter_(2, labels.clamp_min(0)[..., None], opacity[..., None])
    rays = _Blends.of(labels_of(table, more[:3], more[3]).clamp_min_(0), more[3])
    whole[border] = rays.shares(len(paints))
    size = (2 * REACH + 1, 2 * REACH + 1)
    around = cv2.boxFilter(whole.numpy(), -1, size, normalize=False).reshape(whole.shape)
    unmixed = rays.unmixed(_straight(more[:3], more[3]), torch.from_numpy(around)[border], paints)
    whole[border] = unmixed.shares(len(paints))
    return whole


@dataclass(frozen=True, eq=False)
class _Blends:
    """Blends that rays show: `part` of one palette colour and the rest of another.

    Attributes:
        first, second: (pixels, rays) labels.
        part: of the second.
        opacity: of the ray.
    """

    first: Int[Tensor, "pixels rays"]
    second: Int[Tensor, "pixels rays"]
    part: Float[Tensor, "pixels rays"]
    opacity: Float[Tensor, "pixels rays"]

    @classmethod
    def of(
        cls, labels: Int[Tensor, "pixels rays"], opacity: Float[Tensor, "pixels rays"]
    ) -> _Blends:
        """Return rays that show one colour each."""
        return cls(labels, labels, torch.zeros_like(opacity), opacity)

    def shares(self, colors: int) -> Float[Tensor, "pixels colors"]:
        """Return the share of every pixel that each colour covers."""
        second = self.part * self.opacity
        shares = torch.zeros(len(self.part), colors)
        shares.scatter_add_(1, self.first, self.opacity - second).scatter_add_(
            1, self.second, second
        )
        return shares / max(self.part.shape[1], 1)

    def unmixed(
        self,
        color: Float[Tensor, "3 pixels rays"],
        around: Float[Tensor, "pixels colors"],
        paints: Float[Tensor, "colors 3"],
    ) -> _Blends:
        """Return the rays with those divided between two paints that blends explain better.

        `color` is straight; `around` counts pixels in which each paint is seen.
        """
        best = self
        least = _apart(color, paints.T[:, self.first]).nan_to_num_(nan=torch.inf)
        seen, common = around.topk(min(PAINTS, around.shape[1]), dim=1)
        for i, j in itertools.combinations(range(common.shape[1]), 2):
            first, second = (paints.T[:, common[:, number], None] for number in (i, j))
            way = second - first
            part = ((color - first) * way).sum(dim=0) / way.square().sum(dim=0).clamp_min(TINY)
            part.clamp_(0, 1)
            off = _apart(color, first + part * way)
            nearer = (off < least) & (seen[:, j, None] >= LEAST_SEEN)
            steep = ((part - 0.5) * STEEPNESS + 0.5).clamp_(0, 1)
            best = _Blends(
                torch.where(nearer, common[:, i, None], best.first),
                torch.where(nearer, common[:, j, None], best.second),
                torch.where(nearer, steep, best.part),
                self.opacity,
            )
            least = torch.where(nearer, off, least)
        return best


def _apart(a: Float[Tensor, "3 ..."], b: Float[Tensor, "3 ..."]) -> Float[Tensor, " ..."]:
    return (a - b).square_().sum(dim=0)


def _straight(
    color: Float[Tensor, "3 ..."], opacity: Float[Tensor, " *rays"]
) -> Float[Tensor, "3 ..."]:
    return color / opacity.clamp_min(OPAQUE_ENOUGH)
