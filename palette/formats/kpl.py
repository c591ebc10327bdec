"""Krita's .kpl: a zip with colorset.xml, colours in any of Krita's colour spaces.

Only colorset.xml is read, by name and into memory: nothing is unpacked, so no path in the archive
matters; its size and ratio are capped; a document type is refused, so no entity can expand.
Source: Krita manual, "The Krita Palette format KPL"; Krita's KoColorSet.cpp.
"""

from __future__ import annotations

import io
import math
import re
import struct
import xml.etree.ElementTree as ElementTree
import zipfile
import zlib
from collections.abc import Iterator

import numpy as np

from toonset.errors import PaletteError
from toonset.palette.formats.cie_lab import rgb_from_lab, rgb_from_linear
from toonset.palette.names import RGB, NamedColor, clean_name, level, no_cmyk, one_line, within

COLORSET = "colorset.xml"
MAX_MEMBERS = 64  # two XML files and a profile per colour space
MAX_BYTES = 8 * 2**20  # of the archive: print profiles fill most of it
MAX_XML = 2**20
MAX_RATIO = 200  # text of colours packs about 10 to 1, a bomb 1000 to 1
PLAIN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
BROKEN = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, RuntimeError, ValueError,
    LookupError, OverflowError, NotImplementedError,
)  # fmt: skip
SRGB = re.compile(r"|srgb( built-in|.*srgbtrc(\.icc)?| iec61966-2[-.]1)?", re.IGNORECASE)
LINEAR = re.compile(r"(sc|s)rgb(-elle-v\d-g10(\.icc)?| \(linear\))", re.IGNORECASE)
PLACE = re.compile(r"\d{1,6}", re.ASCII)
GRAY = re.compile(r"|gr[ae]y(.*srgbtrc(\.icc)?)?", re.IGNORECASE)


def read_kpl(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours as Krita shows them: those outside groups first, row by row.

    Raises:
        PaletteError: not a .kpl, damaged, too large, or a colour space other than sRGB (also
            linear), Lab and grey.
    """
    root = _root(data, where)
    version = root.get("version", "")
    groups = [root, *root.findall("Group")]
    entries = [entry for group in groups for entry in _rows(group)]
    return [_color(entry, version, where) for entry in entries]


def kpl_title(data: bytes) -> str:
    """Return the palette's name in Krita; "" if it has none."""
    return clean_name(_root(data, "palette").get("name", ""))


def _root(data: bytes, where: str) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(_colorset(data, where))
    except ElementTree.ParseError as error:
        raise PaletteError(
            f"{where}: {COLORSET} is damaged ({one_line(str(error))}); export it again"
        ) from error
    if root.tag.lower() != "colorset":
        raise PaletteError(f"{where}: {COLORSET} holds no palette; export it from Krita again")
    return root


def _colorset(data: bytes, where: str) -> str:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            text = _member(archive, where).decode("utf-8")
    except BROKEN as error:
        raise PaletteError(
            f"{where}: is a damaged archive ({type(error).__name__}); export it from Krita again"
        ) from error
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise PaletteError(
            f"{where}: {COLORSET} has a document type, no palette has one; export it again"
        )
    return text


def _member(archive: zipfile.ZipFile, where: str) -> bytes:
    members = archive.infolist()
    found = [member for member in members if member.filename == COLORSET]
    if len(members) > MAX_MEMBERS or len(found) != 1:
        raise PaletteError(
            f"{where}: is an archive of {len(members)} files with {len(found)} {COLORSET}, a Krita "
            "palette has one; in Krita export the palette as .kpl"
        )
    packed, size = found[0].compress_size, found[0].file_size
    if size > min(MAX_XML, MAX_RATIO * max(packed, 1024)):
        raise PaletteError(
            f"{where}: {COLORSET} unpacks to {size} bytes, no palette is that large; export it "
            "again"
        )
    if found[0].compress_type not in PLAIN or found[0].flag_bits & 1:
        raise PaletteError(
            f"{where}: {COLORSET} is packed in another way than Krita's; export again"
        )
    with archive.open(found[0]) as member:
        return member.read(MAX_XML + 1)


def _rows(group: ElementTree.Element) -> list[ElementTree.Element]:
    """Return a group's entries row by row, as they stand in Krita's grid; its files do not."""
    return sorted(group.findall("ColorSetEntry"), key=_place)


def _place(entry: ElementTree.Element) -> tuple[int, int]:
    grid = entry.find("Position")
    words = ("", "") if grid is None else (grid.get("row", ""), grid.get("column", ""))
    row, column = (int(word) if PLACE.fullmatch(word) else 0 for word in words)
    return row, column


def _color(entry: ElementTree.Element, version: str, where: str) -> NamedColor:
    name = clean_name(entry.get("name", ""))
    where = f"{where}: colour {name!r}"
    value = next((child for child in entry if child.tag != "Position"), None)
    if value is None:
        raise PaletteError(f"{where}: has no value; export the palette from Krita again")
    return NamedColor(_rgb(value, version, where), "" if name == "Untitled" else name)


def _rgb(value: ElementTree.Element, version: str, where: str) -> RGB:
    kind, space = value.tag, value.get("space", "")
    if kind == "CMYK":
        raise no_cmyk(where)
    if kind == "sRGB" or (kind == "RGB" and SRGB.fullmatch(space)):
        red, green, blue = (level(part, where) for part in _numbers(value, "rgb"))
        return red, green, blue
    if kind == "RGB" and LINEAR.fullmatch(space):
        parts = [within(part, 0, 1, where) for part in _numbers(value, "rgb")]
        return rgb_from_linear(np.array(parts))
    if kind == "Gray" and GRAY.fullmatch(space):
        gray = level(next(_numbers(value, "g")), where)
        return gray, gray, gray
    if kind == "Lab" and version != "1.0":  # Krita 4 wrote Lab in another range
        lightness, a, b = _numbers(value, "Lab")
        return rgb_from_lab(
            within(lightness, 0, 100, where),
            within(a, -128, 128, where),
            within(b, -128, 128, where),
        )
    raise PaletteError(
        f"{where}: is in the colour space {clean_name(f'{kind} {space}')!r}; sRGB, Lab or grey is "
        "needed; in Krita convert it to sRGB, then export again"
    )


def _numbers(value: ElementTree.Element, keys: str) -> Iterator[float]:
    for key in keys:
        try:
            yield float(value.get(key, "nan"))
        except ValueError:
            yield math.nan  # refused with the range that is needed
