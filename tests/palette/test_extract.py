"""Palettes: exact on flat drawings, blind to order, orientation, blends, noise and shades."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from tests.palette.pictures import as_set, block, opaque, ramp, soft_stripes
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.paints.extract import find_palette
from toonset.palette.paints.histogram import count_pixels

FINE = 8
COLORS = np.array(
    [(200, 30, 40), (20, 60, 180), (236, 188, 155), (125, 78, 45), (10, 10, 10)], dtype=np.uint8
)


def flat_drawing(size: int = 96) -> tuple[np.ndarray, np.ndarray]:
    """Return a soft-edged RGBA figure and its colours' areas."""
    fine = np.full((size * FINE, size * FINE), 255, dtype=np.uint8)
    center = size * FINE // 2
    cv2.circle(fine, (center, center), int(0.46 * size * FINE), 4, -1)  # the contour
    cv2.circle(fine, (center, center), int(0.43 * size * FINE), 0, -1)
    cv2.rectangle(fine, (center, center), (center + 27 * FINE, center + 20 * FINE + 3), 1, -1)
    cv2.rectangle(fine, (center - 26 * FINE - 5, center), (center - 29, center + 170), 2, -1)
    cv2.rectangle(fine, (center - 160, center - 200 + 5), (center + 165, center - 29), 3, -1)
    table = np.zeros((256, 4))
    table[:5, :3], table[:5, 3] = COLORS, 255
    soft = table[fine].reshape(size, FINE, size, FINE, 4)
    alpha = soft[..., 3].mean(axis=(1, 3))
    rgb = (soft[..., :3] * soft[..., 3:]).sum(axis=(1, 3)) / np.maximum(
        soft[..., 3:].sum(axis=(1, 3)), 1
    )
    areas = np.bincount(fine[fine < 255], minlength=5) / (fine < 255).sum()
    return np.rint(np.dstack([rgb, alpha])).astype(np.uint8), areas


RGBA, AREAS = flat_drawing()


def test_a_flat_drawing_gives_exactly_its_colours() -> None:
    palette = find_palette([RGBA])
    assert as_set(palette) == {tuple(color) for color in COLORS.tolist()}
    shares = {color.rgb: color.share for color in palette.colors}
    for color, share in zip(COLORS.tolist(), AREAS, strict=True):
        assert shares[tuple(color)] == pytest.approx(share, abs=0.03)
    assert [c.share for c in palette.colors] == sorted(shares.values(), reverse=True)
    assert palette.warnings == ()


def test_palette_is_blind_to_order_orientation_and_repetition() -> None:
    other = np.ascontiguousarray(RGBA[10:, 5:80])
    palette = find_palette([RGBA, other])
    turned = [np.rot90(other), RGBA[::-1], RGBA[:, ::-1], np.rot90(other, 2)]
    assert find_palette(turned) == palette
    big = [image.repeat(2, axis=0).repeat(2, axis=1) for image in (RGBA, other)]
    assert as_set(find_palette(big)) == as_set(palette)


def test_two_paints_stay_two() -> None:
    base, shadow = (214, 120, 80), (160, 80, 60)
    assert as_set(find_palette([block((base, 60), (shadow, 40))])) == {base, shadow}


@pytest.mark.parametrize("quality", [70, 85, 95])
def test_jpeg_noise_does_not_shatter_colours(quality: int) -> None:
    big = RGBA.repeat(2, axis=0).repeat(2, axis=1)
    over_white = big[..., :3] * (big[..., 3:] / 255.0) + 255 * (1 - big[..., 3:] / 255.0)
    buffer = io.BytesIO()
    Image.fromarray(over_white.astype(np.uint8)).save(buffer, "JPEG", quality=quality)
    noisy = np.dstack([np.asarray(Image.open(buffer)), big[..., 3]])
    palette = find_palette([noisy])
    assert len(palette.colors) == 5
    drawn = oklab_from_rgb(np.concatenate([COLORS[:4], [(0, 0, 0)]]).astype(np.uint8))
    for color in palette.colors:
        away = drawn - oklab_from_rgb(np.array(color.rgb, dtype=np.uint8))
        near_black = max(color.rgb) <= 16  # the ink, but for the noise
        assert near_black or np.linalg.norm(away, axis=1).min() < 0.02


