"""Damaged and hostile palette files: read, or refused in one line; nothing is written."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from toonset.errors import PaletteError
from toonset.palette.formats.json import read_palette_json
from toonset.palette.formats.registry import encode_palette, parse_named_colors
from toonset.palette.options import MAX_COLORS
from toonset.palette.palette import ContourColor, DroppedColor, Palette, PaletteColor

PALETTE = Palette(
    tuple(PaletteColor((40 * i, 200 - 30 * i, 17 * i), 0.15, f"colour {i}") for i in range(6)),
    "rule",
    (DroppedColor((1, 2, 3), 0.01, "black", 0.1),),
    ("a warning",),
    ContourColor((0, 0, 0), 0.05, 0.0, "black"),
)


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


HOSTILE = {
    "long.json": b"[" + b"1" * 100_000 + b"]",
    "many.ase": b"ASEF\0\1\0\0\xff\xff\xff\xff",
    "long.ase": b"ASEF\0\1\0\0\0\0\0\1\0\1\xff\xff\xff\xff",
    "many.aco": b"\0\1\xff\xff",
    "300.gpl": gpl_of(300),
    "digits.gpl": b"GIMP Palette\n" + b"9" * 5000 + b" 1 2\n",
    "superscript.gpl": "GIMP Palette\n\u00b2 1 2\n".encode(),
    "escape.hex": b"\x1b[2J\x07\n",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_palettes_are_refused(name: str, tmp_path: Path) -> None:
    assert check(HOSTILE[name], place(tmp_path, name))


def test_a_crowd_of_colours_is_counted_once_each(tmp_path: Path) -> None:
    file = place(tmp_path, "p.gpl")
    assert not check(gpl_of(MAX_COLORS) + gpl_of(MAX_COLORS)[13:], file)
