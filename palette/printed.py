"""Use the palette that a sheet prints: the artist's own list of paints.

A printed colour is in the drawings where enough pixels are of it. If most of the list is, the
paints that are found near these are kept as a person would keep them, however small. Where much is
of printed colours that no found paint is near, as in soft paint that runs together, the printed
colours are the paints, with what else was found far from all of them. Either way they come first,
in their printed order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.errors import PaletteError
from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.names import hex_of
from toonset.palette.paints.select import PaletteRule
from toonset.palette.palette import Palette
from toonset.palette.pixels.antialias import OPAQUE

RGB = tuple[int, int, int]
Picture = UInt8[np.ndarray, "height width 4"]
REACH = 2 * JUST_NOTICEABLE  # in OKLab: so far print and paint of one colour may be apart
OCCURS = 0.001  # of the figure's pixels: a painted eye
FITS = 0.6  # of the printed colours that must occur, or the list is another character's
FEWEST = 3  # that must occur
OTHER = 3 * REACH  # in OKLab: a found paint so far from every printed one is none of them
IN_PRINTED_ORDER = "; in the order that the sheet prints, the others by share"


@dataclass(frozen=True)
class Printed:
    """The palette that the drawings' sheets print.

    Attributes:
        colors: 8-bit sRGB, in reading order.
        use: True: they are the whole palette; None: where they fit the drawings; False: never.
    """

    colors: tuple[RGB, ...] = ()
    use: bool | None = None

    def as_colors(self) -> str:
        """Return the colours as `--colors` takes them.

        Raises:
            PaletteError: there are none.
        """
        if not self.colors:
            raise PaletteError(
                "--swatches: no printed palette was found on the sheet (three or more patches of "
                "plain colour side by side); give the colours with --colors"
            )
        return ",".join(map(hex_of, self.colors))


def occurring(pictures: Sequence[Picture], printed: Sequence[RGB]) -> dict[RGB, float]:
    """Return the printed colours that the drawings are painted in, and their shares of the figure.

    None if the list does not fit.

    Args:
        pictures: sRGB with straight alpha.
        printed: 8-bit sRGB.
    """
    if not printed:
        return {}
    shares = _shares(pictures, printed).tolist()
    found = {rgb: share for rgb, share in zip(printed, shares, strict=True) if share >= OCCURS}
    return found if len(found) >= max(FEWEST, FITS * len(printed)) else {}


def with_printed(
    printed: Mapping[RGB, float],
    options: PaletteRule,
    find: Callable[[PaletteRule], Palette],
    pick: Callable[[UInt8[np.ndarray, "colors 3"]], Palette],
) -> Palette:
    """Return the drawings' palette with the printed colours that occur in it.

    Args:
        printed: those that occur, with their shares.
        options: of the choice without them.
        find: returns the palette of the drawings by such options.
        pick: returns the palette of given colours.
    """
    plain = find(options)
    seen = [*(one.rgb for one in plain.colors), *(one.rgb for one in plain.dropped)]
    meant = {rgb: _nearest(rgb, seen) for rgb in printed}
    lost = sum(share for rgb, share in printed.items() if meant[rgb][1] > REACH)
    if lost >= options.min_share:
        colors = list(printed)
        others = [one.rgb for one in plain.colors if _nearest(one.rgb, colors)[1] > OTHER]
        return pick(np.array([*colors, *others], dtype=np.uint8))
    near = [number for number, away in meant.values() if away <= REACH]
    left_out = [seen[number] for number in near if number >= len(plain.colors)]
    kept = tuple(dict.fromkeys((*options.keep, *left_out)))
    room = options.max_colors - len(plain.colors)
    return find(replace(options, keep=kept)) if left_out and room >= len(left_out) else plain


def in_printed_order(found: Palette, printed: Sequence[RGB]) -> Palette:
    """Return a palette with the paints that are printed first, in that order."""
    place = printed_places([one.rgb for one in found.colors], printed)
    order = sorted(range(len(found.colors)), key=lambda i: (place.get(i, len(printed)), i))
    rule = found.rule + (IN_PRINTED_ORDER if place else "")
    return replace(
        found, colors=tuple(found.colors[i] for i in order), rule=rule, printed=tuple(printed)
    )


def printed_places(colors: Sequence[RGB], printed: Sequence[RGB]) -> dict[int, int]:
    """Return the places in the printed list of those of a palette's colours that are printed."""
    place: dict[int, int] = {}
    for at, rgb in enumerate(printed):
        number, away = _nearest(rgb, colors)
        if away <= REACH:
            place.setdefault(number, at)
    return place


def paint_of(rgb: RGB, colors: Sequence[RGB]) -> int | None:
    """Return which of a palette's colours a printed one is; None if it is none of them."""
    number, away = _nearest(rgb, colors)
    return number if away <= REACH else None


def _nearest(rgb: RGB, colors: Sequence[RGB]) -> tuple[int, float]:
    places = oklab_from_rgb(np.array(colors, dtype=np.uint8).reshape(-1, 3))
    away = np.linalg.norm(places - oklab_from_rgb(np.array(rgb, dtype=np.uint8)), axis=1)
    return (int(away.argmin()), float(away.min())) if len(away) else (-1, float("inf"))


def _shares(pictures: Sequence[Picture], printed: Sequence[RGB]) -> Float[np.ndarray, " printed"]:
    """Return the share of the opaque pixels that are of each printed colour, the nearest."""
    codes: Int[np.ndarray, " pixels"] = np.concatenate(
        [np.ascontiguousarray(p).view("<u4")[p[..., 3] >= OPAQUE].ravel() for p in pictures]
    )
    each, counts = np.unique(codes & 0xFFFFFF, return_counts=True)
    colors = np.stack([each & 255, each >> 8 & 255, each >> 16], axis=1).astype(np.uint8)
    targets = oklab_from_rgb(np.array(printed, dtype=np.uint8))
    best, least = np.zeros(len(each), dtype=np.int64), np.full(len(each), np.inf)
    places = oklab_from_rgb(colors)
    for number, target in enumerate(targets):
        away = np.linalg.norm(places - target, axis=1)
        closer: Bool[np.ndarray, " n"] = away < least
        best[closer], least[closer] = number, away[closer]
    own = np.bincount(best, counts * (least <= REACH), len(printed))
    return own / max(int(counts.sum()), 1)
