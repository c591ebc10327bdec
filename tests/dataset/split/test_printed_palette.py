"""Printed palettes: found whatever their layout, in reading order, and nowhere else."""

from __future__ import annotations

import io
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from PIL import Image

from lab.bench.messy.options import MessyOptions
from lab.bench.messy.sheet import make_messy_sheet
from toonset.dataset.split.sheet import split_picture

COLORS = ((217, 84, 48), (38, 138, 140), (124, 72, 48), (46, 58, 104), (250, 240, 222), (0, 0, 0))
INK, PAPER, PANEL = (40, 40, 40), (255, 255, 255), (222, 224, 236)
LAYOUTS = ("row", "discs", "strip", "column", "grid", "panel", "wide")


def drawn(layout: str, *, outline: bool, quality: int = 0) -> np.ndarray:
    """Return a sheet of three figures with a printed palette, as RGBA."""
    sheet = np.full((700, 900, 3), PAPER, dtype=np.uint8)
    for number in range(3):
        x = 60 + 200 * number
        cv2.ellipse(sheet, (x + 60, 90), (40, 50), 0, 0, 360, COLORS[4], -1)
        cv2.ellipse(sheet, (x + 60, 250), (60 - 10 * number, 120), 0, 0, 360, COLORS[number], -1)
        cv2.ellipse(sheet, (x + 60, 250), (60 - 10 * number, 120), 0, 0, 360, INK, 3)
        cv2.ellipse(sheet, (x + 60, 90), (40, 50), 0, 0, 360, INK, 3)
    if layout == "panel":
        cv2.rectangle(sheet, (20, 440), (620, 560), PANEL, -1)
        cv2.rectangle(sheet, (20, 440), (620, 560), INK, 2)
    for box, color in zip(places(layout), COLORS, strict=True):
        x, y, width, height = box
        if layout == "discs":
            cv2.circle(sheet, (x + width // 2, y + height // 2), width // 2, color, -1, cv2.LINE_AA)
            continue
        cv2.rectangle(sheet, (x, y), (x + width - 1, y + height - 1), color, -1)
        if outline:
            cv2.rectangle(sheet, (x, y), (x + width - 1, y + height - 1), INK, 1)
    if quality:
        buffer = io.BytesIO()
        Image.fromarray(sheet).save(buffer, "JPEG", quality=quality)
        sheet = np.asarray(Image.open(buffer).convert("RGB"))
    return np.dstack([sheet, np.full(sheet.shape[:2], 255, dtype=np.uint8)])


def places(layout: str) -> Iterator[tuple[int, int, int, int]]:
    for number in range(len(COLORS)):
        if layout == "column":
            yield 720, 40 + 60 * number, 44, 44
        elif layout == "grid":
            yield 700 + 60 * (number % 2), 60 + 70 * (number // 2), 44, 44
        elif layout == "strip":
            yield 60 + 44 * number, 480, 44, 44
        elif layout == "wide":
            yield 60 + 100 * number, 480, 84, 40
        else:
            yield 60 + 70 * number, 480, 44, 44


@pytest.mark.parametrize("quality", [0, 80])
@pytest.mark.parametrize("outline", [True, False])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_swatches_are_found_in_reading_order(layout: str, outline: bool, quality: int) -> None:
    found = split_picture(drawn(layout, outline=outline, quality=quality))
    assert len(found.views) == 3
    assert {one.kind for one in found.left_out} <= {"swatch", "frame", "study"}
    assert len(found.swatches) == len(COLORS)
    for swatch, color, box in zip(found.swatches, COLORS, places(layout), strict=True):
        assert np.abs(np.array(swatch.color) - color).max() <= 4
        assert np.abs(np.array(swatch.box) - box).max() <= 6


def test_a_palette_beside_a_figure_is_no_part_of_it() -> None:
    sheet = drawn("row", outline=False)
    plain = split_picture(sheet[:440])
    close = sheet.copy()
    close[460:540] = 255
    for number, color in enumerate(COLORS):  # discs just beside the last figure
        cv2.circle(close, (585, 150 + 34 * number), 13, (*color, 255), -1)
    found = split_picture(close)
    assert len(found.swatches) >= 5
    last = found.views[2].mask
    assert abs(int(last.sum()) - int(plain.views[2].mask.sum())) <= 0.01 * last.sum()


@pytest.mark.parametrize("seed", range(4))
def test_sheets_without_a_palette_have_no_swatches(seed: int) -> None:
    options = MessyOptions(figure_px=(140, 180))
    for difficulty in ("captions", "title", "arrows", "props", "heads", "guides"):
        made = make_messy_sheet(seed, (difficulty,), options)
        assert split_picture(made.rgba).swatches == ()


@pytest.mark.parametrize("seed", [0, 1, 3, 5])
def test_swatches_of_messy_sheets_are_found(seed: int) -> None:
    made = make_messy_sheet(seed, ("swatches",), MessyOptions(figure_px=(220, 260)))
    assert len(split_picture(made.rgba).swatches) >= 3


def test_squares_of_one_colour_or_within_a_drawing_are_no_palette() -> None:
    sheet = drawn("row", outline=False)
    alike = sheet.copy()
    for x, y, width, height in places("row"):
        alike[y : y + height, x : x + width, :3] = COLORS[0]
    assert split_picture(alike).swatches == ()
    pixels = sheet.copy()
    pixels[460:540] = 255
    rng = np.random.default_rng(0)
    small = rng.choice(np.array(COLORS), (8, 6)).astype(np.uint8)  # a prop in pixel art
    pixels[470 : 470 + 8 * 16, 650 : 650 + 6 * 16, :3] = small.repeat(16, 0).repeat(16, 1)
    assert split_picture(pixels).swatches == ()
