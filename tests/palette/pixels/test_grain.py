"""Grain of paper: measured, taken off within borders, and left alone where it is faint."""

import cv2
import numpy as np
import pytest

from toonset.palette.extract import extract_palette, label_image
from toonset.palette.options import PaletteOptions
from toonset.palette.pixels.grain import noise_levels, remove_grain
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.labels import UNLABELLED

PAINTS = np.array([(40, 44, 60), (208, 170, 120), (120, 60, 40), (90, 130, 160)], dtype=np.uint8)


def figure() -> np.ndarray:
    """Return the paints of a figure: four stripes and a disc, 255 outside."""
    paint = np.full((120, 80), UNLABELLED, dtype=np.uint8)
    paint[10:110, 10:70] = np.repeat(np.arange(4, dtype=np.uint8), 25)[:, None]
    return cv2.circle(paint, (40, 48), 9, 3, -1)


def drawn(paint: np.ndarray, grain: float, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    rgb = np.full((*paint.shape, 3), 255.0)
    rgb[paint != UNLABELLED] = PAINTS[paint[paint != UNLABELLED]]
    rgb += grain * rng.standard_normal(paint.shape)[..., None]
    alpha = np.where(paint != UNLABELLED, 255, 0)
    return np.dstack([np.rint(rgb).clip(0, 255), alpha]).astype(np.uint8)


@pytest.mark.parametrize("grain", [4.0, 8.0, 16.0])
def test_noise_is_measured_in_levels(grain: float) -> None:
    assert noise_levels([drawn(figure(), grain)]) == pytest.approx(grain, rel=0.25)


@pytest.mark.parametrize("grain", [0.0, 1.0])
def test_clean_drawings_stay_as_they_are(grain: float) -> None:
    picture = drawn(figure(), grain)
    assert remove_grain([picture])[0] is picture
    assert noise_levels([np.zeros((9, 9, 4), np.uint8), np.zeros((0, 5, 4), np.uint8)]) == 0


def test_a_sheet_saved_as_jpeg_stays_as_it_is() -> None:
    picture = drawn(figure(), 0.0)
    written = cv2.imencode(".jpg", picture[..., 2::-1], [cv2.IMWRITE_JPEG_QUALITY, 70])[1]
    read = cv2.imdecode(written, cv2.IMREAD_COLOR)
    assert read is not None
    read = np.dstack([read[..., ::-1], picture[..., 3]])
    assert remove_grain([read])[0] is read


@pytest.mark.parametrize("seed", range(3))
def test_paints_on_rough_paper_are_regions(seed: int) -> None:
    paint = figure()
    picture = drawn(paint, 20.0, seed)
    colors = ",".join(f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in PAINTS.tolist())
    palette = extract_palette([picture], PaletteOptions(colors=colors))
    apart = np.linalg.norm(palette.rgb[:, None].astype(int) - PAINTS, axis=2)
    labels = label_image(picture, palette)
    square = np.ones((3, 3), dtype=np.uint8)
    inner = (cv2.erode(paint, square) == cv2.dilate(paint, square)) & (paint != UNLABELLED)
    found = np.append(apart.argmin(axis=1), np.full(255, UNLABELLED))[labels]
    assert (found == paint)[inner].mean() > 0.99
    specks = cv2.medianBlur(labels, 3) != labels
    assert specks[inner].mean() < 0.005


def test_borders_stay_where_they_are() -> None:
    paint = figure()
    picture = drawn(paint, 16.0)
    smooth = remove_grain([picture])[0]
    truth = drawn(paint, 0.0)
    off = np.abs(smooth[..., :3].astype(float) - truth[..., :3])[paint != UNLABELLED]
    assert off.mean() < 6  # of 16 levels of grain, borders included
    assert np.array_equal(smooth[paint == UNLABELLED], picture[paint == UNLABELLED])


def test_lines_are_not_seen_in_grain() -> None:
    found = find_contours([drawn(figure(), 24.0)])[0]
    assert (found >= 128).mean() < 0.01


@pytest.mark.parametrize("seed", range(3))
def test_paints_are_found_in_grain_with_the_colours_that_they_have(seed: int) -> None:
    palette = extract_palette([drawn(figure(), 16.0, seed)], PaletteOptions(contour=False))
    apart = np.linalg.norm(palette.rgb[:, None].astype(int) - PAINTS, axis=2)
    assert sorted(apart.argmin(axis=1)) == [0, 1, 2, 3]
    assert apart.min(axis=1).max() < 5  # of 255: a fifth of a grain, not what lies beside
