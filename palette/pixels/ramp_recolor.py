"""Recolour shaded drawings: a paint's hue turns, its light and shade stay.

A pixel of lightness L becomes

    L' = L (new L / own L),    (a', b') = (new a, new b) L' / new L

in OKLab, "own" and "new" being the paint's colour before and after: order and ratios of lightness
stay, no trace of the old hue does. Along a paint's border a pixel is a mixture t p + (1 - t) q of
the colours p of that paint and q of what is beside it, both as they are a little farther from the
border; it moves with t p alone.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.palette.colors import oklab_from_rgb, rgb_from_oklab
from toonset.palette.pixels.labels import UNLABELLED
from toonset.raster import dilate, erode, nearest

SOFT_PX = 2  # from a border to where a colour is pure
BESIDE_PX = 2.0  # deviation of the window in which pure colours beside a border are averaged
LEAST = 1e-3  # of a window: less of a colour is not seen there
DARKEST = 0.02  # lightness: below, hue says nothing

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "colors 3"]


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
    result = color.copy()
    for number in changed:
        own = (whole == number) & drawn
        pure, other = erode(own, SOFT_PX), erode(drawn & ~own, SOFT_PX)
        edge = dilate(own, SOFT_PX) & drawn & ~pure & dilate(drawn & ~own, SOFT_PX)
        inside = own & ~edge
        turned = _turned(picture[inside, :3], old[number], new[number])
        result[inside] += turned.astype(np.float32) - color[inside]
        if edge.any():
            result[edge] += _mixed(color, own, (pure, other), edge, (old[number], new[number]))
    changed_picture = picture.copy()
    changed_picture[..., :3] = np.rint(result).clip(0, 255).astype(np.uint8)
    return changed_picture


def _turned(
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
    turned = _turned(np.rint(base).clip(0, 255).astype(np.uint8), *change)
    return np.asarray(share[:, None] * (turned - base))


def _beside(
    color: Float[np.ndarray, "height width 3"], side: Mask, edge: Mask
) -> tuple[Float[np.ndarray, "n 3"], Bool[np.ndarray, " n"]]:
    """Return a side's mean colours around some pixels, and which of them see it."""
    weight = side.astype(np.float32)
    mass = cv2.GaussianBlur(weight, (0, 0), BESIDE_PX)[edge]
    total = cv2.GaussianBlur(color * weight[..., None], (0, 0), BESIDE_PX)[edge]
    return total / np.maximum(mass, LEAST)[:, None], mass >= LEAST
