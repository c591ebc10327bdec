"""palette.json: what is written comes back, later keys do not disturb, damage is named."""

import json
import string
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toonset.errors import PaletteError
from toonset.palette.formats.json import palette_of, read_palette_json, to_json
from toonset.palette.formats.registry import parse_colors
from toonset.palette.palette import (
    ContourColor,
    DroppedColor,
    Evidence,
    Palette,
    PaletteColor,
    Place,
)

PALETTE = Palette(
    (PaletteColor((200, 30, 40), 0.75, "red"), PaletteColor((1, 2, 3), 0.2, "black")),
    "at least 0.05",
    (
        DroppedColor((0, 255, 0), 0.05, "green", 0.25),
        DroppedColor((0, 250, 0), 0.01, "green", 0.25, Place(3, (1, 2, 30, 40))),
    ),
    ("a warning",),
    ContourColor((0, 0, 0), 0.08, 0.01, "black"),
    Evidence(7, 12.5, 3.25),
)
GOOD: dict[str, Any] = to_json(PALETTE)
COLOR: dict[str, Any] = GOOD["colors"][0]


def _toned(count: int) -> dict[str, Any]:
    """Return a colour with so many tones, the first its own."""
    tones = [{"hex": f"#{200 - 20 * n:02x}1e28", "share": 0.1} for n in range(count)]
    return COLOR | {"tones": tones}


STEPPED: dict[str, Any] = GOOD | {"stepped": True, "colors": [_toned(1), _toned(4)]}
SHADOW = {"factor": [0.5] * 3, "spread": [0.1] * 3, "bits": 20.0}


def test_a_palette_with_steps_comes_back() -> None:
    palette = palette_of(STEPPED, "p")
    assert [len(color.tones) for color in palette.colors] == [1, 4]
    assert palette_of(to_json(palette), "p") == palette


def test_a_palette_comes_back(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    for palette in (PALETTE, Palette(PALETTE.colors, "typed")):
        file.write_text(json.dumps(to_json(palette)))
        assert read_palette_json(file) == palette
        assert parse_colors(str(file)).tolist() == palette.rgb.tolist()


LEVELS = st.tuples(*[st.integers(0, 255)] * 3)
SHARES = st.integers(0, 10**6).map(lambda n: n / 10**6)  # six decimals are written
NAMES = st.text(string.ascii_letters + "äß\u5c71", min_size=1, max_size=20)


@given(
    st.lists(st.builds(PaletteColor, LEVELS, SHARES, NAMES), min_size=1, max_size=9),
    st.lists(st.builds(DroppedColor, LEVELS, SHARES, NAMES, SHARES), max_size=4),
)
def test_any_palette_comes_back(colors: list[PaletteColor], dropped: list[DroppedColor]) -> None:
    palette = Palette(tuple(colors), "rule", tuple(dropped))
    assert palette_of(json.loads(json.dumps(to_json(palette))), "p") == palette


def test_files_of_the_first_toonset_and_of_a_later_one_are_read() -> None:
    first = {
        "schema": "toonset-palette/1",
        "colors": [{"hex": "#c81e28", "share": 1, "name": "red"}],
        "rule": "typed",
    }
    expected = Palette((PaletteColor((200, 30, 40), 1.0, "red"),), "typed")
    assert palette_of(first, "p") == expected
    later = first | {"schema": "toonset-palette/1.7", "mood": ["warm"]}
    later["colors"] = [first["colors"][0] | {"pigment": {"id": 3}}]  # type: ignore[index]
    assert palette_of(later, "p") == expected


def test_foreign_text_prints_as_one_line() -> None:
    content = GOOD | {"rule": "a\nb\x1b[2J", "warnings": ["c\r\nd"]}
    content["colors"] = [COLOR | {"name": "re\td\x07"}]
    palette = palette_of(content, "p")
    assert (palette.rule, palette.warnings) == ("a b [2J", ("c d",))
    assert palette.colors[0].name == "re d"


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        ({}, "states no schema, 'toonset-palette/1' is needed"),
        (GOOD | {"schema": "toonset-palette/1x"}, "schema 'toonset-palette/1x', "),
        (GOOD | {"schema": "toonset-palette/9"}, "'toonset-palette/9' is newer than this toonset"),
        (
            {key: GOOD[key] for key in GOOD if key != "colors"},
            "field colors: Field required; correct the file",
        ),
        (GOOD | {"colors": []}, "colors: List should have at least 1 item"),
        (GOOD | {"colors": [COLOR] * 256}, "colors: List should have at most 255 items"),
        (GOOD | {"colors": 5}, "colors: Input should be a valid list"),
        (
            GOOD | {"colors": [COLOR, COLOR | {"hex": "#12"}]},
            r"colors\.1\.hex: hex: '#12' is no colour",
        ),
        (
            GOOD | {"colors": [COLOR | {"share": 7}]},
            r"colors\.0\.share: .* less than or equal to 1",
        ),
        (GOOD | {"colors": [COLOR | {"share": "x"}]}, r"colors\.0\.share: .* valid number"),
        (GOOD | {"colors": [COLOR | {"share": True}]}, r"colors\.0\.share: .* valid number"),
        (GOOD | {"dropped": [COLOR]}, r"dropped\.0\.oklab_cost: Field required"),
        (GOOD | {"contour": COLOR}, r"contour\.cloth: Field required"),
        (GOOD | {"rule": None}, "rule: Input should be a valid string"),
        (GOOD | {"stepped": True}, "#c81e28 is shaded in steps and has 0 tones; 1 to 4 are"),
        (STEPPED | {"colors": [_toned(5)]}, "#c81e28 is shaded in steps and has 5 tones"),
        (
            STEPPED | {"colors": [_toned(2) | {"hex": "#c81e29"}]},
            "the first tone of #c81e29 is #c81e28; it must be the colour itself",
        ),
        (STEPPED | {"colors": [_toned(4)] * 64}, "256 tones; at most 255 can be told apart"),
        (STEPPED | {"shadow": SHADOW}, "it is shaded in steps and has a shadow"),
    ],
)
def test_bad_palette_json(content: object, fragment: str, tmp_path: Path) -> None:
    file = tmp_path / "palette.json"
    file.write_text(json.dumps(content))
    with pytest.raises(PaletteError, match=fragment) as caught:
        read_palette_json(file)
    assert str(caught.value).startswith(str(file))


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999", "1" * 5000])
def test_numbers_that_are_none(number: str, tmp_path: Path) -> None:
    file = tmp_path / "palette.json"
    file.write_text(json.dumps(GOOD).replace("0.75", number))
    with pytest.raises(PaletteError, match=r"palette\.json: is no valid JSON"):
        read_palette_json(file)
