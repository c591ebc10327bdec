"""Recolour drawings by their palette: all that `toonset recolor` does between files."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import UInt8

from toonset.errors import PaletteError
from toonset.palette.color_names import meant_by, name_of
from toonset.palette.extract import PaintMap
from toonset.palette.formats.hex import is_color, rgb_of_typed
from toonset.palette.names import RGB, hex_of
from toonset.palette.palette import Palette
from toonset.palette.pixels.cel_tones import tone_colors
from toonset.palette.pixels.ramp_recolor import recolor_shaded
from toonset.palette.pixels.recolor import recolor, tone_map

Picture = UInt8[np.ndarray, "height width 4"]
Map = UInt8[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "colors 3"]


def change_colors(colors: Colors, changes: Sequence[str], names: Sequence[str] = ()) -> Colors:
    """Return a palette's colours with some replaced; all changes happen at once.

    Args:
        colors: of the palette.
        changes: "OLD=NEW", hex colours; OLD must be one of the palette, or words of its name that
            no other has: "legs" or "brown legs" for "dark brown (legs)".
        names: of the colours, where they have others than their plain ones.

    Raises:
        PaletteError: no such colour, one that is replaced twice, or text that is no such pair.
    """
    old: list[RGB] = [(r, g, b) for r, g, b in colors.tolist()]
    plain = [name_of(color) for color in old]
    shown = list(names) or plain
    new = colors.copy()
    replaced: set[RGB] = set()
    for change in changes:
        words = change.split("=")
        if len(words) != 2:
            raise PaletteError(f"--recolor {change!r}: OLD=NEW is needed, e.g. '#aa0000=#00aa00'")
        source, where = words[0].strip().lower(), f"--recolor {change!r}"
        known = _meant(source, old, (shown, plain))
        if known is None and is_color(source):
            known = rgb_of_typed(source, where)
        if known is None or known not in old:
            pairs = zip(old, shown, strict=True)
            has = ", ".join(f"{hex_of(color)} ({name})" for color, name in pairs)
            raise PaletteError(f"{where}: the palette has {has}; choose one of them")
        if known in replaced:
            raise PaletteError(f"{where}: {hex_of(known)} is replaced twice; drop one")
        replaced.add(known)
        new[old.index(known)] = rgb_of_typed(words[1].strip(), where)
    return new


def _meant(text: str, colors: Sequence[RGB], names: Sequence[Sequence[str]]) -> RGB | None:
    """Return the one colour that a name means, by the first list of names in which it means one."""
    for own in names:
        found = meant_by(text, own)
        if len(found) == 1:
            return colors[found[0]]
    return None


def recolor_drawing(
    picture: Picture, paint: PaintMap, contour: Map, palette: Palette, colors: Colors
) -> Picture:
    """Return a drawing in other colours: see `toonset.palette.pixels.recolor`.

    Left-out colours that are no shades of a paint stay as they are, and so do drawn lines. Where
    paints are ramps, every pixel is some paint's: see `toonset.palette.pixels.ramp_recolor`.

    Args:
        picture: the drawing.
        paint: what its pixels are painted with.
        contour: how far lines cover every pixel.
        palette: of the sheet.
        colors: as many as it has, in its order.
    """
    if palette.has_ramps and not palette.stepped:
        return recolor_shaded(picture, paint.labels, palette.rgb, colors)
    old, new = (tone_colors(palette, one) for one in (palette.rgb, colors))
    tones = tone_map(paint.labels, paint.tones, contour, len(colors), len(old) // len(colors))
    return recolor(picture, tones, contour, old, new)
