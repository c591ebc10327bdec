"""Palette files: what people type and other programs write comes in, nonsense is refused."""

import json
from pathlib import Path
from typing import Any

import pytest

from toonset.errors import PaletteError
from toonset.palette.files import parse_colors, read_palette_json, to_gpl, to_json
from toonset.palette.palette import DroppedColor, Palette, PaletteColor

PALETTE = Palette(
    (PaletteColor((200, 30, 40), 0.75, "red"), PaletteColor((1, 2, 3), 0.2, "black")),
    "at least 0.05",
    (DroppedColor((0, 255, 0), 0.05, "green", 0.25),),
    ("a warning",),
)


@pytest.mark.parametrize(
    "text",
    [
        "#aabbcc,#123",
        "#AABBCC #112233",
        " aabbcc, 123 ",
        "#abc,#123",
        "#abc;#123",
        "#abc,#123,#abc",
    ],
)
def test_typed_lists(text: str) -> None:
    assert parse_colors(text).tolist() == [[0xAA, 0xBB, 0xCC], [0x11, 0x22, 0x33]]


FILES = {
    "a.gpl": "GIMP Palette\nName: x\nColumns: 4\n# c\n170 187 204\tgrey\n 17  34  51\n\n",
    "b.gpl": "GIMP Palette\r\n170 187 204\r\n17 34 51 Untitled\r\n",
    "c.hex": "aabbcc\n112233\n",
    "d.txt": "#AABBCC\n\n#123\n",
    "e.txt": ";paint.net Palette File\n; comment\nFFAABBCC\nFF112233\n",
    "f.json": '["#aabbcc", "#123"]',
    "g.json": '{"name": "x", "colors": ["aabbcc", "112233"]}',
    "h.json": '{"colors": [{"hex": "#aabbcc", "share": 1}, {"hex": "#112233"}]}',
    "i.HEX": "\ufeffaabbcc\r\n112233",
}


@pytest.mark.parametrize("name", FILES)
def test_palette_files(name: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_text(FILES[name])
    assert parse_colors(str(file)).tolist() == [[0xAA, 0xBB, 0xCC], [0x11, 0x22, 0x33]]


def test_our_own_files_come_back(tmp_path: Path) -> None:
    (tmp_path / "a.gpl").write_text(to_gpl(PALETTE))
    (tmp_path / "a.json").write_text(json.dumps(to_json(PALETTE)))
    for name in ("a.gpl", "a.json"):
        assert parse_colors(str(tmp_path / name)).tolist() == PALETTE.rgb.tolist()
    assert read_palette_json(tmp_path / "a.json") == PALETTE


@pytest.mark.parametrize(
    ("text", "fragment"),
    [
        ("", "colours: none given"),
        (" , ", "colours: none given"),
        ("red", "red: neither colours such as '#aabbcc,#123' nor a palette file"),
        ("#12", "colours: '#12' is no colour; write it as #rrggbb or #rgb"),
        ("#aabbcc,blue", "'blue' is no colour"),
        ("#aabbccdd", "'#aabbccdd' is no colour"),
        ("#gggggg", "'#gggggg' is no colour"),
        ("none.gpl", "none.gpl: no such file; check the name of the palette"),
        ("none.aco", "neither colours"),
        (",".join(f"#{i:06x}" for i in range(256)), "256 colours; 1 to 255 are needed"),
    ],
)
def test_typed_nonsense(text: str, fragment: str) -> None:
    with pytest.raises(PaletteError, match=fragment):
        parse_colors(text)


BAD_FILES = {
    "a.gpl": ("JASC-PAL\n0100\n", "does not begin with 'GIMP Palette'"),
    "b.gpl": ("GIMP Palette\n256 0 0\n", "line 2: '256 0 0' is no colour; three numbers"),
    "c.gpl": ("GIMP Palette\n1 2\n", "line 2: '1 2' is no colour"),
    "d.gpl": ("GIMP Palette\n-1 2 3\n", "line 2: '-1 2 3' is no colour"),
    "e.gpl": ("GIMP Palette\n# nothing\n", "0 colours; 1 to 255 are needed"),
    "f.hex": ("aabbcc\nhello\n", "line 2: 'hello' is no colour"),
    "g.txt": ("FFAABBCC\n", "line 1: 'FFAABBCC' is no colour"),
    "h.json": ("{", "is no valid JSON"),
    "i.json": ('{"x": 1}', "has no list of colours"),
    "j.json": ('[1, "#fff"]', "'1' is no colour"),
    "k.json": ('{"colors": [{"rgb": 1}]}', "'None' is no colour"),
    "l.json": ("[]", "0 colours; 1 to 255 are needed"),
    "m.json": ("[" * 100_000, "is no valid JSON"),
    "n.hex": ("aa\0bb", "is no text"),
    "o.hex": ("", r"is empty \(0 bytes\)"),
    "p.txt": ("aabbcc\n" * 200_000, "1 MB, at most 1 MB is read"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files(name: str, tmp_path: Path) -> None:
    text, fragment = BAD_FILES[name]
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(PaletteError, match=fragment) as caught:
        parse_colors(str(file))
    assert str(caught.value).startswith(str(file))


GOOD: dict[str, Any] = to_json(PALETTE)
COLOR: dict[str, Any] = GOOD["colors"][0]


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        ([], "schema 'list', 'toonset-palette/1' is needed"),
        (GOOD | {"schema": "toonset-palette/9"}, "schema 'toonset-palette/9'"),
        ({k: v for k, v in GOOD.items() if k != "colors"}, r"is damaged \(KeyError: 'colors'\)"),
        (GOOD | {"colors": []}, "0 colours; 1 to 255 are needed"),
        (GOOD | {"colors": [COLOR] * 256}, "256 colours"),
        (GOOD | {"colors": 5}, "is damaged"),
        (GOOD | {"colors": [COLOR | {"hex": "#12"}]}, "'#12' is no colour"),
        (GOOD | {"colors": [COLOR | {"share": 7}]}, "share 7.0 is not within 0 to 1"),
        (GOOD | {"colors": [COLOR | {"share": "x"}]}, "is damaged"),
        (GOOD | {"dropped": [COLOR]}, "KeyError: 'oklab_cost'"),
    ],
)
def test_bad_palette_json(content: object, fragment: str, tmp_path: Path) -> None:
    file = tmp_path / "palette.json"
    file.write_text(json.dumps(content))
    with pytest.raises(PaletteError, match=fragment) as caught:
        read_palette_json(file)
    assert str(caught.value).startswith(str(file))
