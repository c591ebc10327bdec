"""Two palettes named .pal: Paint Shop Pro's text (JASC) and Microsoft's RIFF.

JASC: "JASC-PAL", "0100", the number of colours, then "red green blue" per line.
RIFF: little-endian chunks of form "PAL "; "data" holds version 0x0300, the number of colours, and
red, green, blue, flags for each. Source of RIFF: Microsoft, "Multimedia Programming Interface and
Data Specifications 1.0" (1991), Palette File Format.
"""

from __future__ import annotations

import struct

from toonset.errors import PaletteError
from toonset.palette.formats.text import lines_of
from toonset.palette.names import NamedColor, levels_of

JASC, RIFF = b"JASC-PAL", b"RIFF"


def read_pal(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours of a .pal of either kind; these formats hold no names.

    Raises:
        PaletteError: neither kind, cut off, or not a colour.
    """
    if data.startswith(RIFF):
        return _riff(data, where)
    if data.startswith(JASC):
        return _jasc(lines_of(data, where), where)
    raise PaletteError(
        f"{where}: begins with neither 'JASC-PAL' nor 'RIFF'; export it again, or as .gpl"
    )


def _jasc(lines: list[str], where: str) -> list[NamedColor]:
    rows = [
        (number, line.split()) for number, line in enumerate(lines[2:], start=3) if line.strip()
    ]
    announced = " ".join(rows[0][1]) if rows else ""
    if announced != str(len(rows) - 1):
        raise PaletteError(
            f"{where}: announces {announced[:20]!r} colours and has {max(len(rows) - 1, 0)}; "
            "export it again"
        )
    return [_jasc_color(words, f"{where}: line {number}") for number, words in rows[1:]]


def _jasc_color(words: list[str], where: str) -> NamedColor:
    red, green, blue, *_ = levels_of(words, 4 if len(words) > 3 else 3, where)  # 4: with alpha
    return NamedColor((red, green, blue))


def _riff(data: bytes, where: str) -> list[NamedColor]:
    content = _chunk(data, where)
    count = struct.unpack_from("<HH", content)[1] if len(content) >= 4 else 1
    if len(content) < 4 + 4 * count:
        raise PaletteError(
            f"{where}: is cut off: {count} colours in {len(content)} bytes; export it again"
        )
    rows = struct.iter_unpack("4B", content[4 : 4 + 4 * count])
    return [NamedColor((red, green, blue)) for red, green, blue, _ in rows]


def _chunk(data: bytes, where: str) -> bytes:
    """Return the content of the chunk "data"; others may stand before it."""
    offset = 12
    while data[8:12] == b"PAL " and offset + 8 <= len(data):
        kind, length = struct.unpack_from("<4sI", data, offset)
        if kind == b"data":
            return data[offset + 8 : offset + 8 + length]
        offset += 8 + length + length % 2
    raise PaletteError(f"{where}: is a RIFF file without a palette; export it again, or as .gpl")
