"""Read and write Adobe's .ase swatches; read Photoshop's older .aco.

Both are big-endian. ASE: "ASEF", version 1.0, number of blocks; a block is kind, length, content. A
colour's content is a UTF-16 name (its length counts the closing zero), four letters for the model,
floats, and whether it is global, spot or normal. ACO: version, number of colours, and per colour
five words: model and four values; version 2 adds a UTF-16 name. Photoshop writes both sections,
older programs one.

Sources: O. Berten, "Adobe Swatch Exchange" (selapa.net/swatches/colors/fileformats.php); J. Greely,
"Adobe Swatch Exchange file format" (dotclue.org, 2013) for Gray, Lab ranges and group ends; Adobe,
"Photoshop File Formats Specification", Color Swatches; GIMP's gimppalette-load.c for grey in ACO,
which counts ink: 10000 is black; W3C, CSS Color Module Level 4, sections 9 to 11, for L*a*b*.
"""

from __future__ import annotations

import colorsys
import struct
from collections.abc import Iterator

import numpy as np

from toonset.errors import PaletteError
from toonset.palette.colors import srgb_from_linear
from toonset.palette.formats.tones import swatches_of
from toonset.palette.names import RGB, NamedColor, clean_name, level, no_cmyk, within
from toonset.palette.palette import Palette

MAGIC = b"ASEF"
COLOR, GROUP, GROUP_END = 0x0001, 0xC001, 0xC002
NORMAL = 2  # a plain colour; 0 is global, 1 spot: these change how a print shop treats it
FLOATS = {"rgb": 3, "lab": 3, "gray": 1, "cmyk": 4}
ACO_CMYK = (2, 9)
BOOKS = {3: "Pantone", 4: "Focoltone", 5: "Trumatch", 6: "Toyo", 10: "HKS", 12: "DIC"}
FULL, FULL_GRAY = 65535, 10000

WHITE_D50 = np.array([0.3457 / 0.3585, 1.0, (1 - 0.3457 - 0.3585) / 0.3585])
LINEAR_FROM_D50 = np.array(  # Bradford adaptation to D65, then to linear sRGB
    [
        [3.1341358529, -1.6173859980, -0.4906622179],
        [-0.9787954766, 1.9162543774, 0.0334428734],
        [0.0719553926, -0.2289767598, 1.4053860351],
    ]
)
KAPPA, EPSILON = 24389 / 27, 216 / 24389  # where the cube root gives way to a line


