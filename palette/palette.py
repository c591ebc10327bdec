"""What a palette is: named colours with their shares, and what was left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from toonset.errors import PaletteError

MAX_COLORS = 255  # a label is one byte, and 255 means unlabelled


@dataclass(frozen=True)
class PaletteColor:
    """One colour.

    Attributes:
        rgb: 8-bit sRGB.
        share: of the character's flat pixels over all pictures, 0 to 1.
        name: a plain name for people.
    """

    rgb: tuple[int, int, int]
    share: float
    name: str


@dataclass(frozen=True)
class DroppedColor:
    """A colour that fell under the rule.

    Attributes:
        rgb: 8-bit sRGB.
        share: of the character's flat pixels, 0 to 1.
        name: a plain name for people.
        cost: distance in OKLab from its pixels to the palette colour that they now get, the mean.
    """

    rgb: tuple[int, int, int]
    share: float
    name: str
    cost: float


@dataclass(frozen=True)
class Palette:
    """A character's colours, the most frequent first.

    Attributes:
        colors: at least one, at most 255.
        rule: how they were chosen, in words.
        dropped: what was seen but left out.
        warnings: what a person should know.
    """

    colors: tuple[PaletteColor, ...]
    rule: str
    dropped: tuple[DroppedColor, ...] = ()
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse palettes that cannot label anything.

        Raises:
            PaletteError: no colour, or more than 255.
        """
        if not 1 <= len(self.colors) <= MAX_COLORS:
            raise PaletteError(f"palette: {len(self.colors)} colours; 1 to {MAX_COLORS} are needed")

    @property
    def rgb(self) -> UInt8[np.ndarray, "colors 3"]:
        """Return the colours as an array, in order; a label indexes it."""
        return np.array([color.rgb for color in self.colors], dtype=np.uint8)
