"""A colour as a person types it: a code, or one of the two words that mean only one colour.

Other words do not: nobody's "red" is #ff0000, and the drawing's own is in the palette.
"""

from __future__ import annotations

from toonset.palette.formats.hex import HEX, rgb_of_hex
from toonset.palette.named import RGB

WORDS = {"white": (255, 255, 255), "black": (0, 0, 0)}


def is_color(word: str) -> bool:
    """Return whether a word is a colour."""
    return word.lower() in WORDS or HEX.fullmatch(word) is not None


def rgb_of_typed(word: str, where: str) -> RGB:
    """Return the colour of "#rrggbb", "#rgb" (the # may be left out), "white" or "black".

    Raises:
        PaletteError: anything else.
    """
    return WORDS[word.lower()] if word.lower() in WORDS else rgb_of_hex(word, where)
