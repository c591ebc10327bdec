"""Names of colours: what a survey calls them, and no two of a palette alike."""

from __future__ import annotations

import numpy as np
import pytest

from tests.palette.pictures import opaque
from toonset.palette.color_names import SURVEY, distinct_names, meant_by, name_of
from toonset.palette.extract import extract_palette
from toonset.palette.names import rgb_of_hex
from toonset.palette.options import PaletteOptions
from toonset.palette.recolor import change_colors


def rgb(code: str) -> tuple[int, int, int]:
    return rgb_of_hex(code, "test")


@pytest.mark.parametrize(
    ("code", "name"),
    [
        ("#a1744b", "light brown"),  # was "grey"
        ("#1998ce", "blue"),  # was "teal"
        ("#5c5a3c", "brown"),  # an olive brown; was "dark grey"
        ("#afc2d7", "light blue"),  # was "light grey"
        ("#2e331c", "dark olive"),
        ("#10283a", "dark blue"),
        ("#302316", "dark brown"),
        ("#268a8c", "teal"),
        ("#f6ba3e", "gold"),
        ("#000000", "black"),
        ("#333333", "dark grey"),
        ("#777777", "grey"),
        ("#ffffff", "white"),
    ],
)
def test_colours_are_called_as_people_do(code: str, name: str) -> None:
    assert name_of(rgb(code)) == name


def test_survey_mostly_names_a_colour_as_its_other_colours_do() -> None:
    """Every colour of the survey, named without itself: three in four have their own noun."""
    from toonset.palette import color_names

    right = []
    for number, place in enumerate(color_names._PLACES):
        away = color_names._distances(place)
        away[number] = np.inf
        right.append(color_names._NOUN_OF[away.argmin()] == color_names._NOUN_OF[number])
    assert len(right) == sum(len(codes.split()) for codes in SURVEY.values())
    assert np.mean(right) >= 0.74


def test_greys_have_no_hue_and_go_from_black_to_white() -> None:
    names = [name_of((level, level, level)) for level in range(256)]
    assert list(dict.fromkeys(names)) == ["black", "dark grey", "grey", "light grey", "white"]


def test_no_two_names_are_alike() -> None:
    rng = np.random.default_rng(0)
    for count in (2, 5, 12, 40):
        for _ in range(20):
            middle, spread = rng.integers(0, 256, 3), rng.choice([2, 12, 60])
            some = np.clip(middle + rng.normal(0, spread, (count, 3)), 0, 255).astype(int)
            colors = sorted({(r, g, b) for r, g, b in some.tolist()})
            names = distinct_names(colors)
            assert len(set(names)) == len(colors)


def test_doubles_are_told_apart_by_lightness_chroma_part_and_code() -> None:
    light, dark = rgb("#8a5738"), rgb("#6c3820")
    assert distinct_names([light, dark]) == ("brown", "dark brown")
    assert distinct_names([rgb("#ffffff"), rgb("#fff5f1")]) == ("white", "off white")
    twins = [rgb("#7c4830"), rgb("#7d4931")]
    assert distinct_names(twins) == ("brown (#7c4830)", "brown (#7d4931)")
    assert distinct_names(twins, lambda: ["head", "feet"]) == ("brown (head)", "brown (feet)")


def test_parts_are_those_of_the_drawing() -> None:
    top, bottom = (124, 72, 48), (126, 74, 62)
    rows = np.repeat(np.array([top, (40, 100, 215), bottom], dtype=np.uint8), [60, 110, 30], axis=0)
    picture = opaque(np.repeat(rows[:, None], 80, axis=1))
    found = extract_palette([picture], PaletteOptions(colors="#7c4830,#2864d7,#7e4a3e"))
    assert [one.name for one in found.colors] == ["brown (head)", "blue", "brown (feet)"]


def test_any_unambiguous_form_of_a_name_is_understood() -> None:
    names = ["dark brown (head)", "dark brown (feet)", "light grey", "grey", "blue"]
    assert meant_by("head", names) == [0]
    assert meant_by("Brown feet", names) == [1]
    assert meant_by("gray", names) == [3]
    assert meant_by("light gray", names) == [2]
    assert meant_by("brown", names) == [0, 1]
    assert meant_by("", names) == []
    colors = np.array([rgb("#4a2c1c"), rgb("#4b2d1d"), rgb("#2864d7")], dtype=np.uint8)
    called = ["brown (head)", "brown (feet)", "blue"]
    new = change_colors(colors, ["head=#112233"], called)
    assert new.tolist() == [[0x11, 0x22, 0x33], *colors[1:].tolist()]
