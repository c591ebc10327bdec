"""Define a palette: named colours with their shares, and what was left out.

The annotations say what palette.json may hold, too, and how it is written: colours as hex, numbers
with so many decimals. Within a version keys may be added (see `toonset.read`): give a new one a
default here. Whatever would make an older reader draw a wrong conclusion needs the next version.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import UInt8
from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer

from toonset.errors import PaletteError
from toonset.palette.names import RGB, clean_name, hex_of, one_line, rgb_of_hex
from toonset.palette.options import MAX_COLORS

MOST_TONES = 4  # of a paint that is shaded in steps


def _of_hex(text: object) -> RGB:
    try:
        return rgb_of_hex(text, "hex")
    except PaletteError as error:
        raise ValueError(str(error)) from error


def _decimals(digits: int) -> PlainSerializer:
    return PlainSerializer(lambda number: round(number, digits))


Hex = Annotated[RGB, BeforeValidator(_of_hex), PlainSerializer(hex_of)]
Color = Annotated[Hex, Field(alias="hex")]
Name = Annotated[str, AfterValidator(clean_name)]
Line = Annotated[str, AfterValidator(one_line)]
Share = Annotated[float, Field(ge=0, le=1), _decimals(6)]
Factor = Annotated[float, Field(gt=0, le=1), _decimals(4)]
Spread = Annotated[float, Field(ge=0), _decimals(4)]
Cost = Annotated[float, Field(ge=0, alias="oklab_cost"), _decimals(6)]
Bits = Annotated[float, _decimals(3)]
Count = Annotated[int, Field(ge=0)]


@dataclass(frozen=True)
class Tone:
    """A paint's colour in light, or in shadow.

    Attributes:
        rgb: 8-bit sRGB.
        share: of the character's pixels over all pictures, 0 to 1.
    """

    rgb: Color
    share: Share


@dataclass(frozen=True)
class PaletteColor:
    """One colour.

    Attributes:
        rgb: 8-bit sRGB; of a shaded paint its colour in light.
        share: of the character's pixels over all pictures, 0 to 1; all tones together.
        name: a plain name for people.
        tones: in light and in shadow, where the sheet has a shadow; where it has none, but is
            shaded in steps, one to four from light to dark, or throughout, the paint's ramp.
        sure: of a ramp, how likely its pixels are this paint, the mean; None: nobody asked.
        factor: of levels of sRGB in shadow, red, green and blue, where the paint has its own; None:
            the sheet's.
    """

    rgb: Color
    share: Share
    name: Name
    tones: tuple[Tone, ...] = ()
    sure: Share | None = None
    factor: tuple[Factor, Factor, Factor] | None = None


@dataclass(frozen=True)
class Shadow:
    """A sheet's two-tone shadow: colour in shadow = factor * colour in light.

    Attributes:
        factor: red, green and blue, of levels of sRGB.
        spread: median deviation of single borders from it, logarithms.
        bits: that one direction of the light saves over all borders.
    """

    factor: tuple[Factor, Factor, Factor]
    spread: tuple[Spread, Spread, Spread]
    bits: Bits


@dataclass(frozen=True)
class Place:
    """Place of a colour's largest patch.

    Attributes:
        view: number of the picture, from 0.
        box: (x, y, width, height) in its pixels.
    """

    view: Count
    box: tuple[Count, Count, Count, Count]


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

    rgb: Color
    share: Share
    name: Name
    cost: Cost
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

    rgb: Color
    share: Share
    cloth: Share
    name: Name


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

    colors: Count
    one_less: Bits
    one_more: Bits


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
        printed: colours that the sheet itself prints as its palette, in that order.
        title: what programs show as the palette's name; "": none was given yet.
        stepped: paints are shaded in flat steps: their tones are those, not stops of ramps.
    """

    colors: Annotated[tuple[PaletteColor, ...], Field(min_length=1, max_length=MAX_COLORS)]
    rule: Line
    dropped: tuple[DroppedColor, ...] = ()
    warnings: tuple[Line, ...] = ()
    contour: ContourColor | None = None
    evidence: Evidence | None = None
    shadow: Shadow | None = None
    features: tuple[Hex, ...] = ()
    printed: tuple[Hex, ...] = ()
    title: Name = ""
    stepped: bool = False

    def __post_init__(self) -> None:
        """Refuse palettes that cannot label anything.

        Raises:
            PaletteError: no colour, or more than 255; steps that are no tones of their paints.
        """
        if not 1 <= len(self.colors) <= MAX_COLORS:
            raise PaletteError(f"palette: {len(self.colors)} colours; 1 to {MAX_COLORS} are needed")
        if self.stepped:
            self._check_steps()

    def _check_steps(self) -> None:
        """Refuse steps that cannot label anything; see `__post_init__`."""
        for color in self.colors:
            if not 1 <= len(color.tones) <= MOST_TONES:
                raise PaletteError(
                    f"palette: {hex_of(color.rgb)} is shaded in steps and has {len(color.tones)} "
                    f"tones; 1 to {MOST_TONES} are needed"
                )
            if color.tones[0].rgb != color.rgb:
                raise PaletteError(
                    f"palette: the first tone of {hex_of(color.rgb)} is "
                    f"{hex_of(color.tones[0].rgb)}; it must be the colour itself"
                )
        count = sum(len(color.tones) for color in self.colors)
        if count > MAX_COLORS:
            raise PaletteError(f"palette: {count} tones; at most {MAX_COLORS} can be told apart")
        if self.shadow is not None:
            raise PaletteError(
                "palette: it is shaded in steps and has a shadow; only one of these can be"
            )

    @property
    def has_ramps(self) -> bool:
        """Return whether paints are recoloured along ramps: painted ones, or steps in light."""
        return self.shadow is None and any(color.tones for color in self.colors)

    @property
    def has_tones(self) -> bool:
        """Return whether every pixel of a paint has one of few tones."""
        return self.stepped or self.shadow is not None

    @property
    def rgb(self) -> UInt8[np.ndarray, "colors 3"]:
        """Return the colours as an array, in order; a label indexes it."""
        return np.array([color.rgb for color in self.colors], dtype=np.uint8)
