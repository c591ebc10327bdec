"""The paper's palette: the colours that make up at least 5 % of the character's pixels.

Only flat pixels count: mixtures along edges are nobody's colour. Shades of one colour (gradients,
noise of the file) count together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from toonset.errors import PaletteError
from toonset.palette.labels import nearest_colors
from toonset.palette.mixed import mixed_pixels, opaque_pixels
from toonset.palette.names import name_of
from toonset.palette.oklab import oklab_from_rgb
from toonset.palette.palette import MAX_COLORS, DroppedColor, Palette, PaletteColor
from toonset.palette.shades import Family, Histogram, count_colors, find_families

LEAST_LISTED = 0.002  # of the pixels: what is rarer is not worth a line among the dropped


@dataclass(frozen=True)
class PaletteOptions:
    """How colours are chosen.

    Attributes:
        min_share: least share of the character's flat pixels, 0 to 1; the paper's rule is 5 %.
        merge_distance: in OKLab; shades whose peaks are nearer are one colour. 0.06 is three times
            what is just noticeable side by side, and below the step from a base colour to its
            painted shadow.
    """

    min_share: float = 0.05
    merge_distance: float = 0.06

    def __post_init__(self) -> None:
        """Refuse shares and distances without a meaning.

        Raises:
            PaletteError: out of range.
        """
        if not 0 <= self.min_share <= 1:
            raise PaletteError(f"min share {self.min_share:g}; it is a share from 0 to 1")
        if not 0 < self.merge_distance <= 1:
            raise PaletteError(f"merge distance {self.merge_distance:g}; above 0, at most 1")


def extract_palette(
    images: Sequence[UInt8[np.ndarray, "_ _ 4"]], options: PaletteOptions | None = None
) -> Palette:
    """Return the colours of a character, the most frequent first.

    The result does not depend on the order, orientation or size of the pictures beyond their
    pixels. If no colour reaches the least share, the largest one is kept and a warning says so.

    Raises:
        PaletteError: no picture, or no opaque pixel in them.
    """
    options = options or PaletteOptions()
    histogram = _histogram(images)
    families = find_families(histogram, options.merge_distance)
    total = int(histogram.counts.sum())
    kept = [family for family in families if family.count >= options.min_share * total]
    kept = kept[:MAX_COLORS]
    warnings = []
    if not kept:
        kept = families[:1]
        warnings.append(
            f"no colour reaches {options.min_share:.1%} of the pixels; the largest, with "
            f"{kept[0].count / total:.1%}, was kept alone: lower --min-share"
        )
    rule = (
        f"at least {options.min_share:g} of the flat opaque pixels; "
        f"shades within {options.merge_distance:g} in OKLab count together"
    )
    colors = tuple(
        PaletteColor(family.rgb, family.count / total, name_of(family.rgb)) for family in kept
    )
    return Palette(
        colors, rule, _dropped(families[len(kept) :], histogram, colors), tuple(warnings)
    )


def pick_palette(
    images: Sequence[UInt8[np.ndarray, "_ _ 4"]], rgb: UInt8[np.ndarray, "colors 3"]
) -> Palette:
    """Return hand-picked colours with their shares in the pictures, in the order given.

    Raises:
        PaletteError: no picture, or no opaque pixel in them.
    """
    histogram = _histogram(images)
    label = nearest_colors(histogram.colors, rgb)
    shares = np.bincount(label, histogram.counts, len(rgb)) / histogram.counts.sum()
    triples = [(int(red), int(green), int(blue)) for red, green, blue in rgb]
    names = [name_of(triple) for triple in triples]
    unused = [
        f"#{r:02x}{g:02x}{b:02x}" for (r, g, b), s in zip(triples, shares, strict=True) if not s
    ]
    warnings = (f"no pixel is nearest to {', '.join(unused)}",) if unused else ()
    colors = tuple(
        PaletteColor(triple, float(share), name)
        for triple, share, name in zip(triples, shares, names, strict=True)
    )
    return Palette(colors, "picked by hand", (), warnings)


def _histogram(images: Sequence[UInt8[np.ndarray, "_ _ 4"]]) -> Histogram:
    if not images:
        raise PaletteError("palette: no picture given; name a bundle or pictures")
    histogram = count_colors(
        image[opaque_pixels(image) & ~mixed_pixels(image)][:, :3] for image in images
    )
    if not len(histogram.counts):
        raise PaletteError(
            "palette: the pictures have no opaque flat pixel; cut the character out with "
            "`toonset calibrate`, or save it with an opaque figure"
        )
    return histogram


def _dropped(
    families: list[Family], histogram: Histogram, colors: tuple[PaletteColor, ...]
) -> tuple[DroppedColor, ...]:
    palette = np.array([color.rgb for color in colors], dtype=np.uint8)
    total = int(histogram.counts.sum())
    result = []
    for family in families:
        if family.count < LEAST_LISTED * total:
            break
        own = histogram.colors[family.members]
        given = palette[nearest_colors(own, palette)]
        away = np.linalg.norm(oklab_from_rgb(own) - oklab_from_rgb(given), axis=1)
        cost = float(np.average(away, weights=histogram.counts[family.members]))
        share = family.count / total
        result.append(DroppedColor(family.rgb, share, name_of(family.rgb), cost))
    return tuple(result)
