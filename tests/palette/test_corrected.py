"""A palette as a person corrected it: what goes where, and that nothing else does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.palette.shaded import BOOTS, FACTOR, SKIN, TROUSERS, TUNIC, drawings
from toonset.errors import PaletteError
from toonset.palette.choice import choose_palette
from toonset.palette.corrected import BY_HAND, correct_palette
from toonset.palette.corrections import Divided, PaletteCorrections, Stroke
from toonset.palette.extract import paint_maps
from toonset.palette.names import hex_of
from toonset.palette.pixels.ink_lines import find_contours

UNLABELLED = 255


@pytest.fixture(scope="module", params=[False, True], ids=["flat", "shaded"])
def sheet(request):
    """Return pictures, their contours, palette and maps; the shaded ones in two tones."""
    pictures = [one.rgba for one in drawings(shadow=request.param, noisy=False, views=3)]
    contours = find_contours(pictures)
    found = choose_palette(pictures, contours)
    assert (found.shadow is not None) == request.param
    return pictures, contours, found, paint_maps(pictures, contours, found)


def colors_of(maps, palette):
    """Return every picture's paint, hex per pixel; "" where there is none."""
    table = np.array([hex_of(color.rgb) for color in palette.colors] + [""] * 256)[:256]
    table[UNLABELLED] = ""
    return [table[one.labels] for one in maps]


def done(sheet, strokes=(), **wanted):
    pictures, contours, found, maps = sheet
    palette, after = correct_palette(
        pictures, contours, found, PaletteCorrections(**wanted), strokes
    )
    shares = [color.share for color in palette.colors]
    assert shares == sorted(shares, reverse=True)
    assert palette.rule.endswith(BY_HAND)
    for one, old in zip(after, maps, strict=True):
        assert ((one.labels < len(palette.colors)) | (one.labels == UNLABELLED)).all()
        assert (one.tones is None) == (old.tones is None)
        if one.tones is not None:
            np.testing.assert_array_equal(one.tones == UNLABELLED, one.labels == UNLABELLED)
            both = (one.labels != UNLABELLED) & (old.labels != UNLABELLED)
            np.testing.assert_array_equal(one.tones[both], old.tones[both])
    return palette, colors_of(maps, found), colors_of(after, palette)


def near(palette, rgb):
    """Return the palette's colour that a paint was found as."""
    return min(palette.colors, key=lambda one: np.abs(np.subtract(one.rgb, rgb)).max())


def test_nothing_corrected_is_nothing_changed(sheet):
    palette, before, after = done(sheet)
    assert palette.colors == sheet[2].colors
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(old, new)


def test_merged_colours_are_one_and_others_stay(sheet):
    into, gone = (hex_of(near(sheet[2], rgb).rgb) for rgb in (TROUSERS, BOOTS))
    palette, before, after = done(sheet, merge=((into, gone),), names={gone: "leather"})
    assert gone not in [hex_of(color.rgb) for color in palette.colors]
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(new, np.where(old == gone, into, old))
    merged = next(color for color in palette.colors if hex_of(color.rgb) == into)
    parts = [near(sheet[2], rgb) for rgb in (TROUSERS, BOOTS)]
    assert merged.share == pytest.approx(sum(part.share for part in parts))
    assert merged.name == "leather"
    for one in range(len(merged.tones)):
        tones = [part.tones[one].share for part in parts if len(part.tones) > one]
        assert merged.tones[one].share == pytest.approx(sum(tones))
    assert set(palette.colors) - {merged} < set(sheet[2].colors)


def test_a_dropped_colour_goes_to_the_nearest(sheet):
    gone = hex_of(near(sheet[2], BOOTS).rgb)
    palette, before, after = done(sheet, drop=(gone,))
    total = sum(color.share for color in palette.colors)
    assert total == pytest.approx(sum(color.share for color in sheet[2].colors))
    nearest = {hex_of(near(sheet[2], rgb).rgb) for rgb in (TUNIC, TROUSERS)}
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(old[old != gone], new[old != gone])
        assert set(new[old == gone]) <= nearest


