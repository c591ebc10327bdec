"""Define the corrections of a palette, as corrections.json has them.

Colours are named by the hex that palette.json has for them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field

from toonset.json_file import STRICT
from toonset.palette.names import clean_name
from toonset.view import Box

MOST_NAME, MOST_RADIUS, MOST_PX = 200, 1000.0, 1e6


def hex_word(text: str) -> str:
    """Return "#rrggbb" in small letters.

    Raises:
        ValueError: it is invalid.
    """
    if len(text) != 7 or text[0] != "#" or set(text[1:].lower()) - set("0123456789abcdef"):
        raise ValueError(f"{text[:40]!r} is no colour; write it as #rrggbb")
    return text.lower()


def _box_around(box: object) -> object:
    """Return a box (x, y, width, height) in whole pixels, rounded outwards."""
    if not isinstance(box, list) or len(box) != 4 or {type(side) for side in box} - {int, float}:
        raise ValueError("four numbers x, y, width, height are needed")
    x, y, width, height = (min(max(side, -MOST_PX), MOST_PX) for side in box)
    if width <= 0 or height <= 0:
        raise ValueError(f"{width:g} x {height:g} px is empty")
    left, top = math.floor(x), math.floor(y)
    return left, top, math.ceil(x + width) - left, math.ceil(y + height) - top


def _name(text: str) -> str:
    if not clean_name(text):
        raise ValueError("a name needs a letter")
    return clean_name(text)


Hex = Annotated[str, AfterValidator(hex_word)]
Name = Annotated[str, Field(max_length=MOST_NAME), AfterValidator(_name)]
Number = Annotated[float, Field(ge=-MOST_PX, le=MOST_PX)]
Pixel = tuple[Number, Number]
FigureBox = Annotated[Box, BeforeValidator(_box_around)]


@dataclass(frozen=True)
class Divided:
    """A paint that is several.

    Attributes:
        color: of the palette.
        into: what it becomes: each of its pixels gets the nearest of these.
    """

    __pydantic_config__ = STRICT

    color: Hex
    into: Annotated[tuple[Hex, ...], Field(min_length=2)]


@dataclass(frozen=True)
class Stroke:
    """A stroke of the label brush.

    Attributes:
        box: (x, y, width, height) of the drawing in its sheet.
        color: that the pixels get.
        points: of its middle line, sheet pixels.
        radius: pixels.
    """

    __pydantic_config__ = STRICT

    box: FigureBox
    color: Hex
    points: Annotated[tuple[Pixel, ...], Field(min_length=1)]
    radius: Annotated[float, Field(gt=0, le=MOST_RADIUS)] = 4.0


@dataclass(frozen=True)
class PaletteCorrections:
    """Corrections of a palette; colours as "#rrggbb".

    Attributes:
        keep: left-out colours that are paints.
        drop: colours that are not paints: their pixels get the nearest other.
        merge: colours that are one; the first of each group stays.
        split: colours that are several.
        names: by colour.
        strokes: of the label brush; later ones win.
    """

    __pydantic_config__ = STRICT

    keep: tuple[Hex, ...] = ()
    drop: tuple[Hex, ...] = ()
    merge: tuple[Annotated[tuple[Hex, ...], Field(min_length=2)], ...] = ()
    split: tuple[Divided, ...] = ()
    names: dict[Hex, Name] = field(default_factory=dict)
    strokes: tuple[Stroke, ...] = ()
