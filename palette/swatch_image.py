"""Draw a palette for people: blocks with name, code and share; the left-out ones below."""

from __future__ import annotations

import functools
import math
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw, ImageFont

from toonset.palette.names import RGB, clean_name, hex_of
from toonset.palette.palette import ContourColor, DroppedColor, Palette, PaletteColor
from toonset.palette.printed import paint_of

PAGE, INK, QUIET, EDGE = (250, 250, 250), (30, 30, 30), (95, 95, 95), (190, 190, 190)
MARGIN, GAP, STRIP = 28, 20, 36
MOST_COLUMNS, FEWEST_COLUMNS = 10, 3
NAME_LINES = 2

Font = ImageFont.FreeTypeFont | ImageFont.ImageFont
AnyColor = PaletteColor | ContourColor | DroppedColor


@dataclass(frozen=True)
class Size:
    """Size of one part's cards, in pixels."""

    block_wh: tuple[int, int]
    font_px: int

    @property
    def font(self) -> Font:
        """Return Pillow's own font, which needs no file."""
        return _font(self.font_px)

    @property
    def line_px(self) -> int:
        """Return the distance from line to line."""
        return round(1.3 * self.font_px)


LARGE, SMALL = Size((192, 120), 18), Size((132, 64), 15)


@dataclass(frozen=True)
class Card:
    """One colour with the lines of its name, and its code and share.

    With `beside`, the right half shows that colour.
    """

    rgb: RGB
    name: tuple[str, ...]
    fact: str
    beside: RGB | None = None


@dataclass(frozen=True)
class Part:
    """Cards of one size under a heading ("" for none)."""

    heading: str
    cards: tuple[Card, ...]
    size: Size

    def row_px(self) -> int:
        """Return the distance from row to row."""
        lines = 1 + max(len(card.name) for card in self.cards)
        return self.size.block_wh[1] + 6 + lines * self.size.line_px + GAP

    def heading_px(self) -> int:
        """Return the height of the heading with the space above it."""
        return GAP + round(1.5 * self.size.line_px) if self.heading else 0

    def columns(self, width: int) -> int:
        """Return how many cards fit beside each other on a page of `width`."""
        return (width - 2 * MARGIN + GAP) // (self.size.block_wh[0] + GAP)

    def height(self, width: int) -> int:
        """Return the height of all rows and the heading."""
        rows = math.ceil(len(self.cards) / self.columns(width))
        return rows * self.row_px() + self.heading_px()


def draw_swatches(palette: Palette) -> UInt8[np.ndarray, "height width 3"]:
    """Return a picture of the palette: shares as a strip, then a card for every colour.

    The lines' colour, the left-out colours and those that the sheet prints, each beside the paint
    that it is, follow on smaller cards.
    """
    parts = _parts(palette)
    columns = max(FEWEST_COLUMNS, _columns(len(palette.colors)))
    width = 2 * MARGIN + columns * (LARGE.block_wh[0] + GAP) - GAP
    top = MARGIN + STRIP + GAP
    height = top + sum(part.height(width) for part in parts) + MARGIN - GAP
    image = Image.new("RGB", (width, height), PAGE)
    pen = ImageDraw.Draw(image)
    _draw_strip(pen, palette, width)
    for part in parts:
        _draw_part(pen, part, top, width)
        top += part.height(width)
    return np.array(image)


def broken(text: str, font: Font, width: float) -> tuple[str, ...]:
    """Return a name as at most two lines no wider than `width`, with "..." where it is cut."""
    lines, words = [""], drawable(text).split(" ")
    for word in words:
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    kept = [*lines[: NAME_LINES - 1], " ".join(lines[NAME_LINES - 1 :])]
    return tuple(_shortened(line, font, width) for line in kept if line)


