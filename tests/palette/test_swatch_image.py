"""The picture of a palette: every colour is on it, and text stays where it belongs."""

import numpy as np
import pytest

from toonset.palette.names import RGB
from toonset.palette.palette import ContourColor, DroppedColor, Palette, PaletteColor
from toonset.palette.swatch_image import LARGE, PAGE, SMALL, broken, draw_swatches, drawable

LONG = "Hair shadow under the left ear, in the light of the evening"


def palette_of(colors: int, dropped: int, name: str = "dark green") -> Palette:
    codes = np.random.default_rng(colors).choice(2**24, colors + dropped, replace=False).tolist()
    rgb: list[RGB] = [(code >> 16, code >> 8 & 255, code & 255) for code in codes]
    return Palette(
        tuple(PaletteColor(c, 0.9 / colors, name) for c in rgb[:colors]),
        "rule",
        tuple(DroppedColor(c, 0.001, name, 0.1) for c in rgb[colors:]),
        (),
        ContourColor((1, 2, 3), 0.05, 0.0, name),
    )


@pytest.mark.parametrize(
    ("colors", "dropped", "name"),
    [(1, 0, "dark green"), (3, 2, ""), (8, 11, "red"), (20, 1, LONG), (255, 40, "x" * 64)],
)
def test_every_colour_has_a_block(colors: int, dropped: int, name: str) -> None:
    palette = palette_of(colors, dropped, name)
    picture = draw_swatches(palette)
    codes, counts = np.unique(
        picture.reshape(-1, 3).astype(np.int64) @ [65536, 256, 1], return_counts=True
    )
    area = dict(zip(codes.tolist(), counts.tolist(), strict=True))
    for size, kept in [(LARGE, palette.colors), (SMALL, palette.dropped)]:
        for color in kept:
            red, green, blue = color.rgb
            block = size.block_wh[0] * size.block_wh[1]
            assert area[red << 16 | green << 8 | blue] > 0.93 * block  # without edge and corners


@pytest.mark.parametrize("name", ["dark green", LONG, "W" * 64, "W" * 30 + " " + "W" * 30])
def test_text_keeps_to_its_card(name: str) -> None:
    palette = Palette(palette_of(8, 0, name).colors, "rule")  # four columns
    picture = draw_swatches(palette)
    height, width = picture.shape[:2]
    page = (picture == PAGE).all(axis=2)
    assert page[:, :20].all()
    assert page[:, width - 20 :].all()
    assert page[height - 20 :].all()
    below_strip = page[80:]
    gaps = below_strip.all(axis=0)
    starts = np.flatnonzero(np.diff(gaps.astype(int)) == -1)
    assert len(starts) == 4  # a clear gap before every column


def test_the_strip_shows_shares() -> None:
    colors = (PaletteColor((255, 0, 0), 0.6, "a"), PaletteColor((0, 0, 255), 0.2, "b"))
    row = draw_swatches(Palette(colors, "rule"))[40]
    assert (
        abs(int((row == (255, 0, 0)).all(axis=1).sum()) / 3 - (row == (0, 0, 255)).all(1).sum()) < 3
    )


def test_names_that_do_not_fit() -> None:
    assert broken("dark green", LARGE.font, 192) == ("dark green",)
    assert broken("", LARGE.font, 192) == ()
    first, second = broken(LONG, LARGE.font, 192)
    assert LONG.startswith(first)
    assert second.endswith("...")
    for line in (first, second, *broken("W" * 64, SMALL.font, 132)):
        assert LARGE.font.getlength(line) <= 192
    assert drawable("été \u5c71\n") == "ete ?"