def test_a_split_colour_is_divided_among_its_own_pixels(sheet):
    color = hex_of(near(sheet[2], SKIN).rgb)
    palette, before, after = done(
        sheet, split=(Divided(color, (color, "#e2b28c")),), names={"#e2b28c": "cheek"}
    )
    assert "cheek" in [one.name for one in palette.colors]
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(old[old != color], new[old != color])
        assert set(new[old == color]) <= {color, "#e2b28c"}
    divided = next(one for one in palette.colors if one.name == "cheek")
    if sheet[2].shadow is not None and len(divided.tones) > 1:
        dark = np.array(divided.tones[1].rgb) / np.array(divided.rgb)
        np.testing.assert_allclose(dark, FACTOR, atol=0.06)


def test_a_stroke_paints_opaque_pixels_and_the_last_one_wins(sheet):
    first, second = (hex_of(near(sheet[2], rgb).rgb) for rgb in (BOOTS, SKIN))
    points = ((86.0, 100.0), (86.0, 130.0))
    strokes = [
        (0, Stroke((0, 0, 9, 9), first, points, 12.0)),
        (1, Stroke((0, 0, 9, 9), second, ((86.0, 100.0),), 4.0)),
    ]
    _, before, after = done(sheet, [[], strokes, []])
    y, x = np.mgrid[:240, :172] + 0.5
    off = np.hypot(x - 86, np.clip(np.abs(y - 115) - 15, 0, None))
    assert (after[1][(off < 11) & (np.hypot(x - 86, y - 100) > 6)] == first).all()
    assert (after[1][np.hypot(x - 86, y - 100) < 3] == second).all()
    np.testing.assert_array_equal(after[1][off > 14], before[1][off > 14])
    for number in (0, 2):
        np.testing.assert_array_equal(after[number], before[number])
    clear = sheet[0][1][..., 3] == 0
    assert (after[1][clear] == "").all()


def test_a_colour_a_few_levels_off_is_meant(sheet):
    rgb = near(sheet[2], TUNIC).rgb
    palette, *_ = done(sheet, names={hex_of((rgb[0] + 5, rgb[1], rgb[2] - 5)): "tunic"})
    assert next(color.name for color in palette.colors if color.rgb == rgb) == "tunic"


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        ({"drop": ("#00ff00",)}, "palette.drop.0: #00ff00 is no colour of the palette"),
        ({"names": {"#00ff00": "x"}}, "palette.names.#00ff00: #00ff00 is no colour"),
        ({"drop": ("A", "B", "C", "D")}, "palette.drop: leaves no colour"),
        ({"drop": ("A", "A")}, "palette.drop.1: "),
        ({"merge": (("A", "B"), ("C", "A"))}, "palette.merge.0.0: "),
        ({"drop": ("A",), "merge": (("B", "A"),)}, "palette.merge.0.1: "),
        ({"split": (Divided("#00ff00", ("#000000", "#111111")),)}, "palette.split.0.color: "),
    ],
)
def test_what_cannot_be_done_names_file_and_key(wanted, words, sheet):
    pictures, contours, found, _ = sheet
    hexes = dict(zip("ABCDEFGH", [hex_of(color.rgb) for color in found.colors], strict=False))

    def named(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(named(one) for one in value)
        return hexes.get(value, value) if isinstance(value, str) else value

    filled: dict[str, Any] = {key: named(value) for key, value in wanted.items()}
    if "leaves no colour" in words:
        filled = {"drop": tuple(hexes.values())}
    with pytest.raises(PaletteError) as refused:
        correct_palette(pictures, contours, found, PaletteCorrections(**filled), where="file.json")
    assert str(refused.value).startswith("file.json: ")
    assert words in str(refused.value)


def test_a_stroke_in_no_colour_is_refused(sheet):
    strokes = [[(4, Stroke((0, 0, 9, 9), "#00ff00", ((86.0, 100.0),)))], [], []]
    with pytest.raises(PaletteError, match=r"palette\.strokes\.4\.color: #00ff00 is no colour"):
        done(sheet, strokes)
