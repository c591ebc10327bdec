"""Label every pixel with its palette colour, or none.

Colours repeat, so each is looked up once: a table over all 2^24 colours holds the nearest palette
colour of those that occur. What lies inside an area of one label is done; only the pixels along
borders are looked at more closely (`toonset.palette.pixels.antialias`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from jaxtyping import UInt8

from toonset.palette.colors import oklab_from_rgb
from toonset.palette.pixels.antialias import OPAQUE, settle_borders
from toonset.palette.pixels.enlarged import find_grid

Space = Literal["rgb", "oklab"]

UNLABELLED = 255  # background, soft edges, blends
BAND_PX = 1 << 21  # pixels worked on at once: bounds the memory
BATCH = 1 << 18  # colours compared with the palette at once


def label_pixels(
    rgba: UInt8[np.ndarray, "height width 4"],
    palette: UInt8[np.ndarray, "colors 3"],
    *,
    space: Space = "rgb",
) -> UInt8[np.ndarray, "height width"]:
    """Return every pixel's palette index.

    The nearest colour: L2 in 8-bit RGB as in the paper, or in OKLab. 255 where the pixel is not
    wholly the character's, or is the blend of two neighbours. Along borders of a noisy picture a
    colour that begins there goes before a stray nearer one.

    Time and memory grow with the pixels; beyond the picture about 5 bytes per pixel are used.

    Args:
        rgba: sRGB with straight alpha.
        palette: 1 to 255 colours.
        space: in which nearest is meant.
    """
    grid = find_grid(rgba)
    if grid is not None:
        small = np.ascontiguousarray(grid.reduced(rgba))
        settled = settle_borders(nearest_labels(small, palette, space=space), small, palette)
        return grid.enlarged(settled)
    return settle_borders(nearest_labels(rgba, palette, space=space), rgba, palette)


def nearest_labels(
    rgba: UInt8[np.ndarray, "height width 4"],
    palette: UInt8[np.ndarray, "colors 3"],
    *,
    space: Space = "rgb",
) -> UInt8[np.ndarray, "height width"]:
    """Return every opaque pixel's nearest palette colour, blends too; 255 where not opaque."""
    labels = np.empty(rgba.shape[:2], dtype=np.uint8)
    seen = np.zeros(1 << 24, dtype=bool)
    for _, codes, opaque in _bands(rgba):
        seen[codes[opaque]] = True
    nearest_of = np.full(1 << 24, UNLABELLED, dtype=np.uint8)
    occurring = np.flatnonzero(seen)
    for start in range(0, len(occurring), BATCH):
        batch = occurring[start : start + BATCH]
        colors = np.stack([batch & 255, batch >> 8 & 255, batch >> 16], axis=1).astype(np.uint8)
        nearest_of[batch] = nearest_colors(colors, palette, space=space)
    for rows, codes, opaque in _bands(rgba):
        labels[rows] = np.where(opaque, nearest_of[codes], UNLABELLED)
    return labels


def nearest_colors(
    colors: UInt8[np.ndarray, "n 3"],
    palette: UInt8[np.ndarray, "colors 3"],
    *,
    space: Space = "rgb",
) -> UInt8[np.ndarray, " n"]:
    """Return the index of the nearest palette colour; ties go to the first.

    Args:
        colors: 8-bit sRGB.
        palette: 1 to 255 colours.
        space: "rgb": L2 in 8-bit RGB, exact; "oklab": L2 in OKLab.
    """
    if space == "oklab":
        places, targets = oklab_from_rgb(colors), oklab_from_rgb(palette)
    else:
        places, targets = colors.astype(np.int32), palette.astype(np.int32)
    best = np.zeros(len(colors), dtype=np.uint8)
    least = np.full(len(colors), np.inf if space == "oklab" else np.iinfo(np.int32).max)
    for number, target in enumerate(targets):
        distance = ((places - target) ** 2).sum(axis=1)
        closer = distance < least
        best[closer] = number
        least[closer] = distance[closer]
    return best


def _bands(rgba: np.ndarray) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Yield rows, colour codes (red lowest) and opacity, a band at a time."""
    height, width = rgba.shape[:2]
    step = max(1, BAND_PX // max(width, 1))
    for top in range(0, height, step):
        rows = slice(top, min(top + step, height))
        words = np.ascontiguousarray(rgba[rows]).view("<u4")[..., 0]
        yield rows, words & 0xFFFFFF, words >> 24 >= OPAQUE
