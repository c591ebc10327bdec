"""Drawings enlarged without smoothing are read at their own size."""

import cv2
import numpy as np
import pytest

from toonset.dataset.split.sheet import split_picture
from toonset.palette.extract import extract_palette, label_image
from toonset.palette.pixels.enlarged import find_grid
from toonset.palette.pixels.ink_lines import find_contours

COLORS = ((217, 84, 48), (38, 138, 140), (46, 58, 104), (246, 186, 62))


def antialiased(size: int = 96) -> np.ndarray:
    """Return discs in four colours with soft edges, cut out."""
    large = np.zeros((8 * size, 8 * size, 4), dtype=np.uint8)
    cv2.circle(large, (4 * size, 4 * size), 4 * size - 20, (*COLORS[0], 255), -1)
    for number, color in enumerate(COLORS[1:]):
        at = np.array([4 * size, 4 * size]) + np.rint(
            2.1 * size * np.array([np.cos(2.1 * number), np.sin(2.1 * number)])
        ).astype(int)
        cv2.circle(large, (int(at[0]), int(at[1])), int(1.3 * size), (*color, 255), -1)
    small = large.reshape(size, 8, size, 8, 4).astype(float)
    weight = small[..., 3:].sum(axis=(1, 3))
    rgb = (small[..., :3] * small[..., 3:]).sum(axis=(1, 3)) / np.maximum(weight, 1)
    return np.dstack([np.rint(rgb), np.rint(weight / 64)]).astype(np.uint8)


@pytest.mark.parametrize("times", [2, 3, 5])
@pytest.mark.parametrize("cut", [0, 1])
def test_palette_and_labels_are_those_of_the_small_drawing(times: int, cut: int) -> None:
    small = antialiased()
    large = small.repeat(times, axis=0).repeat(times, axis=1)[cut:, cut:]
    grid = find_grid(large)
    assert grid is not None
    assert grid.times == times
    np.testing.assert_array_equal(grid.enlarged(grid.reduced(large)), large)
    found, own = extract_palette([large]), extract_palette([small])
    assert [one.rgb for one in found.colors] == [one.rgb for one in own.colors]
    assert [one.share for one in found.colors] == pytest.approx(
        [one.share for one in own.colors], abs=0.005
    )
    assert f"enlarged {times} times" in found.warnings[0]
    labels = label_image(large, found)
    expected = label_image(small, own).repeat(times, axis=0).repeat(times, axis=1)[cut:, cut:]
    assert (labels == expected).mean() > 0.99
    lines = find_contours([large])[0]
    assert lines.shape == large.shape[:2]


def test_others_are_left_as_they_are() -> None:
    assert find_grid(antialiased()) is None
    rng = np.random.default_rng(0)
    art = rng.choice(np.array(COLORS, dtype=np.uint8), (24, 24))
    pixels = np.dstack([art, np.full((24, 24), 255, dtype=np.uint8)]).repeat(8, 0).repeat(8, 1)
    assert find_grid(pixels) is None  # pixel art
    flat = np.zeros((60, 40, 4), dtype=np.uint8)
    flat[5:55, 10:30] = (*COLORS[0], 255)
    assert find_grid(flat) is None
    assert find_grid(np.zeros((0, 0, 4), dtype=np.uint8)) is None
    assert find_grid(np.zeros((1, 1, 4), dtype=np.uint8)) is None


def test_an_enlarged_sheet_is_cut_at_its_own_size() -> None:
    one = antialiased(64)
    sheet = np.full((90, 200, 4), 255, dtype=np.uint8)
    for x in (12, 116):
        alpha = one[..., 3:] / 255
        part = sheet[12:76, x : x + 64, :3]
        part[...] = np.rint(alpha * one[..., :3] + (1 - alpha) * part)
    plain = split_picture(sheet)
    found = split_picture(sheet.repeat(3, axis=0).repeat(3, axis=1))
    for view, own in zip(found.views, plain.views, strict=True):
        assert view.box == tuple(3 * side for side in own.box)
        np.testing.assert_array_equal(view.rgba, own.rgba.repeat(3, axis=0).repeat(3, axis=1))
    assert found.remarks[0] == "enlarged 3 times without smoothing: cut at its own size"
