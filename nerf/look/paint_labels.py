"""Label drawings by paint, and repaint them; shadows and ramps count to their paint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.palette.extract import in_light
from toonset.palette.palette import Shadow
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.labels import label_pixels, nearest_labels
from toonset.palette.pixels.ramp_labels import Ramp
from toonset.palette.pixels.ramp_recolor import recolor_shaded
from toonset.palette.pixels.recolor import recolor, tone_map, tones_of
from toonset.palette.shaded import shaded_labels

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "paints 3"]


def paint_labels(
    pictures: Sequence[Picture], paints: Colors, shadow: Shadow | None, ramps: Sequence[Ramp] = ()
) -> list[Map]:
    """Return every opaque pixel's paint: nearest to its colour in light, or whose ramp it is on.

    Args:
        pictures: drawings of one sheet.
        paints: at most 255.
        shadow: that lies on the drawings; None: there is none.
        ramps: of the paints, where the drawings are shaded throughout.
    """
    if ramps:
        return shaded_labels(pictures, ramps)
    lit = pictures if shadow is None else _in_light(pictures, shadow)[0]
    return [nearest_labels(picture, paints) for picture in lit]


def repainted(
    pictures: Sequence[Picture],
    old: Colors,
    new: Colors,
    shadow: Shadow | None,
    ramps: Sequence[Ramp] = (),
) -> list[Picture]:
    """Return drawings in other paints: see `toonset.palette.pixels.recolor`, `ramp_recolor`.

    Args:
        pictures: drawings of one sheet.
        old: the paints that they show.
        new: as many others.
        shadow: that lies on the drawings; None: there is none.
        ramps: of the old paints, where the drawings are shaded throughout.
    """
    if np.array_equal(old, new):
        return list(pictures)
    if ramps:
        parts = zip(pictures, shaded_labels(pictures, ramps), strict=True)
        return [recolor_shaded(picture, labels, old, new) for picture, labels in parts]
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
