"""Extract the paper's palette: colours that make up at least 5 % of the character's pixels.

Which colours there are is read from flat paint (`histogram`, `clusters`); how much of each, from
all of the figure's (`areas`). Where the drawn lines are given, they count to their ink, and the
rule weighs the other colours without them, so that an outline does not push a colour under 5 %. The
ink itself is in the palette like any colour that makes up 5 %.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, UInt8

from toonset.errors import PaletteError
from toonset.palette.color_names import name_of
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.names import hex_of
from toonset.palette.options import MAX_COLORS
from toonset.palette.paints.areas import paint_areas
from toonset.palette.paints.clusters import Paint, find_paints, nearest_place
from toonset.palette.paints.histogram import Histogram, count_pixels
from toonset.palette.paints.lost import add_lost_paints
from toonset.palette.paints.places import patches_of, pixels_of
from toonset.palette.paints.select import Amount, PaletteRule, choose, measure, with_wanted
from toonset.palette.paints.small_features import near_equal_paints, tiny_paints
from toonset.palette.paints.warnings import lone_spot_notes, wide_paint_notes
from toonset.palette.palette import ContourColor, DroppedColor, Palette, PaletteColor, Place
from toonset.palette.pixels.labels import nearest_colors

PICKED = "picked by hand; what is not among these colours counts for the nearest"
LEAST_LISTED = 0.002  # of the pixels: a rarer paint is not worth a line among the dropped

Images = Sequence[UInt8[np.ndarray, "_ _ 4"]]
Masks = Sequence[Bool[np.ndarray, "_ _"]]


def find_palette(
    images: Images, options: PaletteRule | None = None, contours: Masks | None = None
) -> Palette:
    """Return the colours of a character, the most frequent first.

    Left out, and listed, are paints under the rule, colours that look like another although much is
    painted with them (`near_equal_paints`), and those of tiny features (`tiny_paints`). To keep one
    of these takes it out of the paint that it counts for otherwise. Spots too small to show their
    colour (`lone_spot_notes`) are warned of.

    The result does not depend on the order or orientation of the pictures. If no colour reaches the
    least share, the largest one is kept and a warning says so.

    Args:
        images: the character on transparent ground; one palette for all.
        options: of the choice.
        contours: the drawn lines of every picture, if known.

    Raises:
        PaletteError: no picture, no opaque pixel in them, or nothing found near a colour to keep.
    """
    options = options or PaletteRule()
    histogram = _histogram(images)
    found = find_paints(histogram)
    near = near_equal_paints(histogram, found.paints, max(options.min_share, LEAST_LISTED))
    tiny = tiny_paints(histogram, found.paints, found.specks)
    whole = add_lost_paints(histogram, found.paints, images, contours)
    paints, hidden = with_wanted(whole, [*near, *tiny], options.keep)
    areas = paint_areas(histogram, paints, contours)
    amounts, ink = measure(paints, areas, options)
    kept, left, warnings = choose(amounts, options)
    colors = tuple(PaletteColor(a.paint.rgb, a.share, name_of(a.paint.rgb)) for a in kept)
    warnings += wide_paint_notes(histogram, [a.paint for a in kept], options.min_share)
    warnings += lone_spot_notes(histogram, [*whole, *tiny])
    contour = None if ink is None else _contour(amounts[ink])
    dropped = _dropped(left, hidden, histogram, colors)
    return Palette(
        colors, rule_in_words(options, contour), dropped, warnings, contour, found.evidence
    )


def pick_palette(
    images: Images, rgb: UInt8[np.ndarray, "colors 3"], contours: Masks | None = None
) -> Palette:
    """Return hand-picked colours with their shares in the pictures, in the order given.

    Areas are counted as for a palette that is found, but nothing is left out: what is not among
    these colours counts for the nearest in RGB.

    Args:
        images: the character on transparent ground.
        rgb: the colours.
        contours: the drawn lines of every picture, if known.

    Raises:
        PaletteError: no picture, or no opaque pixel in them.
    """
    histogram = _histogram(images)
    paints = _picked_paints(histogram, rgb)
    amounts, ink = measure(paints, paint_areas(histogram, paints, contours), PaletteRule())
    colors = tuple(PaletteColor(a.paint.rgb, a.share, name_of(a.paint.rgb)) for a in amounts)
    unused = [hex_of(color.rgb) for color in colors if not color.share]
    warnings = (f"no pixel is nearest to {', '.join(unused)}",) if unused else ()
    contour = None if ink is None else _contour(amounts[ink])
    return Palette(colors, PICKED, (), warnings, contour)


def _picked_paints(histogram: Histogram, rgb: UInt8[np.ndarray, "colors 3"]) -> list[Paint]:
    """Return the colours as paints of all pixels."""
    label = nearest_colors(histogram.colors, rgb)
    found = find_paints(histogram).paints
    for paint, own in zip(found, _only_picks(found, histogram, rgb), strict=True):
        if own is not None:
            label[paint.members] = own
    inks = [nearest_colors(np.array([p.rgb], np.uint8), rgb)[0] for p in found if p.is_ink]
    return [
        Paint((int(red), int(green), int(blue)), np.flatnonzero(label == number), number in inks)
        for number, (red, green, blue) in enumerate(rgb)
    ]


def _only_picks(
    found: Sequence[Paint], histogram: Histogram, rgb: UInt8[np.ndarray, "colors 3"]
) -> list[int | None]:
    """Return per paint the one picked colour that is meant by it, and so has all its shades.

    None where no colour is that of the paint, or where several part its shades among them.
    """
    paint_of = np.empty(len(histogram.colors), dtype=np.int64)
    for number, paint in enumerate(found):
        paint_of[paint.members] = number
    home = paint_of[nearest_place(histogram.colors, rgb)[0]]
    own = oklab_from_rgb(np.array([paint.rgb for paint in found], dtype=np.uint8))[home]
    meant = np.linalg.norm(oklab_from_rgb(rgb) - own, axis=1) <= JUST_NOTICEABLE
    picks = [np.flatnonzero(home == number) for number in range(len(found))]
    return [int(of[0]) if len(of) == 1 and meant[of[0]] else None for of in picks]


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


def rule_in_words(options: PaletteRule, contour: ContourColor | None) -> str:
    """Return the rule in words; shares that it names are of the same pixels as the colours'."""
    least = 100 * options.min_share
    words = [f"at least {least:g} % of the character's pixels"]
    if contour is not None:
        of_all = least * (1 - contour.share)
        words = [
            f"at least {least:g} % of the character without its drawn lines, here {of_all:.1f} % "
            "of all its pixels (a colour with soft edges may have a little less)",
            f"the lines' colour {least:g} % of all" if options.contour else "the lines' colour too",
        ]
    if options.max_colors < MAX_COLORS:
        words.append(f"at most {options.max_colors} colours")
    words.append(f"shades within {JUST_NOTICEABLE:g} in OKLab are one colour")
    if options.keep:
        words.append(f"kept by hand: {', '.join(map(hex_of, options.keep))}")
    return "; ".join(words)


