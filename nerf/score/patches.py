"""Find the small patches of a picture: features that drawings have, and fragments that none has.

A patch is a connected area of one paint. Small ones are what a torn picture has too many of: crumbs
of ink, slivers, halves of eyes. But eyes and buttons are small, too: a patch of a view is a feature
if a drawing beside the view has its like, of the same paint, about as large and as high up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.silhouettes.mask import mask_of
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.pixels.labels import UNLABELLED, label_pixels
from toonset.raster import dilate, sized_parts

LARGEST = 2e-2  # of the squared height: larger patches are parts of the body, no eyes
CRUMB = 2.5e-3  # of the squared height: larger patches are no fragments
LEAST = 3e-5  # of the squared height: smaller ones nobody sees
LEAST_EYE, UPPER, FILLED = 3e-4, 0.6, 0.4  # of the squared height; of the height; of its box
ALIKE = 2.5  # times as large at most, or as small
COARSE, MOST_PAINTS = 16, 12  # levels of a channel that count as one; colours
APART = 0.14  # in OKLab: tones of one paint are nearer, mostly
LEAST_SHARE = 4e-4  # of all drawn pixels: a colour on fewer is a blend's
AS_HIGH = 0.03  # of the height: how far up or down a patch and its like may lie


@dataclass(frozen=True, eq=False)
class Patches:
    """Small patches of one picture.

    Attributes:
        paint: (n,) of each.
        area: (n,) share of the figure's squared height.
        below: (n,) how far the middle lies below the top of a figure that stands where this one
            does, share of the height.
        enclosed: (n,) it lies inside the figure, off its outline.
        filled: (n,) share of its bounding box.
    """

    paint: UInt8[np.ndarray, " n"]
    area: Float[np.ndarray, " n"]
    below: Float[np.ndarray, " n"]
    enclosed: Bool[np.ndarray, " n"]
    filled: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.paint)

    def where(self, chosen: Bool[np.ndarray, " n"]) -> Patches:
        """Return some of them."""
        return Patches(*(column[chosen] for column in vars(self).values()))

    def alike(self, other: Patches) -> Bool[np.ndarray, "n others"]:
        """Return which of these are like which of another picture's."""
        ratio = np.abs(np.log(self.area)[:, None] - np.log(other.area))
        return (
            (self.paint[:, None] == other.paint)
            & (ratio <= np.log(ALIKE))
            & (np.abs(self.below[:, None] - other.below) <= AS_HIGH)
        )


def patches_of(
    rgba: UInt8[np.ndarray, "height width 4"],
    paints: UInt8[np.ndarray, "paints 3"],
    height_px: float,
) -> Patches:
    """Return the small patches of a picture's nearest paints; blends of two have none.

    Args:
        rgba: a picture, straight alpha.
        paints: colours.
        height_px: of the figure.
    """
    figure = mask_of(rgba)
    rows = np.flatnonzero(figure.any(axis=1))
    if not len(rows):
        return _joined([])
    top = rows[-1] + 1 - height_px  # feet stand where they are, hats and ears may be torn
    labels = label_pixels(rgba, paints)
    rim = dilate(~figure, 2)
    found = []
    for paint in np.unique(labels[labels != UNLABELLED]).tolist():
        part, areas = sized_parts(labels == paint)
        shares = areas / height_px**2
        small = (shares >= LEAST) & (shares <= LARGEST)
        small[0] = False
        at = np.flatnonzero(small[part])
        own = part.ravel()[at]
        y, x = np.divmod(at, labels.shape[1])
        below = (np.bincount(own, y + 0.5, len(areas)) / np.maximum(areas, 1) - top) / height_px
        box = np.prod([_extent(own, side, len(areas)) for side in (x, y)], axis=0)
        outside = np.bincount(own, rim.ravel()[at], len(areas)) > 0
        number = np.full(len(areas), paint, np.uint8)
        found.append(Patches(number, shares, below, ~outside, areas / box).where(small))
    return _joined(found)


def plain_colors(pictures: Sequence[UInt8[np.ndarray, "_ _ 4"]]) -> UInt8[np.ndarray, "paints 3"]:
    """Return colours that people tell apart, those that cover most first, small features' too.

    A palette leaves out what covers little: the white of eyes. Here every next colour is the one
    that is most missed: far from those chosen, and on many pixels.
    """
    shown = np.concatenate([picture[mask_of(picture), :3] for picture in pictures])
    _, which, count = np.unique(shown // COARSE, axis=0, return_inverse=True, return_counts=True)
    means = [np.bincount(which.ravel(), shown[:, k], len(count)) / count for k in range(3)]
    colors = np.stack(means, axis=1).round().astype(np.uint8)
    lab, chosen = oklab_from_rgb(colors), [int(count.argmax())]
    apart = np.full(len(colors), np.inf)
    while len(chosen) < MOST_PAINTS:
        apart = np.minimum(apart, np.linalg.norm(lab - lab[chosen[-1]], axis=1))
        missed = np.where(
            (apart >= APART) & (count >= LEAST_SHARE * len(shown)), apart * np.sqrt(count), 0
        )
        if not missed.any():
            break
        chosen.append(int(missed.argmax()))
    return colors[chosen]


def fragments(view: Patches, beside: Sequence[Patches]) -> int:
    """Return how many patches of a view are no feature of the drawings beside it.

    Each feature answers for one patch: an eye in two halves is a feature and a fragment.
    """
    crumbs = view.where(view.area <= CRUMB)
    return len(crumbs) - max((matched(crumbs, one) for one in beside), default=0)


def eye_like(patches: Patches) -> Patches:
    """Return those that may be eyes, mouths, badges: inside the upper figure, compact."""
    chosen = patches.enclosed & (patches.filled >= FILLED) & (patches.area >= LEAST_EYE)
    return patches.where(chosen & (patches.below <= UPPER))


def features(first: Patches, second: Patches) -> Patches:
    """Return the eye-like patches that both drawings beside a view show, as the first has them."""
    one, other = eye_like(first), eye_like(second)
    if not len(one) or not len(other):
        return one.where(np.zeros(len(one), bool))
    return one.where(_pairs(one, other) >= 0)


def matched(view: Patches, drawing: Patches) -> int:
    """Return how many patches of a view have their own like in a drawing."""
    if not len(view) or not len(drawing):
        return 0
    return int((_pairs(view, drawing) >= 0).sum())


def _pairs(first: Patches, second: Patches) -> Int[np.ndarray, " n"]:
    """Return the like of every patch, no two the same; -1 of those without (bipartite matching)."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import maximum_bipartite_matching

    alike = csr_array(first.alike(second))
    return np.asarray(maximum_bipartite_matching(alike, perm_type="column"))


def _extent(part: Int[np.ndarray, " n"], at: Int[np.ndarray, " n"], parts: int) -> np.ndarray:
    """Return how many pixels along one side every part's box has; 1 of parts that are not there."""
    low, high = np.full(parts, np.iinfo(np.int64).max), np.full(parts, -1)
    np.minimum.at(low, part, at)
    np.maximum.at(high, part, at)
    return np.where(high >= 0, high - low + 1, 1)


def _joined(parts: Sequence[Patches]) -> Patches:
    none = np.zeros(0)
    whole = [*parts, Patches(none.astype(np.uint8), none, none, none.astype(bool), none)]
    columns = zip(*(vars(part).values() for part in whole), strict=True)
    return Patches(*(np.concatenate(column) for column in columns))
