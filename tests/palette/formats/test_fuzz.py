"""Damaged and hostile palette files: read, or refused in one line; nothing is written."""

import io
import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from toonset.errors import PaletteError
from toonset.palette.formats.registry import encode_palette, parse_named_colors
from toonset.palette.formats.schema import read_palette_json
from toonset.palette.palette import MAX_COLORS, ContourColor, DroppedColor, Palette, PaletteColor

PALETTE = Palette(
    tuple(PaletteColor((40 * i, 200 - 30 * i, 17 * i), 0.15, f"colour {i}") for i in range(6)),
    "rule",
    (DroppedColor((1, 2, 3), 0.01, "black", 0.1),),
    ("a warning",),
    ContourColor((0, 0, 0), 0.05, 0.0, "black"),
)
XML = (
    '<ColorSet version="2.0" name="n" columns="8"><ColorSetEntry name="a" bitdepth="U8">'
    '<RGB r="1" g="0.5" b="0" space="sRGB-elle-V2-srgbtrc.icc"/><Position row="0" column="0"/>'
    '</ColorSetEntry><Group name="g"><ColorSetEntry name="b"><Lab L="50" a="-40" b="20"/>'
    "</ColorSetEntry></Group></ColorSet>"
)


def kpl(
    xml: bytes, packing: int = zipfile.ZIP_DEFLATED, members: int = 1, name: str = "colorset.xml"
) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", packing) as archive:
        archive.writestr(name, xml)
        for i in range(members):
            archive.writestr(f"../../out{i}.icc", b"outside")
    return packed.getvalue()


def aco(version: int) -> bytes:
    name = (3).to_bytes(4, "big") + "ab\0".encode("utf-16-be") if version == 2 else b""
    words = [(0, 0xFFFF, 0, 257, 0), (1, 9, 9, 9, 0), (7, 5000, 61000, 2000, 0), (8, 5000, 0, 0, 0)]
    colors = b"".join(struct.pack(">5H", *row) + name for row in words)
    return struct.pack(">HH", version, len(words)) + colors


