"""Palette formats of other programs, bytes spelled out as their specifications have them."""

from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image, ImageCms

from toonset.errors import PaletteError
from toonset.palette.formats.adobe import read_aco, read_ase, rgb_from_lab, to_ase
from toonset.palette.formats.gpl import read_gpl, to_gpl
from toonset.palette.names import NamedColor
from toonset.palette.palette import Palette, PaletteColor

RED, GREY = NamedColor((255, 0, 128), "Hi"), NamedColor((128, 128, 128), "")


def ase_block(kind: str, content: str) -> bytes:
    data = bytes.fromhex(content)
    return bytes.fromhex(kind) + len(data).to_bytes(4, "big") + data


NAME = "0003 0048 0069 0000"  # length with the closing zero, H, i, zero
ASE_RGB = ase_block("0001", f"{NAME} 52474220 3F800000 00000000 3F008081 0002")
ASE_GRAY = ase_block("0001", "0001 0000 47726179 3F000000 0000")
ASE_LAB = ase_block("0001", f"{NAME} 4C414220 3F000000 C2200000 41A00000 0001")  # 0.5 -40 20
ASE_CMYK = ase_block("0001", f"{NAME} 434D594B 00000000 3F800000 3F800000 00000000 0002")
GROUP, GROUP_END = ase_block("C001", NAME), ase_block("C002", "")
ASE_HEAD = "41534546 0001 0000"


def ase(announced: int, *blocks: bytes) -> bytes:
    return bytes.fromhex(ASE_HEAD) + announced.to_bytes(4, "big") + b"".join(blocks)


def test_ase_models_groups_and_kinds() -> None:
    data = ase(5, ASE_GRAY, GROUP, ASE_RGB, ASE_LAB, GROUP_END)
    lab = NamedColor(rgb_from_lab(50, -40, 20), "Hi")
    assert read_ase(data, "f") == [GREY, RED, lab]
    assert read_ase(ase(3, ASE_GRAY, GROUP, ASE_RGB, ASE_LAB, GROUP_END), "f") == [GREY, RED, lab]
    assert read_ase(ase(1, ASE_RGB) + b"\0\0\0\0", "f") == [RED]


def test_ase_is_written_as_the_format_has_it() -> None:
    palette = Palette((PaletteColor((255, 0, 128), 1, "Hi"),), "rule")
    assert to_ase(palette, "Hi") == ase(3, GROUP, ASE_RGB, GROUP_END)


def aco_section(version: int, *colors: str) -> bytes:
    head = version.to_bytes(2, "big") + len(colors).to_bytes(2, "big")
    return head + bytes.fromhex("".join(colors))


ACO_RGB, ACO_GRAY = "0000 FFFF 0000 8080 0000", "0008 1388 0000 0000 0000"
ACO_LAB = "0007 1388 F060 07D0 0000"  # L 5000, a -4000, b 2000
ACO_HSB, ACO_CMYK = "0001 5555 FFFF FFFF 0000", "0002 0000 FFFF FFFF FFFF"
ACO_NAME, ACO_NONE = "0000 0003 0048 0069 0000", "0000 0001 0000"


def test_aco_versions_and_spaces() -> None:
    lab, green = NamedColor(rgb_from_lab(50, -40, 20)), NamedColor((0, 255, 0))
    first = aco_section(1, ACO_RGB, ACO_GRAY, ACO_LAB, ACO_HSB)
    assert read_aco(first, "f") == [NamedColor(RED.rgb), GREY, lab, green]
    second = aco_section(2, ACO_RGB + ACO_NAME, ACO_GRAY + ACO_NONE)
    assert read_aco(second, "f") == [RED, GREY]
    assert read_aco(aco_section(1, ACO_RGB, ACO_GRAY) + second, "f") == [RED, GREY]


def test_aco_levels_are_those_of_both_kinds_of_writers() -> None:
    for factor in (256, 257):  # 0xAB00 and 0xABAB
        colors = [f"0000 {factor * i:04X} {factor * i:04X} 0000 0000" for i in range(256)]
        found = [color.rgb[0] for color in read_aco(aco_section(1, *colors), "f")]
        assert found == list(range(256))
    ink = ["0008 0000 0000 0000 0000", "0008 2710 0000 0000 0000"]
    white, black = read_aco(aco_section(1, *ink), "f")
    assert (white.rgb, black.rgb) == ((255, 255, 255), (0, 0, 0))


