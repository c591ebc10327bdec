"""Read and write hex lists: Lospec's .hex, and paint.net's .txt (AARRGGBB).

Source: paint.net documentation, "Working with palettes": comments begin with ";", eight digits are
alpha, red, green, blue.

A colour as a person types it is a code, or one of the two words that mean only one colour: nobody's
"red" is #ff0000, and the drawing's own is in the palette.
"""

from __future__ import annotations

import re

from toonset.palette.formats.text import lines_of
from toonset.palette.names import HEX, RGB, NamedColor, rgb_of_hex
from toonset.palette.palette import Palette

WITH_ALPHA = re.compile(r"#?([0-9a-fA-F]{2})([0-9a-fA-F]{6})")
WORDS = {"white": (255, 255, 255), "black": (0, 0, 0)}


def read_hex(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours of a list with one colour per line.

    Raises:
        PaletteError: a line is neither a colour, empty, nor a comment.
    """
    lines = lines_of(data, where)
    paint_net = "paint.net" in lines[0].lower()
    words = [line.split(";")[0].strip() for line in lines]
    found = [
        _color(word, paint_net, f"{where}: line {number}")
        for number, word in enumerate(words, start=1)
        if word
    ]
    return [color for color in found if color is not None]


def to_hex(palette: Palette) -> str:
    """Return one colour per line as rrggbb, which Lospec, Aseprite and paint programs read."""
    return "".join("{:02x}{:02x}{:02x}\n".format(*color.rgb) for color in palette.colors)


def _color(word: str, paint_net: bool, where: str) -> NamedColor | None:
    """Return the colour; None for paint.net's fully transparent one."""
    match = WITH_ALPHA.fullmatch(word) if paint_net else None
    if match is None:
        return NamedColor(rgb_of_hex(word, where))
    return NamedColor(rgb_of_hex(match[2], where)) if int(match[1], 16) else None


def is_color(word: str) -> bool:
    """Return whether a word is a colour."""
    return word.lower() in WORDS or HEX.fullmatch(word) is not None


def rgb_of_typed(word: str, where: str) -> RGB:
    """Return the colour of "#rrggbb", "#rgb" (the # may be left out), "white" or "black".

    Raises:
        PaletteError: anything else.
    """
    return WORDS[word.lower()] if word.lower() in WORDS else rgb_of_hex(word, where)
