"""Read JASC's .pal, of Paint Shop Pro, which Aseprite, GraphicsGale and many tools have, too.

Three lines of head (`JASC-PAL`, `0100`, the number of colours), then "red green blue" a line;
Aseprite adds alpha. Source: Aseprite's docs and src/doc/file/pal_file.cpp.
"""

from __future__ import annotations

from toonset.errors import PaletteError
from toonset.palette.formats.text import lines_of
from toonset.palette.names import NamedColor, levels_of

MAGIC = "JASC-PAL"
HEAD_LINES = 3


def read_jasc(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours of a JASC .pal, without fully transparent ones.

    Raises:
        PaletteError: not a JASC .pal, a line that is not a colour, or another number of colours
            than it announces.
    """
    if data.startswith(b"RIFF"):
        raise PaletteError(f"{where}: is a palette of Windows; save it as JASC .pal or as .gpl")
    lines = [line.strip() for line in lines_of(data, where)]
    if lines[0] != MAGIC:
        raise PaletteError(f"{where}: is no JASC palette; save it as one, or as .gpl")
    rows = [
        levels_of(line.split(), 4 if len(line.split()) == 4 else 3, f"{where}: line {number}")
        for number, line in enumerate(lines[HEAD_LINES:], start=HEAD_LINES + 1)
        if line
    ]
    announced = lines[HEAD_LINES - 1] if len(lines) >= HEAD_LINES else ""
    if announced != str(len(rows)):
        raise PaletteError(
            f"{where}: announces {announced[:20]!r} colours and has {len(rows)}; export it again"
        )
    return [NamedColor((red, green, blue)) for red, green, blue, *alpha in rows if alpha != [0]]