def drawable(text: str) -> str:
    """Return a name in the letters that the font has: accents left out, others as "?"."""
    plain = unicodedata.normalize("NFKD", clean_name(text))
    bare = "".join(letter for letter in plain if not unicodedata.combining(letter))
    return bare.encode("ascii", errors="replace").decode()


@functools.cache
def _font(px: int) -> Font:
    return ImageFont.load_default(px)


def _shortened(line: str, font: Font, width: float) -> str:
    if font.getlength(line) <= width:
        return line
    fits = [i for i in range(len(line)) if font.getlength(line[:i] + "...") <= width]
    return line[: max(fits, default=0)].rstrip() + "..."


def _columns(count: int) -> int:
    """Return the columns that make a page of `count` cards somewhat wider than high."""
    rows = max(1, round(math.sqrt(count / 2.5)), math.ceil(count / MOST_COLUMNS))
    return math.ceil(count / rows)


def _parts(palette: Palette) -> list[Part]:
    parts = [
        _part("", palette.colors, LARGE),
        _part("Drawn lines", (palette.contour,) if palette.contour else (), SMALL),
        _part("Left out", palette.dropped, SMALL),
        Part("Printed on the sheet, beside the paint", _printed_cards(palette), SMALL),
    ]
    return [part for part in parts if part.cards]


def _part(heading: str, colors: Sequence[AnyColor], size: Size) -> Part:
    cards = tuple(
        Card(
            color.rgb,
            broken(color.name, size.font, size.block_wh[0]),
            f"{hex_of(color.rgb)}  {_percent(color.share)}",
        )
        for color in colors
    )
    return Part(heading, cards, size)


def _printed_cards(palette: Palette) -> tuple[Card, ...]:
    """Return a card per printed colour, in its order, with the paint that it is on its right."""
    colors = [one.rgb for one in palette.colors]
    cards = []
    for rgb in palette.printed:
        number = paint_of(rgb, colors)
        name = "not painted" if number is None else palette.colors[number].name
        lines = broken(name, SMALL.font, SMALL.block_wh[0])
        cards.append(Card(rgb, lines, hex_of(rgb), None if number is None else colors[number]))
    return tuple(cards)


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %" if share >= 0.0005 else "< 0.1 %"


def _draw_strip(pen: ImageDraw.ImageDraw, palette: Palette, width: int) -> None:
    """Draw the colours side by side, each as wide as its share of their sum."""
    total = sum(color.share for color in palette.colors) or 1.0
    left, whole = float(MARGIN), width - 2 * MARGIN
    for color in palette.colors:
        right = left + whole * color.share / total
        pen.rectangle((round(left), MARGIN, round(right), MARGIN + STRIP), fill=color.rgb)
        left = right
    pen.rectangle((MARGIN, MARGIN, width - MARGIN, MARGIN + STRIP), outline=EDGE)


def _draw_part(pen: ImageDraw.ImageDraw, part: Part, top: int, width: int) -> None:
    size, columns, row_px = part.size, part.columns(width), part.row_px()
    block_width, block_height = size.block_wh
    if part.heading:
        pen.text((MARGIN, top + GAP), part.heading, fill=QUIET, font=size.font)
        top += part.heading_px()
    for i, card in enumerate(part.cards):
        x = MARGIN + i % columns * (block_width + GAP)
        y = top + i // columns * row_px
        box = (x, y, x + block_width - 1, y + block_height - 1)
        pen.rounded_rectangle(box, radius=8, fill=card.rgb, outline=EDGE)
        if card.beside is not None:
            right = (x + block_width // 2, y, x + block_width - 1, y + block_height - 1)
            corners = (False, True, True, False)
            pen.rounded_rectangle(right, 8, fill=card.beside, outline=EDGE, corners=corners)
        lines = [*((line, INK) for line in card.name), (card.fact, QUIET)]
        for j, (line, ink) in enumerate(lines):
            pen.text((x, y + block_height + 6 + j * size.line_px), line, fill=ink, font=size.font)
