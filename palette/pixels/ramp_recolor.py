"""Recolour shaded drawings: a paint's hue turns, its light and shade stay.

A pixel of lightness L becomes

    L' = L (new L / own L),    (a', b') = (new a, new b) L' / new L

in OKLab, "own" and "new" being the paint's colour before and after: order and ratios of lightness
stay, no trace of the old hue does. Along a paint's border a pixel is a mixture t p + (1 - t) q of
the colours p of that paint and q of what is beside it, both as they are a little farther from the
border; it moves with t p alone. `find_shaded_mixtures` says t for every pixel at once; the page of
`toonset view` recolours by it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.palette.colors import oklab_from_rgb, rgb_from_oklab
from toonset.palette.pixels.labels import UNLABELLED
from toonset.raster import dilate, erode, nearest

SOFT_PX = 2  # from a border to where a colour is pure
BESIDE_PX = 2.0  # deviation of the window in which pure colours beside a border are averaged
AROUND = 3  # paints around a strip of one pixel, the nearest, that it may be a blend of
BLEND = 40.0  # levels of 255: what is nearer to a mixture is one, in whatever shade
LEAST = 1e-3  # of a window: less of a colour is not seen there
DARKEST = 0.02  # lightness: below, hue says nothing

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "colors 3"]


@dataclass(frozen=True, eq=False)
class ShadedMixtures:
    """Two paints of every pixel.

    Attributes:
        first: the one that covers more.
        second: the other one; the first where there is none.
        share: of the second, at most 1/2.
    """

    first: Map
    second: Map
    share: Float[np.ndarray, "height width"]


def find_shaded_mixtures(
    color: UInt8[np.ndarray, "height width 3"], labels: Map, drawn: Mask
) -> ShadedMixtures:
    """Return which two paints every pixel is a mixture of, by its colour and those beside it.

    Args:
        color: sRGB.
        labels: of every drawn pixel.
        drawn: where anything is.
    """
    whole = color.astype(np.float32)
    labels = _without_blends(whole, labels, drawn)
    first, second, share = labels.copy(), labels.copy(), np.zeros(drawn.shape, np.float32)
    kinds = np.unique(labels[drawn])
    owns = [drawn & (labels == kind) for kind in kinds]
    edge = drawn & (sum(dilate(own, SOFT_PX).view(np.uint8) for own in owns) > 1)
    if not edge.any():
        return ShadedMixtures(first, second, share)
    here, label = whole[edge], labels[edge]
    sides = [_beside(whole, erode(own, SOFT_PX), edge) for own in owns]
    number, each = np.searchsorted(kinds, label), np.arange(len(label))
    own, seen = (np.stack(part)[number, each] for part in zip(*sides, strict=True))
    beside, part = label.copy(), np.zeros(len(label), np.float32)
    least = np.full(len(label), np.inf, np.float32)
    for kind, (other, there) in zip(kinds, sides, strict=True):
        way = other - own
        most = ((here - own) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1.0)
        most = most.clip(0, 1)
        off = ((here - own - most[:, None] * way) ** 2).sum(axis=1)
        better = seen & there & (label != kind) & (off < least)
        beside[better], part[better], least[better] = kind, most[better], off[better]
    swapped = part > 0.5
    first[edge], second[edge] = np.where(swapped, (beside, label), (label, beside))
    share[edge] = np.minimum(part, 1 - part)
    second[share == 0] = first[share == 0]
    return ShadedMixtures(first, second, share)


def recolor_shaded(picture: Picture, labels: Map, old: Colors, new: Colors) -> Picture:
    """Return a shaded drawing with some paints in other colours.

    Args:
        picture: sRGB with straight alpha.
        labels: index of every opaque pixel's paint, 255 elsewhere; soft pixels of the rim go with
            the paint beside them.
        old: the paints' colours.
        new: what they become.
    """
    changed = [n for n in range(len(old)) if (old[n] != new[n]).any()]
    known = labels != UNLABELLED
    if not changed or not known.any():
        return picture
    drawn = picture[..., 3] > 0
    whole = np.where(known, labels, labels[nearest(known)])
    color = picture[..., :3].astype(np.float32)
    whole = _without_blends(color, whole, drawn)
    result = color.copy()
    for number in changed:
        own = (whole == number) & drawn
        pure, other = erode(own, SOFT_PX), erode(drawn & ~own, SOFT_PX)
        edge = dilate(own, SOFT_PX) & drawn & ~pure & dilate(drawn & ~own, SOFT_PX)
        inside = own & ~edge
        shown = turned(picture[inside, :3], old[number], new[number])
        result[inside] += shown.astype(np.float32) - color[inside]
        if edge.any():
            result[edge] += _mixed(color, own, (pure, other), edge, (old[number], new[number]))
    changed_picture = picture.copy()
    changed_picture[..., :3] = np.rint(result).clip(0, 255).astype(np.uint8)
    return changed_picture


def _without_blends(color: Float[np.ndarray, "height width 3"], labels: Map, drawn: Mask) -> Map:
    """Return labels without strips that are no paint: mixtures of the two on their sides.

    A border's blend may lie on a third paint's ramp. It is a strip of that paint, a pixel wide,
    with none of its pure colour near, and in colour between those beside it.
    """
    kinds = np.unique(labels[drawn])
    strip = drawn & ~_in_squares(np.where(drawn, labels.astype(np.int16), np.int16(-1)))
    if len(kinds) < 3 or not strip.any():
        return labels
    here, own = color[strip], np.searchsorted(kinds, labels[strip])
    alone = np.zeros(len(own), np.bool_)
    number, mass = np.zeros((AROUND, len(own)), np.int64), np.zeros((AROUND, len(own)), np.float32)
    mean = np.zeros((AROUND, len(own), 3), np.float32)
    for kind, label in enumerate(kinds):
        seen, weight = _around(color, erode(drawn & (labels == label), SOFT_PX), strip)
        alone |= (own == kind) & (weight < LEAST)
        least = mass.argmin(axis=0)
        (more,) = np.nonzero((weight >= LEAST) & (weight > mass.min(axis=0)))
        place = least[more], more
        number[place], mass[place], mean[place] = kind, weight[more], seen[more]
    best, nearest_off = own.copy(), np.full(len(own), BLEND**2, np.float32)
    for i, j in itertools.combinations(range(AROUND), 2):
        way = mean[j] - mean[i]
        share = ((here - mean[i]) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1.0)
        share = share.clip(0, 1)
        off = ((here - mean[i] - share[:, None] * way) ** 2).sum(axis=1)
        better = alone & (mass[i] > 0) & (mass[j] > 0) & (off < nearest_off)
        chosen = np.where(share > 0.5, number[j], number[i])
        best[better], nearest_off[better] = chosen[better], off[better]
    found = labels.copy()
    found[strip] = kinds[best]
    return found


def _in_squares(labels: Int[np.ndarray, "height width"]) -> Mask:
    """Return where a pixel is in a square of four pixels with one label."""
    same = (labels[:-1] == labels[1:])[:, :-1] & (labels[:-1] == labels[1:])[:, 1:]
    same &= (labels[:, :-1] == labels[:, 1:])[:-1]
    found = np.zeros(labels.shape, np.bool_)
    for rows, columns in itertools.product((slice(-1), slice(1, None)), repeat=2):
        found[rows, columns] |= same
    return found


def turned(
    rgb: UInt8[np.ndarray, "n 3"], old: UInt8[np.ndarray, " 3"], new: UInt8[np.ndarray, " 3"]
) -> UInt8[np.ndarray, "n 3"]:
    """Return colours of a paint in its new hue: see the module's equation."""
    lab, before, after = oklab_from_rgb(rgb), oklab_from_rgb(old), oklab_from_rgb(new)
    light = lab[:, :1] * (max(after[0], DARKEST) / max(before[0], DARKEST))
    ray = light * after[1:] / max(after[0], DARKEST)
    return rgb_from_oklab(np.concatenate([light, ray], axis=1))


