"""Pictures in other colours: a paint's tones and its soft edges move with it, drawn lines stay.

    c' = c + k s (m' - m)

c is a pixel, m what covers it, m' the same in the new colours. A tone is a paint in light or in
shadow: the shadow of a new colour is the sheet's own. Inside a tone m is its colour. Beside another
tone, a line or a pixel without any, m is the mixture of two tones around, a and b, that comes
nearest to c:

    min over t in [0, 1] of |c - (1 - t) a - t b|

s m is what shade of m comes nearest to c, so that deeper shadows stay deeper. What is no shade of m
is none of the palette's paints, an eye perhaps, and stays: k is 1 below `SHADE` (OKLab, from s m),
0 from twice that on. Grain, soft edges and soft borders of shadows stay what they are.
"""

from __future__ import annotations

import itertools

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int16, UInt8

from toonset.palette.colors import oklab_from_rgb
from toonset.palette.palette import Shadow
from toonset.palette.pixels.labels import UNLABELLED
from toonset.palette.pixels.shadow import DRAWN, FLOOR, shaded

NONE = -1  # of a pixel without a tone
WINDOW = 7  # pixels: a soft edge is three wide, with a tone on either side
SEEN = 0.5  # of a pixel
MOST = 4  # tones around, the commonest, that a pixel may be mixed of
LINE = 32  # of 255: a line that covers so much of a pixel may be in its neighbours, too
FEW = 20  # pixels from which a tone's colour cannot be told
SHADE = 0.06  # in OKLab
BRIGHTEST = 1.25  # times a paint's colour: a highlight
BATCH = 1 << 16  # pixels mixed at once

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Tones = Int16[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "n 3"]


def tones_of(colors: UInt8[np.ndarray, "colors 3"], shadow: Shadow | None) -> Colors:
    """Return colours in light, then in shadow; within 8 bits."""
    dark = colors if shadow is None else shaded(colors, shadow.factor)
    return np.concatenate([colors, dark])


def tone_map(
    labels: Map, dark: Bool[np.ndarray, "height width"] | None, contour: Map, colors: int
) -> Tones:
    """Return which of `tones_of` every pixel has; their number: a drawn line; `NONE`.

    Args:
        labels: index of a colour, `UNLABELLED` for blends and the background.
        dark: where paint lies in shadow; None: nowhere.
        contour: how far lines cover every pixel.
        colors: of the palette.
    """
    own: Tones = labels.astype(np.int16)
    if dark is not None:
        own[dark] += colors
    own[labels == UNLABELLED] = NONE
    own[contour >= DRAWN] = 2 * colors
    return own


def recolored(picture: Picture, tones: Tones, contour: Map, old: Colors, new: Colors) -> Picture:
    """Return a picture with its tones' colours changed; the same picture if none changes.

    Args:
        picture: sRGB with straight alpha.
        tones: of every pixel: see `tone_map`.
        contour: how far lines cover every pixel.
        old: colours of the tones.
        new: what they become; what leaves 8 bits by grain is clipped.
    """
    change = np.concatenate([new.astype(np.float32) - old, np.zeros((1, 3), np.float32)])
    moved = np.append(change.any(axis=1), False)  # NONE, the last, does not
    if not moved.any():
        return picture
    near = _grown(moved[tones], WINDOW) & (picture[..., 3] > 0)
    drawn = _as_drawn(picture, tones, old)
    pure = near & (tones != NONE) & _alone(tones) & (contour < LINE)
    result = picture.copy()
    result[pure, :3] = _shifted(picture[pure, :3], drawn[tones[pure]], change[tones[pure]])
    mixed = near & ~pure
    if mixed.any():
        shares = _shares(picture, tones, contour, drawn, mixed)
        result[mixed, :3] = _shifted(picture[mixed, :3], shares @ drawn, shares @ change)
    return result


def _shifted(
    color: Colors, cover: Float[np.ndarray, "n 3"], change: Float[np.ndarray, "n 3"]
) -> Colors:
    """Return colours after what covers them has changed: see the module's equation."""
    floor = 255 * FLOOR  # black has no shades
    own, whole = color + floor, cover + floor
    shade = (own * whole).sum(axis=1) / np.square(whole).sum(axis=1)
    shade = shade.clip(0, BRIGHTEST)[:, None]
    like = np.rint((shade * whole - floor).clip(0, 255)).astype(np.uint8)
    off = np.linalg.norm(oklab_from_rgb(color) - oklab_from_rgb(like), axis=1)
    kept = (2 - off / SHADE).clip(0, 1)[:, None]
    return np.rint(color + kept * shade * change).clip(0, 255).astype(np.uint8)


