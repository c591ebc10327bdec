"""Compute how far paints cover every pixel: label maps with sub-pixel borders.

Two ranks per pixel, as Cryptomatte keeps them (Friedman and Jones 2015): the paint that covers most
of it, the next one, and how far the first covers it. Drawn lines cover what both leave.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from toonset.palette.extract import PaintMap
from toonset.palette.palette import Palette
from toonset.palette.pixels.cel_tones import tone_colors
from toonset.palette.pixels.labels import UNLABELLED
from toonset.palette.pixels.mixtures import LINE, NONE, colors_as_drawn, find_mixtures
from toonset.palette.pixels.recolor import tone_map
from toonset.raster import is_uniform

Map = UInt8[np.ndarray, "height width"]


def coverage_map(
    picture: UInt8[np.ndarray, "height width 4"], paint: PaintMap, contour: Map, palette: Palette
) -> UInt8[np.ndarray, "height width 3"]:
    """Return the coverage map of a drawing, its alpha left aside.

    Red is the palette index of the paint that covers most of it and green that of another one
    there, 255 = none; blue is how far the first covers it, 255 = wholly. The second, or where there
    is none a drawn line whose colour is not a paint, covers the rest.

    Args:
        picture: sRGB with straight alpha.
        paint: what its pixels are painted with.
        contour: how far lines cover every pixel.
        palette: of the sheet.
    """
    count = len(palette.colors)
    colors = tone_colors(palette, palette.rgb)
    tones = tone_map(paint.labels, paint.tones, contour, count, len(colors) // count)
    inside = is_uniform(tones)
    drawn = colors_as_drawn(picture, tones, inside, colors)
    pure = (tones != NONE) & inside & (contour < LINE)
    mixed = (picture[..., 3] > 0) & ~pure
    found = find_mixtures(picture, tones, inside, contour, drawn, mixed)
    paints = np.append(np.arange(len(colors)) % count, _paint_of_lines(palette)).astype(np.uint8)
    first, second = paints[found.first], paints[found.second]
    share = np.where(first == second, 1, 1 - found.part)
    swapped = (second != UNLABELLED) & ((first == UNLABELLED) | (share < 0.5))
    first, second = np.where(swapped, second, first), np.where(swapped, first, second)
    share = np.where(first == UNLABELLED, 0, np.where(swapped, 1 - share, share))
    level = np.rint(255 * share).astype(np.uint8)
    second = np.where((second == first) | (level == 255), UNLABELLED, second)
    result = np.full((*tones.shape, 3), UNLABELLED, np.uint8)
    result[..., 2] = 0
    np.copyto(result[..., 0], paint.labels, where=pure)
    np.copyto(result[..., 2], 255, where=pure)
    result[mixed] = np.stack([first, second, level], axis=1)
    return result


def _paint_of_lines(palette: Palette) -> int:
    """Return which paint has the drawn lines' colour, `UNLABELLED` where none has."""
    colors = [color.rgb for color in palette.colors]
    ink = palette.contour
    return colors.index(ink.rgb) if ink is not None and ink.rgb in colors else UNLABELLED
