"""The palette that a sheet prints: kept where it fits, in its order, or taken as it is."""

from __future__ import annotations

import numpy as np
import pytest

from tests.palette.pictures import block
from toonset.errors import PaletteError
from toonset.palette.choice import choose_palette
from toonset.palette.corrected import correct_palette
from toonset.palette.corrections import PaletteCorrections
from toonset.palette.extract import extract_palette
from toonset.palette.formats.json import to_json
from toonset.palette.options import PaletteOptions
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.printed import paint_of
from toonset.palette.swatch_image import draw_swatches
from toonset.view import View

Rgb = tuple[int, int, int]
RED, BLUE, EYE, SKIN, ODD = (
    (200, 30, 40),
    (20, 60, 180),
    (30, 200, 60),
    (240, 200, 160),
    (9, 99, 99),
)
FIGURE = block((RED, 200), (BLUE, 100), (EYE, 6), (SKIN, 40))


def choose(
    picture: np.ndarray, printed: tuple[Rgb, ...] = (), *, use: bool | None = None
) -> Palette:
    contours = find_contours([picture])
    return choose_palette([picture], contours, PaletteOptions(swatches=use), printed)


def colors(found: Palette) -> list[Rgb]:
    return [one.rgb for one in found.colors]


def test_printed_colours_are_kept_in_their_order_however_small() -> None:
    plain = choose(FIGURE)
    assert colors(plain) == [RED, BLUE, SKIN]
    found = choose(FIGURE, (SKIN, EYE, RED))
    assert colors(found) == [SKIN, EYE, RED, BLUE]
    assert sum(one.share for one in found.colors) == pytest.approx(1)
    assert found.printed == (SKIN, EYE, RED)
    assert "in the order that the sheet prints" in found.rule
    assert to_json(found)["printed"] == ["#f0c8a0", "#1ec83c", "#c81e28"]
    assert "printed" not in to_json(plain)


def test_a_list_of_another_character_is_not_used() -> None:
    other = (RED, ODD, (250, 250, 10), (120, 0, 120), (90, 90, 90))
    assert choose(FIGURE, other) == choose(FIGURE)


def test_print_and_paint_may_differ_a_little() -> None:
    off = tuple((r + 3, g - 2, b + 2) for r, g, b in (SKIN, EYE, RED))
    assert colors(choose(FIGURE, off)) == [SKIN, EYE, RED, BLUE]


def test_switched_off_nothing_changes_and_switched_on_it_is_the_palette() -> None:
    printed = (SKIN, EYE, ODD)
    assert choose(FIGURE, printed, use=False) == choose(FIGURE)
    found = choose(FIGURE, printed, use=True)
    assert colors(found) == list(printed)
    assert found.printed == printed
    assert "no pixel is nearest to" not in str(found.warnings)
    with pytest.raises(PaletteError, match="--swatches: no printed palette was found"):
        choose(FIGURE, use=True)


def test_where_paints_run_together_the_printed_ones_are_the_paints() -> None:
    rng = np.random.default_rng(0)
    ends = np.array([RED, SKIN, BLUE], dtype=float)
    way = np.linspace(0, 2, 400)
    eased = np.floor(way) + 0.5 - 0.5 * np.cos(np.pi * (way % 1))  # slow near all of them
    at = np.repeat(eased[None], 60, axis=0)
    rgb = np.stack([np.interp(at, [0, 1, 2], ends[:, i]) for i in range(3)], axis=-1)
    soft = np.dstack([rgb + rng.normal(0, 4, rgb.shape), np.full(at.shape, 255)])
    picture = soft.clip(0, 255).astype(np.uint8)
    assert len(choose(picture).colors) < 3
    found = choose(picture, (RED, SKIN, BLUE))
    assert all(paint_of(rgb, colors(found)) is not None for rgb in (RED, SKIN, BLUE))


def test_views_bring_their_sheets_palette_along() -> None:
    view = View(FIGURE, (0, 0, 346, 40), 0.0, "000.png", swatches=(SKIN, EYE, RED))
    assert colors(extract_palette([view])) == [SKIN, EYE, RED, BLUE]
    assert colors(extract_palette([view], PaletteOptions(swatches=False))) == [RED, BLUE, SKIN]
    assert colors(extract_palette([view], PaletteOptions(swatches=True))) == [SKIN, EYE, RED]


def test_the_card_shows_print_and_paint_side_by_side() -> None:
    off = (SKIN, (EYE[0] + 3, EYE[1], EYE[2]), RED)
    with_card = draw_swatches(choose(FIGURE, off))
    assert (with_card == off[1]).all(axis=2).sum() > 1000


def test_corrections_leave_the_printed_order() -> None:
    found = choose(FIGURE, (SKIN, EYE, RED))
    wanted = PaletteCorrections(names={"#f0c8a0": "face"})
    changed, _ = correct_palette([FIGURE], find_contours([FIGURE]), found, wanted)
    assert colors(changed) == [SKIN, EYE, RED, BLUE]
