"""Adobe Swatch Exchange (.ase): Illustrator, Photoshop, InDesign, Affinity, Procreate.

Big-endian. "ASEF", version 1.0, number of blocks; a block is kind, length, content. A colour's
content is a UTF-16 name (its length counts the closing zero), four letters for the colour model,
floats, and whether it is global, spot or normal. Adobe has published no specification; sources:
O. Berten, "Adobe Swatch Exchange" (selapa.net/swatches/colors/fileformats.php); J. Greely,
"Adobe Swatch Exchange file format" (dotclue.org, 2013) for Gray, Lab ranges and group ends.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

from toonset.errors import PaletteError
from toonset.palette.formats.cie_lab import rgb_from_lab
from toonset.palette.formats.tones import swatches_of
from toonset.palette.names import RGB, NamedColor, clean_name, level, no_cmyk, within
from toonset.palette.palette import Palette

MAGIC = b"ASEF"
COLOR, GROUP, GROUP_END = 0x0001, 0xC001, 0xC002
NORMAL = 2  # a plain colour; 0 is global, 1 spot: these change how a print shop treats it
FLOATS = {"rgb": 3, "lab": 3, "gray": 1, "cmyk": 4}


def read_ase(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours of all groups, in the file's order.

    Raises:
        PaletteError: not an .ase, cut off, CMYK, or not a colour.
    """
    if data[4:6] == b"\xe0\xa5":
        raise PaletteError(
            f"{where}: is an Aseprite picture, not a palette; in Aseprite save its palette as .gpl"
        )
    if not data.startswith(MAGIC) or len(data) < 12:
        raise PaletteError(f"{where}: is no Adobe swatch exchange file; export the swatches again")
    major, minor, announced = struct.unpack_from(">HHI", data, 4)
    if major != 1:
        raise PaletteError(
            f"{where}: is of version {major}.{minor}, 1.0 is needed; export it again"
        )
    blocks = list(_blocks(data, announced, where))
    colors = [content for kind, content in blocks if kind == COLOR]
    return [_color(content, f"{where}: swatch {i}") for i, content in enumerate(colors, start=1)]


def ase_title(data: bytes) -> str:
    """Return the name of an .ase's first group; "" if it has none."""
    blocks = _blocks(data, struct.unpack_from(">I", data, 8)[0], "palette")
    return next((_name(content)[0] for kind, content in blocks if kind == GROUP), "")


def to_ase(palette: Palette, title: str = "toonset") -> bytes:
    """Return the palette as one group of RGB colours, tones too."""
    blocks = [
        _block(GROUP, _utf16(title)),
        *(
            _block(
                COLOR,
                _utf16(color.name)
                + b"RGB "
                + struct.pack(">3fH", *(part / 255 for part in color.rgb), NORMAL),
            )
            for color in swatches_of(palette)
        ),
        _block(GROUP_END, b""),
    ]
    return MAGIC + struct.pack(">HHI", 1, 0, len(blocks)) + b"".join(blocks)


def _blocks(data: bytes, announced: int, where: str) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of all blocks; some programs announce the colours only."""
    offset, count = 12, 0
    while count < announced or data[offset : offset + 2] in (b"\x00\x01", b"\xc0\x01", b"\xc0\x02"):
        head = data[offset : offset + 6]
        kind, length = struct.unpack(">HI", head) if len(head) == 6 else (0, len(data))
        if offset + 6 + length > len(data):
            raise PaletteError(
                f"{where}: is cut off in block {count + 1} of {announced}; export it again"
            )
        yield kind, data[offset + 6 : offset + 6 + length]
        offset, count = offset + 6 + length, count + 1


def _color(content: bytes, where: str) -> NamedColor:
    name, rest = _name(content)
    model = rest[:4].decode("latin-1").strip().lower()
    where = f"{where} {name!r}"
    count = FLOATS.get(model)
    if count is None or len(rest) < 4 + 4 * count:
        raise PaletteError(
            f"{where}: has the colour model {model!r} in {len(content)} bytes; RGB, Lab or Gray is "
            "needed; export it again"
        )
    return NamedColor(_rgb(model, struct.unpack_from(f">{count}f", rest, 4), where), name)


def _name(content: bytes) -> tuple[str, bytes]:
    """Return the name that a block begins with, and what follows it."""
    end = 2 + 2 * int.from_bytes(content[:2], "big")
    text = content[2:end].decode("utf-16-be", errors="replace")
    return clean_name(text.split("\0")[0]), content[end:]


def _rgb(model: str, parts: tuple[float, ...], where: str) -> RGB:
    if model == "cmyk":
        raise no_cmyk(where)
    if model == "lab":
        lightness, a, b = parts
        return rgb_from_lab(
            100 * within(lightness, 0, 1, where),
            within(a, -128, 128, where),
            within(b, -128, 128, where),
        )
    red, green, blue = parts if model == "rgb" else 3 * parts
    return level(red, where), level(green, where), level(blue, where)


def _block(kind: int, content: bytes) -> bytes:
    return struct.pack(">HI", kind, len(content)) + content


def _utf16(name: str) -> bytes:
    encoded = (clean_name(name) + "\0").encode("utf-16-be")
    return struct.pack(">H", len(encoded) // 2) + encoded
