"""Label drawings by paint, and repaint them; shadows count to their paint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.palette.extract import in_light
from toonset.palette.palette import Shadow
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.labels import label_pixels, nearest_labels
from toonset.palette.pixels.recolor import recolor, tone_map, tones_of

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "paints 3"]


def paint_labels(pictures: Sequence[Picture], paints: Colors, shadow: Shadow | None) -> list[Map]:
    """Return every opaque pixel's nearest paint, that of its colour in light.

    Args:
        pictures: drawings of one sheet.
        paints: at most 255.
        shadow: that lies on the drawings; None: there is none.
    """
    lit = pictures if shadow is None else _in_light(pictures, shadow)[0]
    return [nearest_labels(picture, paints) for picture in lit]


def repainted(
    pictures: Sequence[Picture], old: Colors, new: Colors, shadow: Shadow | None
) -> list[Picture]:
    """Return drawings in other paints: see `toonset.palette.pixels.recolor`.

    Args:
        pictures: drawings of one sheet.
        old: the paints that they show.
        new: as many others.
        shadow: that lies on the drawings; None: there is none.
    """
    if np.array_equal(old, new):
        return list(pictures)
    lit, dark, contours = _in_light(pictures, shadow)
    factor = None if shadow is None else shadow.factor
    tones = tones_of(old, factor), tones_of(new, factor)
    found = []
    for picture, light, shade, contour in zip(pictures, lit, dark, contours, strict=True):
        own = tone_map(label_pixels(light, old), shade, contour, len(old))
        found.append(recolor(picture, own, contour, *tones))
    return found


def _in_light(
    pictures: Sequence[Picture], shadow: Shadow | None
) -> tuple[Sequence[Picture], list[Bool[np.ndarray, "height width"]], list[Map]]:
    """Return the drawings without shadow, where it lay, and how far lines cover every pixel."""
    contours = find_contours(pictures)
    lit, dark = in_light(pictures, contours, shadow)
    return lit, dark or [np.zeros(one.shape, dtype=bool) for one in contours], contours
