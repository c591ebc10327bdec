"""Read and write GIMP's .gpl, which Krita, Inkscape and Aseprite have, too.

Lines of "red green blue name". Aseprite's variant says `Channels: RGBA` and has a fourth number.
Sources: GIMP's app/core/gimppalette-load.c; Aseprite's docs/gpl-palette-extension.md.
"""

from __future__ import annotations

import re

from toonset.errors import PaletteError
from toonset.palette.formats.text import lines_of
from toonset.palette.formats.tones import swatches_of
from toonset.palette.names import NamedColor, clean_name, levels_of
from toonset.palette.palette import Palette

MAGIC = "GIMP Palette"
HEADER = re.compile(r"\s*(#|Name:|Columns:|Channels:|$)", re.IGNORECASE)
UNNAMED = "Untitled"  # what GIMP writes for a colour without a name
COLUMNS = 16


def read_gpl(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours of a .gpl, without Aseprite's fully transparent ones.

    Raises:
        PaletteError: not a .gpl, or a line that is not a colour.
    """
    lines = lines_of(data, where)
    if not lines[0].startswith(MAGIC):
        raise PaletteError(
            f"{where}: does not begin with {MAGIC!r}; export it again as GIMP palette"
        )
    count = 4 if any(_says_rgba(line) for line in lines) else 3
    rows = [
        _row(line, count, f"{where}: line {number}")
        for number, line in enumerate(lines[1:], start=2)
        if not HEADER.match(line)
    ]
    return [
        NamedColor((red, green, blue), name)
        for (red, green, blue, *alpha), name in rows
        if alpha != [0]
    ]


def gpl_title(data: bytes) -> str:
    """Return the name that a .gpl states; "" if it does not."""
    lines = lines_of(data, "palette")
    named = (line.partition(":")[2] for line in lines if line.lower().startswith("name:"))
    return clean_name(next(named, ""))


def to_gpl(palette: Palette, title: str = "toonset") -> str:
    """Return the palette as .gpl text, tones too; shares stand in palette.json."""
    rows = [
        f"{red:3d} {green:3d} {blue:3d}\t{color.name or UNNAMED}"
        for color in swatches_of(palette)
        for red, green, blue in [color.rgb]
    ]
    columns = min(len(rows), COLUMNS)  # never 0: Krita divides by it
    head = [MAGIC, f"Name: {clean_name(title)}", f"Columns: {columns}", "#"]
    return "\n".join([*head, *rows, ""])


def _says_rgba(line: str) -> bool:
    key, _, value = line.partition(":")
    return key.strip().lower() == "channels" and value.strip().upper() == "RGBA"


def _row(line: str, count: int, where: str) -> tuple[list[int], str]:
    words = line.split(maxsplit=count)
    name = clean_name("".join(words[count:]))
    return levels_of(words, count, where), "" if name == UNNAMED else name
