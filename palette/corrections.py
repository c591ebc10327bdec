"""What a person corrects of a palette, and the palette and label maps after it.

Colours are named by the hex that palette.json has for them; one that is up to `NEAR_LEVELS` off in
every channel is meant, too, for a palette found anew can differ by that much.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import AfterValidator, Field

from toonset.json_file import STRICT
from toonset.palette.names import clean_name
from toonset.view import Box

NEAR_LEVELS = 6  # of 255, in every channel
MOST_NAME, MOST_RADIUS = 200, 1000.0


def hex_word(text: str) -> str:
    """Return "#rrggbb" in small letters.

    Raises:
        ValueError: it is none.
    """
    if len(text) != 7 or text[0] != "#" or set(text[1:].lower()) - set("0123456789abcdef"):
        raise ValueError(f"{text[:40]!r} is no colour; write it as #rrggbb")
    return text.lower()


def box_around(box: tuple[float, float, float, float]) -> Box:
    """Return a box (x, y, width, height) in whole pixels, rounded outwards.

    Raises:
        ValueError: it is empty.
    """
    x, y, width, height = box
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
Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Pixel = tuple[Number, Number]
FigureBox = Annotated[tuple[Number, Number, Number, Number], AfterValidator(box_around)]


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
    """What a person corrects of a palette; colours as "#rrggbb".

    Attributes:
        keep: left-out colours that are paints.
        drop: colours that are none: their pixels get the nearest other.
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

    def contradiction(self) -> str:
        """Return where two corrections contradict each other, and how; "" if none do."""
        gone = [("drop", color) for color in self.drop]
        gone += [("merge", color) for group in self.merge for color in group[1:]]
        gone += [("split", one.color) for one in self.split]
        twice = [color for color, count in Counter(c for _, c in gone).items() if count > 1]
        if twice:
            places = " and ".join(key for key, color in gone if color == twice[0])
            return f"palette: {twice[0]} stands in {places}; let one of them speak of it"
        taken = {color for _, color in gone}
        for group in self.merge:
            if group[0] in taken:
                return f"palette.merge: {group[0]} is to stay, but goes elsewhere; correct one"
        return ""