def _contour(ink: Amount) -> ContourColor:
    rgb = ink.paint.rgb
    return ContourColor(rgb, ink.share - ink.cloth, ink.cloth, name_of(rgb))


def _dropped(
    left: Sequence[Amount],
    hidden: Sequence[Paint],
    histogram: Histogram,
    colors: tuple[PaletteColor, ...],
) -> tuple[DroppedColor, ...]:
    """Return what was left out, the most first: paints that are worth a line, and hidden colours.

    Of hidden colours the pixels count that look like them.
    """
    total = int(histogram.counts.sum())
    listed: list[tuple[Paint, float, Place | None]] = [
        (amount.paint, amount.share, None) for amount in left if amount.share >= LEAST_LISTED
    ]
    pixels = pixels_of(histogram, [paint.members for paint in hidden])
    for paint, own in zip(hidden, pixels, strict=True):
        share = int(histogram.counts[paint.members].sum()) / total
        listed.append((paint, share, next(iter(patches_of(own)), None)))
    palette = np.array([color.rgb for color in colors], dtype=np.uint8)
    return tuple(
        DroppedColor(paint.rgb, share, name_of(paint.rgb), _cost(paint, histogram, palette), place)
        for paint, share, place in sorted(listed, key=lambda one: (-one[1], one[0].rgb))
    )


def _cost(paint: Paint, histogram: Histogram, palette: UInt8[np.ndarray, "colors 3"]) -> float:
    """Return how far a paint's pixels are from the palette in OKLab, the mean."""
    own, counts = histogram.colors[paint.members], histogram.counts[paint.members]
    if not len(own):  # ink that no pixel shows pure
        own, counts = np.array([paint.rgb], dtype=np.uint8), np.ones(1, dtype=np.int64)
    given = palette[nearest_colors(own, palette)]
    away = np.linalg.norm(oklab_from_rgb(own) - oklab_from_rgb(given), axis=1)
    return float(np.average(away, weights=counts))