def test_gpl_of_aseprite_with_alpha_and_gimp_names() -> None:
    text = (
        "GIMP Palette\r\nName: N\r\nChannels: RGBA\r\n#\r\n  0   0   0   0 Transparent\r\n"
        "255   0 128 255\tHi\r\n128 128 128  99 Untitled\r\n"
    )
    assert read_gpl(text.encode(), "f") == [RED, GREY]
    plain = "GIMP Palette\n# 1 2 3\n255\t0  128\tTwo\twords  4\n1 2 3 bl\u00e9\n"
    expected = [NamedColor((255, 0, 128), "Two words 4"), NamedColor((1, 2, 3), "bl\u00e9")]
    assert read_gpl(plain.encode("utf-8"), "f") == expected
    assert read_gpl(plain.encode("latin-1"), "f") == expected


def test_our_gpl_has_what_krita_demands() -> None:
    text = to_gpl(Palette((PaletteColor((1, 2, 3), 1, ""),), "rule"), "")
    first, second, third, *_ = text.splitlines()
    assert (first, second[:5], third) == ("GIMP Palette", "Name:", "Columns: 1")  # it divides by it
    assert len(text) >= 50


REFUSED: list[tuple[Callable[[bytes, str], list[NamedColor]], bytes, str]] = [
    (read_ase, ase(1, ASE_CMYK), r"swatch 1 'Hi': is CMYK, .* convert the swatches to RGB"),
    (read_ase, ase(3, ASE_RGB), "is cut off in block 2 of 3"),
    (read_ase, ase(1, ASE_RGB[:-3]), "is cut off in block 1 of 1"),
    (read_ase, ase(2**32 - 1, ASE_RGB), "is cut off in block 2 of 4294967295"),
    (read_ase, b"ASEF\0\2\0\0\0\0\0\1", r"is of version 2\.0, 1\.0 is needed"),
    (read_ase, ase(1, ase_block("0001", f"{NAME} 52474220 7FC00000" + 10 * "0")), "'rgb' in 21"),
    (read_ase, ase(1, ase_block("0001", f"{NAME} 58595A20" + 28 * "0")), "colour model 'xyz'"),
    (read_ase, ase(1, ASE_RGB.replace(b"\x3f\x80", b"\x7f\xc0")), "value nan, 0 to 1 is needed"),
    (read_ase, ase(1, ASE_RGB.replace(b"\x3f\x80", b"\x40\x00")), "value 2, 0 to 1 is needed"),
    (read_ase, b"\x80\x01\0\0\xe0\xa5\1\0" + bytes(120), "is an Aseprite picture, not a palette"),
    (read_aco, aco_section(1, ACO_RGB)[:-1], "swatch 1: is cut off"),
    (read_aco, aco_section(2, ACO_RGB + "FFFFFFFF"), "swatch 1: is cut off"),
    (read_aco, aco_section(1, ACO_CMYK), "swatch 1: is CMYK"),
    (read_aco, aco_section(2, "0003" + 16 * "0" + ACO_NAME), r"'Hi': is of colour space 3 \(Pan"),
    (read_aco, aco_section(1, "0008 FFFF" + 12 * "0"), "value 65535, 0 to 10000"),
    (read_aco, b"\0\3\0\1", "is of version 3, 1 or 2 is needed"),
    (read_aco, b"\0\1", "is cut off"),
]


@pytest.mark.parametrize(("read", "data", "fragment"), REFUSED)
def test_what_is_refused(
    read: Callable[[bytes, str], list[NamedColor]], data: bytes, fragment: str
) -> None:
    with pytest.raises(PaletteError, match=fragment) as caught:
        read(data, "my file")
    assert str(caught.value).startswith("my file: ")


def test_lab_agrees_with_little_cms() -> None:
    rng = np.random.default_rng(3)
    rgb = rng.integers(0, 256, (400, 1, 3), dtype=np.uint8)
    srgb, lab = ImageCms.createProfile("sRGB"), ImageCms.createProfile("LAB")
    relative = ImageCms.Intent.RELATIVE_COLORIMETRIC
    exactly = ImageCms.Flags.NOOPTIMIZE  # its tables are off by up to 30 levels
    coded = ImageCms.profileToProfile(  # colours within sRGB, so that nothing is clipped
        Image.fromarray(rgb), srgb, lab, renderingIntent=relative, outputMode="LAB", flags=exactly
    )
    assert coded is not None
    back = ImageCms.profileToProfile(
        coded, lab, srgb, renderingIntent=relative, outputMode="RGB", flags=exactly
    )
    expected = np.asarray(back, dtype=int).reshape(-1, 3)
    values = np.asarray(coded).reshape(-1, 3)
    ours = [
        rgb_from_lab(float(code[0]) / 2.55, *code[1:].astype(np.int8).tolist()) for code in values
    ]
    off = np.abs(np.array(ours) - expected)
    assert off.max() <= 1
    assert off.mean() < 0.02  # both round
    assert rgb_from_lab(0, 0, 0) == (0, 0, 0)
    assert rgb_from_lab(100, 0, 0) == (255, 255, 255)
    assert rgb_from_lab(50, 128, -128)[1] == 0  # outside sRGB: clipped
