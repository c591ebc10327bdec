"""Palettes that people type or name: read by content, ours come back, nonsense refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL.GimpPaletteFile import GimpPaletteFile

from toonset.errors import PaletteError
from toonset.palette.formats.gpl import to_gpl
from toonset.palette.formats.registry import (
    WRITTEN,
    encode_palette,
    names_tones,
    palette_names,
    parse_colors,
    parse_named_colors,
)
from toonset.palette.names import NamedColor
from toonset.palette.options import MAX_COLORS
from toonset.palette.palette import Palette, PaletteColor, Tone


def test_typed_lists() -> None:
    for text in ("#aabbcc,#123", "#AABBCC #112233", " aabbcc, 123 ", "#abc;#123", "#abc,#123,#abc"):
        assert parse_colors(text).tolist() == [[0xAA, 0xBB, 0xCC], [0x11, 0x22, 0x33]], text
    assert parse_colors("white").tolist() == [[255] * 3]
    assert parse_colors("#123 Black").tolist() == [[0x11, 0x22, 0x33], [0] * 3]


FILES = {
    "a.gpl": "GIMP Palette\nName: x\nColumns: 4\n# c\n170 187 204\tgrey\n 17  34  51\n\n",
    "b.gpl": "GIMP Palette\r\n170 187 204\r\n17 34 51 Untitled\r\n",
    "c.hex": "aabbcc\n112233\n",
    "d.txt": "#AABBCC\n\n#123\n",
    "e.txt": ";paint.net Palette File\n; comment\nFFAABBCC\n00FFFFFF\nFF112233\n",
    "f.json": '["#aabbcc", "#123"]',
    "g.json": '{"name": "x", "colors": ["aabbcc", "112233"]}',
    "h.json": '{"colors": [{"hex": "#aabbcc", "share": 1}, {"hex": "#112233"}]}',
    "i.HEX": "\ufeffaabbcc\r\n112233",
    "j.hex": "# skin and coat\naabbcc # skin\n// coat\n#112233\n",
    "k.hex": "aabbccff\n112233ff\n44556600\n",
    "l.txt": "#aabbcc80\n#112233ff\n#44556600\n",
    "p.pal": "JASC-PAL\r\n0100\r\n2\r\n170 187 204\r\n17 34 51\r\n",
    "q.pal": "JASC-PAL\n0100\n3\n170 187 204 255\n17 34 51 255\n1 2 3 0\n",
    # by content, whatever the name says
    "m.hex": ' \n["#aabbcc", "#123"]',
    "n": "aabbcc\n112233\n",
    "o.palette": "GIMP Palette\n170 187 204\n17 34 51\n",
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("name", FILES)
def test_palette_files(name: str, encoding: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_bytes(FILES[name].removeprefix("\ufeff").encode(encoding))
    assert parse_colors(str(file)).tolist() == [[0xAA, 0xBB, 0xCC], [0x11, 0x22, 0x33]]


def many(count: int) -> Palette:
    """Return a palette of different colours, of every level if there are 255, each with a name."""
    colors = ((i, 255 - i, i + 1) for i in range(count))
    named = (PaletteColor(rgb, 1 / count, f"colour {i}\u00e9") for i, rgb in enumerate(colors))
    return Palette(tuple(named), "all levels")


@pytest.mark.parametrize("extension", WRITTEN)
@pytest.mark.parametrize("count", [1, 2, 100, MAX_COLORS])
def test_what_is_written_comes_back(extension: str, count: int, tmp_path: Path) -> None:
    palette = many(count)
    file = tmp_path / f"p{extension}"
    file.write_bytes(encode_palette(palette, extension))
    named = extension != ".hex"
    assert parse_named_colors(str(file)) == tuple(
        NamedColor(color.rgb, color.name if named else "") for color in palette.colors
    )
    assert encode_palette(palette, extension) == file.read_bytes()


@pytest.mark.parametrize("extension", WRITTEN)
def test_tones_are_swatches_beside_their_paint_and_read_as_one(
    extension: str, tmp_path: Path
) -> None:
    tones = (Tone((120, 80, 40), 0.6), Tone((86, 56, 32), 0.2))
    brown = PaletteColor((120, 80, 40), 0.8, "brown", tones)
    white = PaletteColor((255, 255, 255), 0.2, "white", (Tone((255, 255, 255), 0.2),))
    black = PaletteColor((0, 0, 0), 0.1, "black", (Tone((0, 0, 0), 0.1), Tone((0, 0, 0), 0.0)))
    shaded = Palette((brown, white, black), "by hand")
    plain = Palette(tuple(replace(one, tones=()) for one in shaded.colors), "by hand")
    file = tmp_path / f"p{extension}"
    file.write_bytes(encode_palette(shaded, extension))
    np.testing.assert_array_equal(parse_colors(str(file)), shaded.rgb)
    assert names_tones(str(file)) == (extension != ".hex")
    file.write_bytes(encode_palette(plain, extension))
    assert not names_tones(str(file))
    assert "brown, shadow" in to_gpl(shaded).splitlines()[5]
    assert "black, shadow" not in to_gpl(shaded)  # the same colour twice
    sea = "GIMP Palette\n#\n0 0 9 sea, shadow\n0 0 99 sea\n"
    (tmp_path / "sea.gpl").write_text(sea)
    assert len(parse_colors(str(tmp_path / "sea.gpl"))) == 2


def test_strange_names_stay_on_their_line(tmp_path: Path) -> None:
    names = ("a\tb\nc", "", "x" * 500, "\ud800\x1b[31m", " 12 12 12 ", "Name: x", "# y")
    colors = tuple(PaletteColor((i, 0, 0), 0, name) for i, name in enumerate(names))
    for extension in WRITTEN:
        file = tmp_path / f"p{extension}"
        file.write_bytes(encode_palette(Palette(colors, "names"), extension))
        found = parse_named_colors(str(file))
        assert [color.rgb for color in found] == [color.rgb for color in colors]
        if extension != ".hex":
            assert [color.name for color in found] == [
                "a b c", "", "x" * 64, "[31m", "12 12 12", "Name: x", "# y"
            ]  # fmt: skip


def test_pillow_reads_our_gpl(tmp_path: Path) -> None:
    palette = many(200)
    file = tmp_path / "p.gpl"
    file.write_text(to_gpl(palette, "a title"), encoding="utf-8")
    with file.open("rb") as opened:
        found, mode = GimpPaletteFile(opened).getpalette()
    assert mode == "RGB"
    assert found[:600] == palette.rgb.tobytes()


def test_an_unwritten_format_is_named() -> None:
    with pytest.raises(PaletteError, match=r"\.aco: is not written; choose one of \.gpl, \.ase"):
        encode_palette(many(2), ".aco")


@pytest.mark.parametrize(
    ("text", "fragment"),
    [
        ("", "colours: none given"),
        (" , ", "colours: none given"),
        ("red", "red: neither colours such as '#aabbcc,#123,white' nor a palette file"),
        ("red\0", r"'red\\x00': neither colours"),
        ("r" * 5000, "^r{80}: neither colours"),
        ("#12", "colours: '#12' is no colour; write it as #rrggbb or #rgb"),
        ("#aabbcc,blue", "'blue' is no colour"),
        ("#aabbccdd", "'#aabbccdd' is no colour"),
        ("#gggggg", "'#gggggg' is no colour"),
        ("none.gpl", "none.gpl: no such file; check the name of the palette"),
        ("none.aco", "none.aco: no such file"),
        ("none.png", "none.png: neither colours"),
        (",".join(f"#{i:06x}" for i in range(256)), "256 colours, 1 to 255 are needed; correct it"),
    ],
)
def test_typed_nonsense(text: str, fragment: str) -> None:
    with pytest.raises(PaletteError, match=fragment):
        parse_colors(text)


BAD_FILES = {
    "a.gpl": ("hello", "does not begin with 'GIMP Palette'"),
    "b.gpl": ("GIMP Palette\n256 0 0\n", "line 2: '256 0 0' is no colour; write three numbers"),
    "c.gpl": ("GIMP Palette\n1 2\n", "line 2: '1 2' is no colour"),
    "d.gpl": ("GIMP Palette\n-1 2 3\n", "line 2: '-1 2 3' is no colour"),
    "e.gpl": ("GIMP Palette\n# nothing\n", "0 colours, 1 to 255 are needed; correct it"),
    "f.hex": ("aabbcc\nhello\n", "line 2: 'hello' is no colour"),
    "g.txt": ("FFAABBCC\n", "line 1: 'FFAABBCC' is no colour"),
    "u.txt": ("FF0000FF\n", "line 1: 'FF0000FF' is no colour; write it as #rrggbb"),
    "v.hex": ("# aabbcc\n", "line 1: write #aabbcc, without a space"),
    "w.pal": ("JASC-PAL\n0100\n3\n1 2 3\n", "announces '3' colours and has 1"),
    "x.pal": ("JASC-PAL\n0100\n1\n1 2 red\n", "line 4: '1 2 red' is no colour"),
    "y.pal": ("hello", "is no JASC palette; save it as one, or as .gpl"),
    "z.pal": ("RIFF\0\0\0\0PAL data", "is a palette of Windows; save it as JASC .pal"),
    "h.json": ("{", "is no valid JSON"),
    "i.json": ('{"x": 1}', "has no list of colours"),
    "j.json": ('[1, "#fff"]', "colour 1: '1' is no colour"),
    "k.json": ('{"colors": [{"rgb": 1}]}', "'None' is no colour"),
    "l.json": ("[]", "0 colours, 1 to 255 are needed; correct it"),
    "m.json": ("[" * 100_000, "is nested deeper than 64; write"),
    "n.hex": ("aa\0bb", "is no text"),
    "o.hex": ("", r"is empty \(0 bytes\)"),
    "p.txt": ("aabbcc\n" * 200_000, r"1\.3 MB, at most 1 MB is read"),
    "r.bin": ("\x01\x02", r"is of an unknown kind; give a palette file \(\.gpl, \.ase"),
    "s.jpg": ("hello", "line 1: 'hello' is no colour"),
    "t.gpl": ("GIMP Palette\nChannels: RGBA\n1 2 3 red\n", "four numbers from 0 to 255"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files(name: str, tmp_path: Path) -> None:
    text, fragment = BAD_FILES[name]
    file = tmp_path / name
    file.write_text(text, encoding="utf-8")
    with pytest.raises(PaletteError, match=fragment) as caught:
        parse_colors(str(file))
    assert str(caught.value).startswith(str(file))


def test_a_folder_and_a_picture_are_no_palettes(tmp_path: Path) -> None:
    (tmp_path / "p.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0")
    for place, fragment in [
        (tmp_path, "is a folder"),
        (tmp_path / "p.png", "is a PNG picture; give a palette file"),
    ]:
        with pytest.raises(PaletteError, match=fragment):
            parse_colors(str(place))


def test_palettes_are_called_by_title_file_or_place(tmp_path: Path) -> None:
    def gpl(name: str, title: str) -> str:
        (tmp_path / name).write_text(f"GIMP Palette\nName: {title}\n#\n1 2 3\tink\n")
        return str(tmp_path / name)

    given = [gpl("a.gpl", "Dusk"), "#010203", gpl("b.gpl", "toonset"), gpl("c.gpl", "original")]
    assert palette_names(given, "original") == ["Dusk", "colours 2", "b", "original 2"]
    copies = [gpl("night.gpl", "sheet"), gpl("day.gpl", "sheet"), gpl("sub.gpl", "night")]
    assert palette_names([*copies, *copies[:1]]) == ["night", "day", "night 2", "night 3"]
