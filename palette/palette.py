"""What a palette is: named colours with their shares, and what was left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from toonset.errors import PaletteError

MAX_COLORS = 255  # a label is one byte, and 255 means unlabelled


@dataclass(frozen=True)
class Tone:
    """A paint's colour in light, or in shadow.

    Attributes:
        rgb: 8-bit sRGB.
        share: of the character's pixels over all pictures, 0 to 1.
    """

    rgb: tuple[int, int, int]
    share: float


@dataclass(frozen=True)
class PaletteColor:
    """One colour.

    Attributes:
        rgb: 8-bit sRGB; of a shaded paint its colour in light.
        share: of the character's pixels over all pictures, 0 to 1; all tones together.
        name: a plain name for people.
        tones: in light and in shadow, where the sheet has a shadow.
    """

    rgb: tuple[int, int, int]
    share: float
    name: str
    tones: tuple[Tone, ...] = ()


@dataclass(frozen=True)
class Shadow:
    """A sheet's two-tone shadow: colour in shadow = factor * colour in light.

    Attributes:
        factor: red, green and blue, of levels of sRGB.
        spread: median deviation of single borders from it, logarithms.
        bits: that one direction of the light saves over all borders.
    """

    factor: tuple[float, float, float]
    spread: tuple[float, float, float]
    bits: float


@dataclass(frozen=True)
class Place:
    """Where most of a colour is.

    Attributes:
        view: number of the picture, from 0.
        box: (x, y, width, height) in its pixels.
    """

    view: int
    box: tuple[int, int, int, int]


@dataclass(frozen=True)
class DroppedColor:
    """A colour that fell under the rule.

    Attributes:
        rgb: 8-bit sRGB.
        share: of the character's pixels, 0 to 1.
        name: a plain name for people.
        cost: distance in OKLab from its pixels to the palette colour that they now get, the mean.
        place: its largest patch; None if unknown.
    """

    rgb: tuple[int, int, int]
    share: float
    name: str
    cost: float
    place: Place | None = None


@dataclass(frozen=True)
class ContourColor:
    """The colour of the drawn lines.

    Attributes:
        rgb: 8-bit sRGB.
        share: of the character's pixels that are lines, 0 to 1.
        cloth: share of the character's pixels that have this colour without being lines.
        name: a plain name for people.
    """

    rgb: tuple[int, int, int]
    share: float
    cloth: float
    name: str


@dataclass(frozen=True)
class Evidence:
    """Why so many colours were told apart: their description is the shortest.

    Bits to describe 4,096 independent pixels of the character, with the colours themselves.

    Attributes:
        colors: that pay for themselves, those under the rule included, near-equal and tiny ones
            not.
        one_less: bits more with one colour less.
        one_more: bits more with one colour more.
    """

    colors: int
    one_less: float
    one_more: float


@dataclass(frozen=True)
class Palette:
    """A character's colours, the most frequent first.

    Attributes:
        colors: at least one, at most 255.
        rule: how they were chosen, in words.
        dropped: what was seen but left out.
        warnings: what a person should know.
        contour: the drawn lines' colour; None without lines, or where nobody looked for them.
        evidence: of the number of colours; None where it was not chosen by us.
        shadow: of a sheet that is shaded in two tones; None of a flat one.
        features: those of the colours that are under the rule, but kept: eyes, mouths, buttons.
        title: what programs show as the palette's name; "": none was given yet.
    """

    colors: tuple[PaletteColor, ...]
    rule: str
    dropped: tuple[DroppedColor, ...] = ()
    warnings: tuple[str, ...] = ()
    contour: ContourColor | None = None
    evidence: Evidence | None = None
    shadow: Shadow | None = None
    features: tuple[tuple[int, int, int], ...] = ()
    title: str = ""

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