def _grown(mask: Bool[np.ndarray, "height width"], side: int) -> Bool[np.ndarray, "height width"]:
    return cv2.dilate(mask.view(np.uint8), np.ones((side, side), np.uint8)) > 0


def _alone(tones: Tones) -> Bool[np.ndarray, "height width"]:
    """Return where a pixel and its eight neighbours have one tone."""
    square = np.ones((3, 3), dtype=np.uint8)
    return np.asarray(cv2.erode(tones, square) == cv2.dilate(tones, square))


def _shares(
    picture: Picture,
    tones: Tones,
    contour: Map,
    drawn: Float[np.ndarray, "tones 3"],
    at: Bool[np.ndarray, "height width"],
) -> Float[np.ndarray, "n tones"]:
    """Return how far every tone, lines the last, covers the chosen pixels."""
    counts = _counts(tones, contour, len(drawn), at)
    color = picture[at][:, :3].astype(np.float32)
    parts = [slice(start, start + BATCH) for start in range(0, len(color), BATCH)]
    return np.concatenate([_mixture(color[part], counts[:, part], drawn) for part in parts])


def _counts(
    tones: Tones, contour: Map, kinds: int, at: Bool[np.ndarray, "height width"]
) -> Float[np.ndarray, "tones n"]:
    """Return how often every tone is around some pixels; those far from any have the nearest."""
    from scipy.ndimage import distance_transform_edt

    counts = np.zeros((kinds, int(at.sum())), dtype=np.float32)
    for kind in np.union1d(tones[tones != NONE], kinds - 1):
        is_line = kind == kinds - 1
        where = (contour >= LINE) if is_line else (tones == kind)
        size = (3, 3) if is_line else (WINDOW, WINDOW)
        counts[kind] = cv2.boxFilter(where.astype(np.float32), -1, size, normalize=False)[at]
    lost = np.flatnonzero(~(counts > SEEN).any(axis=0))
    if len(lost):
        to = distance_transform_edt(tones == NONE, return_distances=False, return_indices=True)
        assert isinstance(to, np.ndarray)
        counts[tones[tuple(to[:, at][:, lost])], lost] = 1
    return counts


def _mixture(
    color: Float[np.ndarray, "n 3"],
    counts: Float[np.ndarray, "tones n"],
    drawn: Float[np.ndarray, "tones 3"],
) -> Float[np.ndarray, "n tones"]:
    """Return the shares of the two tones, of the commonest around, that mix best to a colour."""
    order = np.argsort(-counts, axis=0, kind="stable")[:MOST]
    seen = np.take_along_axis(counts, order, axis=0) > SEEN
    first, second, part = order[0].copy(), order[0].copy(), np.zeros(len(color), np.float32)
    least = np.square(color - drawn[order[0]]).sum(axis=1)
    for i, j in itertools.combinations(range(len(order)), 2):
        a, b = drawn[order[i]], drawn[order[j]]
        way = b - a
        t = ((color - a) * way).sum(axis=1) / np.maximum(np.square(way).sum(axis=1), 1)
        t = t.clip(0, 1)
        off = np.square(color - a - t[:, None] * way).sum(axis=1)
        nearer = seen[j] & (off < least)
        first[nearer], second[nearer] = order[i][nearer], order[j][nearer]
        part[nearer], least[nearer] = t[nearer], off[nearer]
    shares = np.zeros((len(color), len(drawn)), dtype=np.float32)
    every = np.arange(len(color))
    shares[every, first] += 1 - part
    shares[every, second] += part
    return shares


def _as_drawn(picture: Picture, tones: Tones, old: Colors) -> Float[np.ndarray, "tones 3"]:
    """Return the colours of tones, and of lines, in the picture: medians; the palette's of rare."""
    alone = _alone(tones)
    colors = np.concatenate([old.astype(np.float32), np.zeros((1, 3), np.float32)])
    for kind in np.unique(tones[tones != NONE]):
        where = tones == kind
        where &= alone | (kind == len(old))
        if where.sum() >= FEW:
            colors[kind] = np.median(picture[where][:, :3], axis=0)
    return colors
