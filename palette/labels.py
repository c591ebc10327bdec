"""Label maps: which palette colour every pixel has."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from toonset.palette.mixed import mixed_pixels, opaque_pixels

UNLABELLED = 255


def label_image(
    rgba: UInt8[np.ndarray, "height width 4"], palette: UInt8[np.ndarray, "colors 3"]
) -> UInt8[np.ndarray, "height width"]:
    """Return every pixel's palette index: the nearest colour, L2 in 8-bit RGB.

    255 where the pixel is not wholly the character's, or is the blend of two neighbours.
    """
    labels = np.full(rgba.shape[:2], UNLABELLED, dtype=np.uint8)
    flat = opaque_pixels(rgba) & ~mixed_pixels(rgba)
    labels[flat] = nearest_colors(rgba[flat][:, :3], palette)
    return labels


def nearest_colors(
    colors: UInt8[np.ndarray, "n 3"], palette: UInt8[np.ndarray, "colors 3"]
) -> UInt8[np.ndarray, " n"]:
    """Return the index of the nearest palette colour, L2 in 8-bit RGB; ties go to the first."""
    best = np.zeros(len(colors), dtype=np.uint8)
    least = np.full(len(colors), np.iinfo(np.int32).max, dtype=np.int32)
    wide = colors.astype(np.int32)
    for number, color in enumerate(palette.astype(np.int32)):
        distance = ((wide - color) ** 2).sum(axis=1, dtype=np.int32)
        closer = distance < least
        best[closer] = number
        least[closer] = distance[closer]
    return best
