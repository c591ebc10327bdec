"""Recolour pictures: tones and soft edges move with their paint, drawn lines stay.

    c' = c + k s (m' - m)

c is a pixel, m what covers it, m' the same in the new colours. A tone is a paint in light or in
shadow: the shadow of a new colour is the sheet's own. Inside a tone m is its colour. Beside another
tone, a line or a pixel without any, m is a mixture of two (`toonset.palette.pixels.mixtures`). s m
is what shade of m comes nearest to c, so that deeper shadows stay deeper. What is no shade of m is
none of the palette's paints, an eye perhaps, and stays: k is 1 below `SHADE` (OKLab, from s m), 0
from twice that on. Grain, soft edges and soft borders of shadows stay what they are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int16, UInt8

from toonset.palette.colors import oklab_from_rgb
from toonset.palette.pixels.labels import UNLABELLED
from toonset.palette.pixels.mixtures import LINE, NONE, colors_as_drawn, find_mixtures
from toonset.palette.pixels.shadow import DRAWN, FLOOR, apply_shadow
from toonset.raster import dilate, is_uniform

WINDOW = 7  # pixels: a soft edge is three wide, with a tone on either side
SHADE = 0.06  # in OKLab
BRIGHTEST = 1.25  # times a paint's colour: a highlight

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Tones = Int16[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "n 3"]


def tones_of(
    colors: UInt8[np.ndarray, "colors 3"],
    factors: Sequence[float] | Float[np.ndarray, "colors 3"] | None,
) -> Colors:
    """Return colours in light, then in shadow; within 8 bits.

    Args:
        colors: in light.
        factors: of colours in shadow, one for all or one each; None: there is no shadow.
    """
    dark = colors if factors is None else apply_shadow(colors, factors)
    return np.concatenate([colors, dark])


def tone_map(
    labels: Map,
    tones: Map | Bool[np.ndarray, "height width"] | None,
    contour: Map,
    colors: int,
    steps: int = 2,
) -> Tones:
    """Return which of `tones_of` every pixel has; their number: a drawn line; `NONE`.

    Args:
        labels: index of a colour, `UNLABELLED` for blends and the background.
        tones: how dark paint lies, from 0 on; None: in light everywhere.
        contour: how far lines cover every pixel.
        colors: of the palette.
        steps: tones of a colour.
    """
    own: Tones = labels.astype(np.int16)
    if tones is not None:
        own += np.int16(colors) * np.where(tones == UNLABELLED, 0, tones).clip(0, steps - 1)
    own[labels == UNLABELLED] = NONE
    own[contour >= DRAWN] = steps * colors
    return own


def recolor(picture: Picture, tones: Tones, contour: Map, old: Colors, new: Colors) -> Picture:
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
    near = dilate(moved[tones], WINDOW // 2) & (picture[..., 3] > 0)
    inside = is_uniform(tones)
    drawn = colors_as_drawn(picture, tones, inside, old)
    pure = near & (tones != NONE) & inside & (contour < LINE)
    result = picture.copy()
    result[pure, :3] = _shifted(picture[pure, :3], drawn[tones[pure]], change[tones[pure]])
    mixed = near & ~pure
    if mixed.any():
        cover = find_mixtures(picture, tones, inside, contour, drawn, mixed)
        result[mixed, :3] = _shifted(picture[mixed, :3], cover.of(drawn), cover.of(change))
    return result


def _shifted(
    color: Colors, cover: Float[np.ndarray, "n 3"], change: Float[np.ndarray, "n 3"]
) -> Colors:
    """Return colours after what covers them has changed: see the module's equation."""
    moved = color + share_moved(color, cover)[:, None] * change
    return np.rint(moved).clip(0, 255).astype(np.uint8)


def share_moved(color: Colors, cover: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Return how far colours move with what covers them: k s of the module's equation."""
    floor = 255 * FLOOR  # black has no shades
    own, whole = color + floor, cover + floor
    shade = (own * whole).sum(axis=1) / np.square(whole).sum(axis=1)
    shade = shade.clip(0, BRIGHTEST)
    like = np.rint((shade[:, None] * whole - floor).clip(0, 255)).astype(np.uint8)
    off = np.linalg.norm(oklab_from_rgb(color) - oklab_from_rgb(like), axis=1)
    return np.asarray((2 - off / SHADE).clip(0, 1) * shade)