def test_oklab_of_known_colours() -> None:
    # Source: B. Ottosson's table and the CSS Color 4 samples
    rgb = np.array([(255, 255, 255), (0, 0, 0), (255, 0, 0), (0, 0, 255)], dtype=np.uint8)
    expected = [(1, 0, 0), (0, 0, 0), (0.62796, 0.22486, 0.12585), (0.45201, -0.03246, -0.31153)]
    np.testing.assert_allclose(oklab_from_rgb(rgb), expected, atol=2e-4)


def test_counts_are_the_pixels() -> None:
    rng = np.random.default_rng(2)
    rgba = rng.integers(0, 4, (70, 90, 4), dtype=np.uint8) * 60
    rgba[..., 3] = rng.choice([0, 200, 255], rgba.shape[:2])
    histogram = count_pixels([rgba, rgba[::-1]])
    colors, counts = np.unique(rgba[rgba[..., 3] == 255][:, :3], axis=0, return_counts=True)
    found = {tuple(c): n for c, n in zip(histogram.colors.tolist(), histogram.counts, strict=True)}
    assert found == {tuple(c): 2 * n for c, n in zip(colors.tolist(), counts, strict=True)}


def test_large_and_small_pictures_are_counted_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    once = count_pixels([RGBA])
    monkeypatch.setattr("toonset.palette.paints.histogram.TABLE_RUNS", 1)
    monkeypatch.setattr("toonset.palette.paints.histogram.BAND_PIXELS", 500)
    again = count_pixels([RGBA])
    for name in ("colors", "counts", "flat", "thin"):
        assert np.array_equal(getattr(once, name), getattr(again, name)), name


def test_blends_are_no_colours_and_count_half_to_either_side() -> None:
    colors = (200, 30, 40), (20, 60, 180), (30, 160, 60)
    palette = find_palette([soft_stripes(*colors, width=4)])
    assert as_set(palette) == set(colors)
    assert sum(color.share for color in palette.colors) == pytest.approx(1)


def test_near_shades_merge_and_near_paints_do_not() -> None:
    near, far = block(((150, 90, 60), 60), ((152, 91, 60), 40)), ((150, 90, 60), (160, 104, 72))
    assert as_set(find_palette([near])) == {(150, 90, 60)}
    apart = oklab_from_rgb(np.array(far, dtype=np.uint8))
    assert 0.04 < np.linalg.norm(apart[0] - apart[1]) < 0.06
    assert as_set(find_palette([block((far[0], 60), (far[1], 40))])) == set(far)


@pytest.mark.parametrize("low", [0.8, 0.4])
def test_long_gradients_are_one_colour(low: float) -> None:
    for color in ((210, 60, 50), (90, 200, 120), (240, 220, 90)):
        assert len(find_palette([ramp(low, color)]).colors) == 1, color


@pytest.mark.parametrize(("low", "count"), [(0.7, 0), (0.0, 1)])
def test_a_paint_of_very_different_shades_is_said(low: float, count: int) -> None:
    palette = find_palette([ramp(low, (240, 225, 190))])
    assert len(palette.colors) == 1
    assert len(palette.warnings) == count
    assert all("stands for very different shades" in said for said in palette.warnings)


def test_thin_soft_lines_give_their_pure_ink() -> None:
    rgb = np.full((80, 80, 3), (230, 180, 60))
    for x in range(6, 78, 6):  # 1.5 px wide: a core, and half of it beside
        rgb[:, x], rgb[:, x + 1] = (10, 10, 10), (120, 95, 35)
    assert as_set(find_palette([opaque(rgb)])) == {(230, 180, 60), (10, 10, 10)}