def read_ase(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours of all groups, in the file's order.

    Raises:
        PaletteError: not an .ase, cut off, CMYK, or not a colour.
    """
    if data[4:6] == b"\xe0\xa5":
        raise PaletteError(
            f"{where}: is an Aseprite picture, not a palette; in Aseprite save its palette as .gpl"
        )
    colors = [content for kind, content in _blocks(data, where) if kind == COLOR]
    return [_color(content, f"{where}: swatch {i}") for i, content in enumerate(colors, start=1)]


def ase_title(data: bytes) -> str:
    """Return the name of an .ase's first group; "" if it has none.

    Raises:
        PaletteError: not an .ase, or cut off.
    """
    groups = (content for kind, content in _blocks(data, "palette") if kind == GROUP)
    return next((_name(content, 2)[0] for content in groups), "")


def to_ase(palette: Palette, title: str = "toonset") -> bytes:
    """Return the palette as one group of RGB colours, tones too."""
    colors = [
        (color.name, b"RGB " + struct.pack(">3fH", *(part / 255 for part in color.rgb), NORMAL))
        for color in swatches_of(palette)
    ]
    blocks = [
        _block(GROUP, _utf16(title)),
        *(_block(COLOR, _utf16(name) + rest) for name, rest in colors),
        _block(GROUP_END, b""),
    ]
    return MAGIC + struct.pack(">HHI", 1, 0, len(blocks)) + b"".join(blocks)


def read_aco(data: bytes, where: str) -> list[NamedColor]:
    """Return the colours, with names where the file has them.

    Raises:
        PaletteError: not an .aco, cut off, CMYK, an ink book's colour, or not a colour.
    """
    version, count = struct.unpack(">HH", data[:4].ljust(4, b"\0"))
    names_follow = data[4 + 10 * count :]
    if version == 1 and names_follow[:2] == b"\0\2":
        return read_aco(names_follow, where)
    if version not in (1, 2):
        raise PaletteError(f"{where}: is of version {version}, 1 or 2 is needed; export it again")
    found: list[NamedColor] = []
    at = 4
    for number in range(1, max(count, 1) + 1):
        swatch, words = f"{where}: swatch {number}", data[at : at + 10]
        at += 10
        length = 4 + 2 * int.from_bytes(data[at : at + 4], "big") if version == 2 else 0
        if len(words) < 10 or at + length > len(data):
            raise PaletteError(f"{swatch}: is cut off; export it again")
        name = ""
        if version == 2:
            name, _ = _name(data[at : at + length], 4)
            at += length
            swatch = f"{swatch} {name!r}"
        found.append(NamedColor(_aco_rgb(struct.unpack(">5H", words), swatch), name))
    return found


def rgb_from_lab(lightness: float, a: float, b: float) -> RGB:
    """Return the 8-bit sRGB colour of L* (0 to 100), a* and b* (white D50); clipped to sRGB."""
    y = (lightness + 16) / 116
    roots = np.array([y + a / 500, y, y - b / 200])
    cubes = roots**3
    xyz = WHITE_D50 * np.where(cubes > EPSILON, cubes, (116 * roots - 16) / KAPPA)
    red, green, blue = np.rint(255 * srgb_from_linear(LINEAR_FROM_D50 @ xyz)).astype(int).tolist()
    return red, green, blue


def _blocks(data: bytes, where: str) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of all blocks; some programs announce the colours only."""
    if not data.startswith(MAGIC) or len(data) < 12:
        raise PaletteError(f"{where}: is no Adobe swatch exchange file; export the swatches again")
    major, minor, announced = struct.unpack_from(">HHI", data, 4)
    if major != 1:
        raise PaletteError(
            f"{where}: is of version {major}.{minor}, 1.0 is needed; export it again"
        )
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
    name, rest = _name(content, 2)
    model = rest[:4].decode("latin-1").strip().lower()
    where = f"{where} {name!r}"
    count = FLOATS.get(model)
    if count is None or len(rest) < 4 + 4 * count:
        raise PaletteError(
            f"{where}: has the colour model {model!r} in {len(content)} bytes; RGB, Lab or Gray is "
            "needed; export it again"
        )
    parts = struct.unpack_from(f">{count}f", rest, 4)
    if model == "cmyk":
        raise no_cmyk(where)
    if model == "lab":
        lightness, a, b = parts
        return NamedColor(_lab(100 * within(lightness, 0, 1, where), a, b, where), name)
    red, green, blue = parts if model == "rgb" else 3 * parts
    return NamedColor((level(red, where), level(green, where), level(blue, where)), name)


def _aco_rgb(words: tuple[int, ...], where: str) -> RGB:
    model, first, second, third, _ = words
    if model == 0:  # the high byte, as Apple does: right for writers of v * 256 and v * 257
        return first >> 8, second >> 8, third >> 8
    if model == 1:
        red, green, blue = colorsys.hsv_to_rgb(first / FULL, second / FULL, third / FULL)
        return round(255 * red), round(255 * green), round(255 * blue)
    if model == 7:
        a, b = struct.unpack(">2h", struct.pack(">2H", second, third))
        return _lab(first / 100, a / 100, b / 100, where)
    if model == 8:
        gray = level(1 - within(first, 0, FULL_GRAY, where) / FULL_GRAY, where)
        return gray, gray, gray
    if model in ACO_CMYK:
        raise no_cmyk(where)
    raise PaletteError(
        f"{where}: is of colour space {model} ({BOOKS.get(model, 'unknown')}); RGB, HSB, Lab or "
        "grey is needed; convert it to RGB in Photoshop, then export again"
    )


def _lab(lightness: float, a: float, b: float, where: str) -> RGB:
    a, b = (within(part, -128, 128, where) for part in (a, b))
    return rgb_from_lab(within(lightness, 0, 100, where), a, b)


def _name(content: bytes, digits: int) -> tuple[str, bytes]:
    """Return the name at the beginning, whose length has so many bytes, and what follows it."""
    end = digits + 2 * int.from_bytes(content[:digits], "big")
    text = content[digits:end].decode("utf-16-be", errors="replace")
    return clean_name(text.split("\0")[0]), content[end:]


def _block(kind: int, content: bytes) -> bytes:
    return struct.pack(">HI", kind, len(content)) + content


def _utf16(name: str) -> bytes:
    encoded = (clean_name(name) + "\0").encode("utf-16-be")
    return struct.pack(">H", len(encoded) // 2) + encoded
