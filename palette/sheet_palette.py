"""The palette of drawings in light: their paints, features, and the printed colours that occur."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.palette.paints.extract import find_palette, pick_palette
from toonset.palette.paints.features import find_features
from toonset.palette.paints.places import add_places
from toonset.palette.paints.select import PaletteRule
from toonset.palette.palette import Palette, Shadow
from toonset.palette.pixels.labels import UNLABELLED, nearest_labels
from toonset.palette.printed import Printed, in_printed_order, occurring, with_printed

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

NEVER_IN_LIGHT = 0.95  # of a paint's pixels lie in shadow


def sheet_palette(
    pictures: Sequence[Picture],
    options: PaletteRule,
    lines: Sequence[Mask],
    shadow: Shadow | None,
    printed: Printed,
) -> Palette:
    """Return the palette of pictures in light, with the printed colours that occur in them."""
    occurs = occurring(pictures, printed.colors) if printed.use is None else {}
    if not occurs:
        return _in_light(pictures, options, lines, shadow)
    found = with_printed(
        occurs,
        options,
        lambda wider: _in_light(pictures, wider, lines, shadow),
        lambda rgb: pick_palette(pictures, rgb, lines),
    )
    return in_printed_order(found, printed.colors)


def never_in_light(
    lit: Sequence[Picture], dark: Sequence[Mask], palette: Palette
) -> list[Mask] | None:
    """Return where paints lie that have no pixel in light; None without such a paint.

    Their colours in light are no pixel's: what looks like their shadow is another paint's, or they
    are drawn as they are.
    """
    labels = [nearest_labels(picture, palette.rgb) for picture in lit]
    total, shade = (
        sum(np.bincount(one[part], minlength=256) for one, part in zip(labels, parts, strict=True))
        for parts in ([np.ones_like(one) for one in dark], dark)
    )
    gone = np.asarray(shade) > NEVER_IN_LIGHT * np.maximum(total, 1)
    gone[UNLABELLED] = False
    if not gone.any():
        return None
    return [gone[one] for one in labels]


def _in_light(
    pictures: Sequence[Picture],
    options: PaletteRule,
    lines: Sequence[Mask],
    shadow: Shadow | None = None,
) -> Palette:
    """Return the palette of pictures in light, with features."""
    palette = find_palette(pictures, options, lines)
    found = find_features(palette, pictures, shadow) if options.features is not False else ()
    found = tuple(rgb for rgb in found if rgb not in options.shades)
    found = found[: options.max_colors - len(palette.colors)]
    if found:
        wider = replace(options, keep=(*options.keep, *found))
        wide = find_palette(pictures, wider, lines)
        palette = replace(wide, features=found, rule=palette.rule)
    return add_places(palette, pictures)