SEEDS = {
    "gimp.gpl": encode_palette(PALETTE, ".gpl"),
    "aseprite.gpl": b"GIMP Palette\nChannels: RGBA\n#\n1 2 3 0 none\n9 8 7 255 some\n",
    "adobe.ase": encode_palette(PALETTE, ".ase"),
    "one.aco": aco(1),
    "both.aco": aco(1) + aco(2),
    "jasc.pal": b"JASC-PAL\r\n0100\r\n2\r\n1 2 3\r\n4 5 6\r\n",
    "riff.pal": b"RIFF\x20\0\0\0PAL data\x0c\0\0\0\0\x03\2\0" + bytes(range(8)),
    "krita.kpl": kpl(XML.encode()),
    "list.json": b'["#aabbcc", {"hex": "#123456", "name": "x"}]',
    "palette.json": encode_palette(PALETTE, ".json"),
    "lospec.hex": encode_palette(PALETTE, ".hex"),
    "paint.txt": b";paint.net Palette File\r\nFFAABBCC\r\n;x\r\n00112233\r\n80445566\r\n",
}
MUTATIONS = 84  # of each seed
LENGTHS = (b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\0\0\0\0", b"\x7f\xc0\0\0", b"\xff\x80\0\0")


def flip(data: bytearray, rng: np.random.Generator) -> None:
    for place in rng.integers(0, len(data), rng.integers(1, 9)).tolist():
        data[place] ^= 1 << int(rng.integers(8))


def cut(data: bytearray, rng: np.random.Generator) -> None:
    del data[int(rng.integers(0, len(data))) :]


def remove(data: bytearray, rng: np.random.Generator) -> None:
    start = int(rng.integers(0, len(data)))
    del data[start : start + int(rng.integers(1, 12))]


def insert(data: bytearray, rng: np.random.Generator) -> None:
    start = int(rng.integers(0, len(data)))
    data[start:start] = rng.bytes(int(rng.integers(1, 12)))


def lie(data: bytearray, rng: np.random.Generator) -> None:
    """Put a huge count, a zero or a float that is no number somewhere."""
    start = int(rng.integers(0, len(data)))
    data[start : start + 4] = LENGTHS[int(rng.integers(len(LENGTHS)))]


def repeat(data: bytearray, rng: np.random.Generator) -> None:
    start, length = int(rng.integers(0, len(data))), int(rng.integers(1, 40))
    data[start:start] = data[start : start + length] * int(rng.integers(1, 60))


def graft(data: bytearray, rng: np.random.Generator) -> None:
    """Put another format's beginning in front of the rest."""
    other = list(SEEDS.values())[int(rng.integers(len(SEEDS)))]
    count = int(rng.integers(1, 16))
    data[:count] = other[:count]


MUTATORS: tuple[Callable[[bytearray, np.random.Generator], None], ...] = (
    flip, cut, remove, insert, lie, repeat, graft
)  # fmt: skip


def refused(read: Callable[[], object], file: Path) -> bool:
    """Say whether a file was refused as it must be: in one printable line that names it."""
    try:
        read()
    except PaletteError as error:
        line = str(error)
        assert line.startswith(f"{file}: "), line
        assert line.isprintable(), line
        assert len(line) < len(str(file)) + 300, line
        return True
    return False


def check(data: bytes, file: Path) -> bool:
    file.write_bytes(data)
    before = sorted(file.parents[2].rglob("*"))
    was_refused = refused(lambda: parse_named_colors(str(file)), file)
    if file.name == "palette.json":
        refused(lambda: read_palette_json(file), file)
    assert sorted(file.parents[2].rglob("*")) == before
    assert file.read_bytes() == data
    return was_refused


def place(tmp_path: Path, name: str) -> Path:
    folder = tmp_path / "in" / "ner"
    folder.mkdir(parents=True)
    return folder / name


@pytest.mark.parametrize("name", SEEDS)
def test_mutated_palettes_are_read_or_refused(name: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(sorted(SEEDS).index(name))
    file = place(tmp_path, name)
    assert not check(SEEDS[name], file)
    outcomes = []
    for number in range(MUTATIONS):
        data = bytearray(SEEDS[name])
        for _ in range(int(rng.integers(1, 3))):
            MUTATORS[number % len(MUTATORS)](data, rng)
            data = data or bytearray(b"\n")
        outcomes.append(check(bytes(data), file))
    assert any(outcomes)


def test_mutated_content_of_krita_palettes(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    file = place(tmp_path, "k.kpl")
    outcomes = []
    for number in range(MUTATIONS):
        xml = bytearray(XML.encode())
        MUTATORS[number % 6](xml, rng)
        outcomes.append(check(kpl(bytes(xml)), file))
    assert any(outcomes)
    assert not all(outcomes)


STRANGE: tuple[Any, ...] = (
    None, True, -1, 0, 256, 1e300, 2**70, "", "#12", "\ud800\x1b", "x" * 5000, [], {}, [[]],
    {"hex": "#123"}, ["#123456"] * 300, float("nan"), float("-inf"),
)  # fmt: skip


def places(value: Any) -> list[tuple[Any, Any]]:
    """Return every container with every key in it."""
    if not isinstance(value, (dict, list)):
        return []
    keys = list(value) if isinstance(value, dict) else list(range(len(value)))
    return [(value, key) for key in keys] + [p for key in keys for p in places(value[key])]


def test_strange_values_everywhere_in_palette_json(tmp_path: Path) -> None:
    file = place(tmp_path, "palette.json")
    count = len(places(json.loads(SEEDS["palette.json"])))
    outcomes = []
    for number in range(2 * count):
        content = json.loads(SEEDS["palette.json"])
        container, key = places(content)[number % count]
        container[key] = STRANGE[number % len(STRANGE)]
        outcomes.append(check(json.dumps(content).encode(), file))
    assert any(outcomes)
    assert not all(outcomes)


def gpl_of(count: int) -> bytes:
    rows = "".join(f"{i % 256} {i // 256} 0\n" for i in range(count))
    return f"GIMP Palette\n{rows}".encode()


def encrypted() -> bytes:
    return SEEDS["krita.kpl"].replace(b"PK\1\2\x14\3\x14\0\0\0", b"PK\1\2\x14\3\x14\0\1\0")


LAUGHS = "".join(f'<!ENTITY l{i} "{10 * f"&l{i - 1};"}">' for i in range(1, 10))
HOSTILE = {
    "bomb.kpl": kpl(b" " * 40_000_000),
    "laughs.kpl": kpl(f'<!DOCTYPE x [<!ENTITY l0 "ha">{LAUGHS}]><x>&l9;</x>'.encode()),
    "outside.kpl": kpl(XML.encode(), name="../colorset.xml"),
    "absolute.kpl": kpl(XML.encode(), name="/colorset.xml"),
    "lzma.kpl": kpl(XML.encode(), zipfile.ZIP_LZMA),
    "crowd.kpl": kpl(XML.encode(), members=2000),
    "encrypted.kpl": encrypted(),
    "deep.kpl": kpl(b"<a>" * 100_000 + b"</a>" * 100_000, zipfile.ZIP_STORED),
    "utf16.kpl": kpl(XML.encode("utf-16")),
    "external.kpl": kpl(b'<!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>'),
    "deep.json": b"[" * 500_000,
    "long.json": b"[" + b"1" * 100_000 + b"]",
    "many.ase": b"ASEF\0\1\0\0\xff\xff\xff\xff",
    "long.ase": b"ASEF\0\1\0\0\0\0\0\1\0\1\xff\xff\xff\xff",
    "many.aco": b"\0\1\xff\xff",
    "many.pal": b"JASC-PAL\n0100\n" + b"9" * 5000 + b"\n1 2 3\n",
    "long.pal": b"RIFF\0\0\0\0PAL \xff\xff\xff\xff\xff\xff\xff\xff",
    "none.gpl": gpl_of(0),
    "300.gpl": gpl_of(300),
    "digits.gpl": b"GIMP Palette\n" + b"9" * 5000 + b" 1 2\n",
    "superscript.gpl": "GIMP Palette\n\u00b2 1 2\n".encode(),
    "escape.hex": b"\x1b[2J\x07\n",
    "picture.ase": b"\x80\0\0\0\xe0\xa5\1\0" + bytes(200),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_palettes_are_refused(name: str, tmp_path: Path) -> None:
    assert check(HOSTILE[name], place(tmp_path, name))


def test_a_crowd_of_colours_is_counted_once_each(tmp_path: Path) -> None:
    file = place(tmp_path, "p.gpl")
    assert not check(gpl_of(MAX_COLORS) + gpl_of(MAX_COLORS)[13:], file)
    assert not check(SEEDS["krita.kpl"], place(tmp_path / "b", "p.kpl"))
