"""Read a palette's colours off grainy drawings, as medians.

Which paints there are shows once grain is smoothed off; but smoothing mixes into a paint what lies
beside it, so that colours darken near lines. Within a paint grain is as often lighter as darker:
the median of its pixels as drawn is the paint itself. Ink is read from the middles of strokes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.palette.color_names import name_of
from toonset.palette.paints.histogram import count_pixels
from toonset.palette.paints.line_color import find_ink, rounded
from toonset.palette.palette import ContourColor, Palette, PaletteColor
from toonset.palette.pixels.labels import UNLABELLED, nearest_labels
from toonset.raster import is_uniform

LEAST_PX = 50  # of a paint's inside: fewer do not tell its colour

Pictures = Sequence[UInt8[np.ndarray, "_ _ 4"]]
RGB = tuple[int, int, int]
Named = TypeVar("Named", PaletteColor, ContourColor)


def read_drawn_colors(
    palette: Palette, drawings: Pictures, smooth: Pictures, apart: Sequence[Bool[np.ndarray, "_ _"]]
) -> Palette:
    """Return a palette of smoothed drawings with the colours of the drawings themselves.

    Args:
        palette: of the smoothed ones.
        drawings: with their grain.
        smooth: the same without, in light.
        apart: what shows no paint in light: lines, shadow.
    """
    labels = [nearest_labels(picture, palette.rgb) for picture in smooth]
    inner = [
        is_uniform(own) & (own != UNLABELLED) & ~off for own, off in zip(labels, apart, strict=True)
    ]
    label = np.concatenate([own[where] for own, where in zip(labels, inner, strict=True)])
    seen = np.concatenate([one[where, :3] for one, where in zip(drawings, inner, strict=True)])
    new: dict[RGB, RGB] = {}
    for number, color in enumerate(palette.colors):
        own = seen[label == number]
        if len(own) >= LEAST_PX:
            new[color.rgb] = rounded(np.median(own, axis=0))
    ink = None if palette.contour is None else find_ink(count_pixels(drawings))
    if palette.contour is not None and ink is not None:
        new[palette.contour.rgb] = ink.rgb

    def renamed(color: Named) -> Named:
        rgb = new.get(color.rgb, color.rgb)
        return replace(color, rgb=rgb, name=name_of(rgb))

    return replace(
        palette,
        colors=tuple(map(renamed, palette.colors)),
        contour=palette.contour and renamed(palette.contour),
        features=tuple(new.get(rgb, rgb) for rgb in palette.features),
    )
