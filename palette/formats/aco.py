"""Photoshop's colour swatches (.aco), version 1 (colours) and version 2 (with names).

Big-endian words. A section is version, number of colours, and per colour five words: colour space
and four values; version 2 adds a UTF-16 name. Photoshop writes both sections, older programs one.
Sources: Adobe, "Photoshop File Formats Specification", Color Swatches; L. Tesler, "Adobe Photoshop
7 Color File Format"; GIMP's gimppalette-load.c for grey, which counts ink: 10000 is black.
"""

from __future__ import annotations

import colorsys
import struct

from toonset.errors import PaletteError
from toonset.palette.formats.cie_lab import rgb_from_lab
from toonset.palette.names import RGB, NamedColor, clean_name, level, no_cmyk, within

CMYK_SPACES = (2, 9)
BOOKS = {3: "Pantone", 4: "Focoltone", 5: "Trumatch", 6: "Toyo", 10: "HKS", 12: "DIC"}
FULL, FULL_GRAY = 65535, 10000


def read_aco(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours, with names where the file has them.

    Raises:
        PaletteError: not an .aco, cut off, CMYK, an ink book's colour, or not a colour.
    """
    version, count = _head(data, where)
    end = 4 + 10 * count
    if version == 1 and data[end : end + 2] == b"\0\2":
        return _named_colors(data[end:], where)
    if version == 2:
        return _named_colors(data, where)
    if version != 1:
        raise PaletteError(f"{where}: is of version {version}, 1 or 2 is needed; export it again")
    return [
        NamedColor(_rgb(words, f"{where}: swatch {i + 1}"))
        for i in range(count)
        for words in [_words(data, 4 + 10 * i, i + 1, where)]
    ]


def _named_colors(data: bytes, where: str) -> list[NamedColor]:
    _, count = _head(data, where)
    colors, offset = [], 4
    for number in range(1, count + 1):
        words = _words(data, offset, number, where)
        length = data[offset + 10 : offset + 14]
        end = offset + 14 + 2 * int.from_bytes(length, "big")
        if len(length) < 4 or end > len(data):
            raise _cut_off(number, where)
        name = clean_name(data[offset + 14 : end].decode("utf-16-be", "replace").split("\0")[0])
        colors.append(NamedColor(_rgb(words, f"{where}: swatch {number} {name!r}"), name))
        offset = end
    return colors


def _head(data: bytes, where: str) -> tuple[int, int]:
    if len(data) < 4:
        raise _cut_off(1, where)
    version, count = struct.unpack_from(">HH", data)
    return version, count


def _words(data: bytes, offset: int, number: int, where: str) -> tuple[int, ...]:
    if offset + 10 > len(data):
        raise _cut_off(number, where)
    return struct.unpack_from(">5H", data, offset)


def _cut_off(number: int, where: str) -> PaletteError:
    return PaletteError(f"{where}: is cut off in swatch {number}; export it again")


def _rgb(words: tuple[int, ...], where: str) -> RGB:
    space, first, second, third, _ = words
    if space == 0:  # the high byte, as Apple does: right for writers of v * 256 and v * 257
        return first >> 8, second >> 8, third >> 8
    if space == 1:
        hue, saturation, brightness = (part / FULL for part in (first, second, third))
        red, green, blue = colorsys.hsv_to_rgb(hue, saturation, brightness)
        return round(255 * red), round(255 * green), round(255 * blue)
    if space == 7:
        a, b = (struct.unpack(">h", struct.pack(">H", part))[0] / 100 for part in (second, third))
        return rgb_from_lab(
            within(first / 100, 0, 100, where),
            within(a, -128, 128, where),
            within(b, -128, 128, where),
        )
    if space == 8:
        gray = level(1 - within(first, 0, FULL_GRAY, where) / FULL_GRAY, where)
        return gray, gray, gray
    if space in CMYK_SPACES:
        raise no_cmyk(where)
    raise PaletteError(
        f"{where}: is of colour space {space} ({BOOKS.get(space, 'unknown')}); RGB, HSB, Lab or "
        "grey is needed; convert it to RGB in Photoshop, then export again"
    )
