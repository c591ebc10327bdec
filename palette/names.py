"""Read what palette files write: names, codes and levels of colours."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from toonset.errors import PaletteError

RGB = tuple[int, int, int]
MAX_NAME = 64  # characters; a palette row in GIMP or a swatch's label holds no more anyway
ROUNDING = 1e-3  # of a range: how far a float may lie outside it before it is no slip of rounding
HEX = re.compile(r"#?([0-9a-fA-F]{3}|[0-9a-fA-F]{6})")
LEVEL = re.compile(r"\d{1,3}", re.ASCII)


def hex_of(rgb: tuple[int, int, int]) -> str:
    """Return "#rrggbb" of an 8-bit sRGB colour."""
    return "#{:02x}{:02x}{:02x}".format(*rgb)


def rgb_of_hex(word: object, where: str) -> RGB:
    """Return the colour of "#rrggbb" or "#rgb"; the # may be left out.

    Raises:
        PaletteError: anything else.
    """
    match = HEX.fullmatch(word) if isinstance(word, str) else None
    if match is None:
        raise PaletteError(f"{where}: {str(word)[:40]!r} is no colour; write it as #rrggbb or #rgb")
    digits = match[1] if len(match[1]) == 6 else "".join(2 * digit for digit in match[1])
    return int(digits[:2], 16), int(digits[2:4], 16), int(digits[4:], 16)


@dataclass(frozen=True)
class NamedColor:
    """One colour of a palette file.

    Attributes:
        rgb: 8-bit sRGB.
        name: what the file calls it; "" where it does not.
    """

    rgb: RGB
    name: str = ""


def one_line(text: str) -> str:
    """Return a foreign text as one printable line: no control characters, single spaces."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def clean_name(text: str) -> str:
    """Return a foreign name as one printable line of at most 64 characters."""
    return one_line(text)[:MAX_NAME].strip()


def levels_of(words: Sequence[str], count: int, where: str) -> list[int]:
    """Return the first `count` words as 8-bit levels.

    Raises:
        PaletteError: fewer words, or one that is not a whole number from 0 to 255.
    """
    numbers = [int(word) for word in words[:count] if LEVEL.fullmatch(word)]
    if len(numbers) != count or max(numbers) > 255:
        amount = "four numbers" if count == 4 else "three numbers"
        raise PaletteError(
            f"{where}: {' '.join(words)[:40]!r} is no colour; write {amount} from 0 to 255"
        )
    return numbers


def within(value: float, low: float, high: float, where: str) -> float:
    """Return `value`, with slips of rounding clamped to [low, high].

    Raises:
        PaletteError: not a finite number, or clearly outside.
    """
    slip = ROUNDING * (high - low)
    if not (math.isfinite(value) and low - slip <= value <= high + slip):
        raise PaletteError(
            f"{where}: has the value {value:g}, {low:g} to {high:g} is needed; export it again"
        )
    return min(max(value, low), high)


def level(unit: float, where: str) -> int:
    """Return the 8-bit level of a number from 0 to 1.

    Raises:
        PaletteError: not a finite number, or clearly outside.
    """
    return round(255 * within(unit, 0, 1, where))


def no_cmyk(where: str) -> PaletteError:
    """Return the refusal of inks: without the press's profile they have no sRGB colour.

    A guessed conversion would be off by far more than the shades that a palette tells apart.
    """
    return PaletteError(
        f"{where}: is CMYK, which has no screen colour without its print profile; convert the "
        "swatches to RGB in the program that wrote them, then export again"
    )
