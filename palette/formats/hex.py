"""Read and write hex lists: Lospec's .hex, paint.net's .txt (AARRGGBB), and others with alpha.

Eight digits are AARRGGBB where the file is paint.net's, else RRGGBBAA behind a "#" (CSS Color 4) or
where every last pair, and not every first, is 00 or ff. Comments begin with ";" or "//", and with
"#" and a space. Source: paint.net documentation, "Working with palettes".

A colour as a person types it is a code, or one of the two words that mean only one colour: nobody's
"red" is #ff0000, and the drawing's own is in the palette.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from toonset.errors import PaletteError
from toonset.palette.formats.text import lines_of
from toonset.palette.names import HEX, RGB, NamedColor, rgb_of_hex
from toonset.palette.palette import Palette

EIGHT = re.compile(r"#?([0-9a-fA-F]{8})")
COMMENT = re.compile(r"(;|//|(?:^|\s)#(?=\s|$)).*")
CLEAR, OPAQUE = "00", "ff"
WORDS = {"white": (255, 255, 255), "black": (0, 0, 0)}


def read_hex(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours of a list with one colour per line.

    Raises:
        PaletteError: a line is neither a colour, empty, nor a comment.
    """
    lines = lines_of(data, where)
    words = [COMMENT.sub("", line).strip() for line in lines]
    _refuse_hidden_colors(lines, words, where)
    paint_net = "paint.net" in lines[0].lower()
    bare = [word for word in words if EIGHT.fullmatch(word) and word[0] != "#"]
    read_bare = paint_net or _ends_with_alpha(bare)
    found = [
        _color(word, paint_net, f"{where}: line {number}")
        if word[0] == "#" or read_bare
        else NamedColor(rgb_of_hex(word, f"{where}: line {number}"))
        for number, word in enumerate(words, start=1)
        if word
    ]
    return [color for color in found if color is not None]


def to_hex(palette: Palette) -> str:
    """Return one colour per line as rrggbb, which Lospec, Aseprite and paint programs read."""
    return "".join("{:02x}{:02x}{:02x}\n".format(*color.rgb) for color in palette.colors)


def _color(word: str, alpha_first: bool, where: str) -> NamedColor | None:
    """Return the colour; None for a fully transparent one."""
    match = EIGHT.fullmatch(word)
    if match is None:
        return NamedColor(rgb_of_hex(word, where))
    digits = match[1] if alpha_first else match[1][6:] + match[1][:6]
    return NamedColor(rgb_of_hex(digits[2:], where)) if digits[:2] != CLEAR else None


def _ends_with_alpha(words: Sequence[str]) -> bool:
    """Return whether eight digits without "#" are surely RRGGBBAA: all opaque or transparent."""
    first, last = ({word[part].lower() for word in words} for part in (slice(2), slice(6, 8)))
    return last <= {CLEAR, OPAQUE} and not first <= {CLEAR, OPAQUE}


def _refuse_hidden_colors(lines: Sequence[str], words: Sequence[str], where: str) -> None:
    """Refuse "# aabbcc": a comment, or a colour with a slip of the key?"""
    for number, (line, word) in enumerate(zip(lines, words, strict=True), start=1):
        rest = line.strip().removeprefix("#").strip()
        if not word and line.strip().startswith("#") and HEX.fullmatch(rest) and len(rest) == 6:
            raise PaletteError(f"{where}: line {number}: write #{rest}, without a space")


def is_color(word: str) -> bool:
    """Return whether a word is a colour."""
    return word.lower() in WORDS or HEX.fullmatch(word) is not None


def rgb_of_typed(word: str, where: str) -> RGB:
    """Return the colour of "#rrggbb", "#rgb" (the # may be left out), "white" or "black".

    Raises:
        PaletteError: anything else.
    """
    return WORDS[word.lower()] if word.lower() in WORDS else rgb_of_hex(word, where)