def _mixed(
    color: Float[np.ndarray, "height width 3"],
    own: Mask,
    sides: tuple[Mask, Mask],
    edge: Mask,
    change: tuple[UInt8[np.ndarray, " 3"], UInt8[np.ndarray, " 3"]],
) -> Float[np.ndarray, "n 3"]:
    """Return how the pixels along a paint's border change.

    Args:
        color: of the drawing.
        own: the paint.
        sides: what is purely the paint's, and purely not.
        edge: the pixels asked for.
        change: the paint's colour before and after.
    """
    (inner, seen), (outer, beside) = (_beside(color, side, edge) for side in sides)
    here = color[edge]
    first = np.where(seen[:, None], inner, here)
    way = first - outer
    share = ((here - outer) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1.0)
    share = np.where(beside & seen, share.clip(0, 1), own[edge])
    base = np.where((beside & seen)[:, None], first, here)
    moved = turned(np.rint(base).clip(0, 255).astype(np.uint8), *change)
    return np.asarray(share[:, None] * (moved - base))


def _beside(
    color: Float[np.ndarray, "height width 3"], side: Mask, edge: Mask
) -> tuple[Float[np.ndarray, "n 3"], Bool[np.ndarray, " n"]]:
    """Return a side's mean colours around some pixels, and which of them see it."""
    mean, mass = _around(color, side, edge)
    return mean, mass >= LEAST


def _around(
    color: Float[np.ndarray, "height width 3"], side: Mask, edge: Mask
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, " n"]]:
    """Return a side's mean colours around some pixels, and its share of what is there."""
    weight = side.astype(np.float32)
    mass = cv2.GaussianBlur(weight, (0, 0), BESIDE_PX)[edge]
    total = cv2.GaussianBlur(color * weight[..., None], (0, 0), BESIDE_PX)[edge]
    return total / np.maximum(mass, LEAST)[:, None], mass
