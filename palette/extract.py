"""The paper's palette: the colours that make up at least 5 % of the character's pixels.

Which colours there are is read from flat paint (`toonset.palette.pixels`, `shades`); how much of
each, from all of the figure's (`areas`). Where the drawn lines are given, they count to their ink,
and the rule weighs the other colours without them, so that an outline does not push a colour under
5 %. The ink itself is in the palette like any colour that makes up 5 %.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.errors import PaletteError
from toonset.palette.areas import paint_areas
from toonset.palette.choice import Amount, PaletteOptions, choose, measure
from toonset.palette.labels import nearest_colors
from toonset.palette.names import hex_of, name_of
from toonset.palette.oklab import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.palette import ContourColor, DroppedColor, Palette, PaletteColor
from toonset.palette.pixels import Histogram, count_pixels
from toonset.palette.shades import find_paints

LEAST_LISTED = 0.002  # of the pixels: what is rarer is not worth a line among the dropped

Images = Sequence[UInt8[np.ndarray, "_ _ 4"]]
Masks = Sequence[Bool[np.ndarray, "_ _"]]


def extract_palette(
    images: Images, options: PaletteOptions | None = None, contours: Masks | None = None
) -> Palette:
    """Return the colours of a character, the most frequent first.

    The result does not depend on the order or orientation of the pictures. If no colour reaches the
    least share, the largest one is kept and a warning says so.

    Args:
        images: the character on transparent ground; one palette for all.
        options: of the choice.
        contours: the drawn lines of every picture, if known.

    Raises:
        PaletteError: no picture, no opaque pixel in them, or nothing found near a colour to keep.
    """
    options = options or PaletteOptions()
    histogram = _histogram(images)
    paints, evidence = find_paints(histogram)
    areas = paint_areas(histogram, paints, contours)
    amounts, ink = measure(paints, areas, options)
    kept, left, warnings = choose(amounts, options)
    colors = tuple(PaletteColor(a.paint.rgb, a.share, name_of(a.paint.rgb)) for a in kept)
    contour = None if ink is None else _contour(amounts[ink])
    dropped = _dropped(left, histogram, colors)
    return Palette(colors, _rule(options, ink is not None), dropped, warnings, contour, evidence)


def pick_palette(images: Images, rgb: UInt8[np.ndarray, "colors 3"]) -> Palette:
    """Return hand-picked colours with their shares in the pictures, in the order given.

    Raises:
        PaletteError: no picture, or no opaque pixel in them.
    """
    histogram = _histogram(images)
    label = nearest_colors(histogram.colors, rgb)
    shares = np.bincount(label, histogram.counts, len(rgb)) / histogram.counts.sum()
    triples = [(int(red), int(green), int(blue)) for red, green, blue in rgb]
    unused = [hex_of(triple) for triple, share in zip(triples, shares, strict=True) if not share]
    warnings = (f"no pixel is nearest to {', '.join(unused)}",) if unused else ()
    colors = tuple(
        PaletteColor(triple, float(share), name_of(triple))
        for triple, share in zip(triples, shares, strict=True)
    )
    return Palette(colors, "picked by hand", (), warnings)


def _histogram(images: Images) -> Histogram:
    if not images:
        raise PaletteError("palette: no picture given; name a bundle or pictures")
    histogram = count_pixels(images)
    if not len(histogram.counts):
        raise PaletteError(
            "palette: the pictures have no opaque pixel; cut the character out with "
            "`toonset calibrate`, or save it with an opaque figure"
        )
    return histogram


def _rule(options: PaletteOptions, lines: bool) -> str:
    words = [f"at least {options.min_share:g} of the figure's pixels"]
    if lines:
        words = [f"at least {options.min_share:g} of the figure's pixels that are no drawn lines"]
        words.append(
            "the lines' colour by all pixels" if options.contour else "the lines' colour alike"
        )
    words.append(f"shades within {JUST_NOTICEABLE:g} in OKLab are one colour")
    if options.keep:
        words.append(f"kept by hand: {', '.join(map(hex_of, options.keep))}")
    return "; ".join(words)


def _contour(ink: Amount) -> ContourColor:
    rgb = ink.paint.rgb
    return ContourColor(rgb, ink.share - ink.cloth, ink.cloth, name_of(rgb))


def _dropped(
    left: list[Amount], histogram: Histogram, colors: tuple[PaletteColor, ...]
) -> tuple[DroppedColor, ...]:
    palette = np.array([color.rgb for color in colors], dtype=np.uint8)
    result = []
    for amount in left:
        if amount.share < LEAST_LISTED:
            break
        paint = amount.paint
        own = histogram.colors[paint.members]
        given = palette[nearest_colors(own, palette)]
        away = np.linalg.norm(oklab_from_rgb(own) - oklab_from_rgb(given), axis=1)
        cost = float(np.average(away, weights=histogram.counts[paint.members]))
        result.append(DroppedColor(paint.rgb, amount.share, name_of(paint.rgb), cost))
    return tuple(result)
