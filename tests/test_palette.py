"""Palettes: exact on flat drawings, blind to order and orientation, open about what is dropped."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from toonset.errors import PaletteError
from toonset.palette.choice import PaletteOptions
from toonset.palette.extract import (
    extract_palette,
    pick_palette,
)
from toonset.palette.labels import label_image, nearest_colors
from toonset.palette.names import NAMED, name_of
from toonset.palette.oklab import oklab_from_rgb
from toonset.palette.palette import Palette, PaletteColor

FINE = 8
COLORS = np.array(
    [(200, 30, 40), (20, 60, 180), (236, 188, 155), (125, 78, 45), (10, 10, 10)], dtype=np.uint8
)


def flat_drawing(size: int = 96) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a soft-edged RGBA figure, its exact labels (255 = mixed), and its colours' areas."""
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
    blocks = fine.reshape(size, FINE, size, FINE).transpose(0, 2, 1, 3).reshape(size, size, -1)
    pure = (blocks == blocks[..., :1]).all(axis=2)
    labels = np.where(pure, blocks[..., 0], 255).astype(np.uint8)
    areas = np.bincount(fine[fine < 255], minlength=5) / (fine < 255).sum()
    return np.rint(np.dstack([rgb, alpha])).astype(np.uint8), labels, areas


def as_set(palette: Palette) -> set[tuple[int, int, int]]:
    return {color.rgb for color in palette.colors}


RGBA, LABELS, AREAS = flat_drawing()


def test_a_flat_drawing_gives_exactly_its_colours() -> None:
    palette = extract_palette([RGBA])
    assert as_set(palette) == {tuple(color) for color in COLORS.tolist()}
    shares = {color.rgb: color.share for color in palette.colors}
    for color, share in zip(COLORS.tolist(), AREAS, strict=True):
        assert shares[tuple(color)] == pytest.approx(share, abs=0.03)
    assert [c.share for c in palette.colors] == sorted(shares.values(), reverse=True)
    assert palette.warnings == ()


def test_labels_equal_the_truth_on_flat_pixels() -> None:
    found = label_image(RGBA, COLORS)
    labelled = found != 255
    assert np.array_equal(found[labelled & (LABELS != 255)], LABELS[labelled & (LABELS != 255)])
    assert labelled[LABELS != 255].mean() > 0.98  # flat pixels that were taken for mixtures
    inside = (LABELS == 255) & (RGBA[..., 3] == 255)
    assert inside.sum() > 150
    assert labelled[inside].mean() < 0.2  # mixtures that were given a label
    assert not labelled[RGBA[..., 3] < 250].any()


def test_palette_is_blind_to_order_orientation_and_repetition() -> None:
    other = np.ascontiguousarray(RGBA[10:, 5:80])
    palette = extract_palette([RGBA, other])
    turned = [np.rot90(other), RGBA[::-1], RGBA[:, ::-1], np.rot90(other, 2)]
    assert extract_palette(turned) == palette
    big = [image.repeat(2, axis=0).repeat(2, axis=1) for image in (RGBA, other)]
    assert as_set(extract_palette(big)) == as_set(palette)


def test_labels_turn_with_the_picture() -> None:
    assert np.array_equal(label_image(RGBA[:, ::-1], COLORS), label_image(RGBA, COLORS)[:, ::-1])


def block(*parts: tuple[tuple[int, int, int], int]) -> np.ndarray:
    """Return a picture of full-height stripes (colour, width)."""
    stripes = [np.full((40, width, 3), color, dtype=np.uint8) for color, width in parts]
    rgb = np.concatenate(stripes, axis=1)
    return np.dstack([rgb, np.full(rgb.shape[:2], 255, dtype=np.uint8)])


def test_the_five_percent_rule_and_what_it_costs() -> None:
    red, green, blue = (200, 30, 40), (30, 160, 60), (20, 60, 180)
    picture = block((red, 90), (green, 6), (blue, 4))
    palette = extract_palette([picture])
    assert [color.rgb for color in palette.colors] == [red, green]
    (dropped,) = palette.dropped
    assert dropped.rgb == blue
    assert dropped.share == pytest.approx(0.04)
    away = oklab_from_rgb(np.array([blue, red, green], dtype=np.uint8))
    nearest = 1 + int(
        nearest_colors(np.array([blue], np.uint8), np.array([red, green], np.uint8))[0]
    )
    assert dropped.cost == pytest.approx(float(np.linalg.norm(away[0] - away[nearest])))
    assert len(extract_palette([picture], PaletteOptions(min_share=0.03)).colors) == 3


def test_all_pictures_count_together() -> None:
    front, back = block(((200, 30, 40), 100)), block(((200, 30, 40), 91), ((20, 60, 180), 9))
    assert len(extract_palette([back]).colors) == 2
    assert len(extract_palette([front, back]).colors) == 1


def test_a_gradient_is_one_colour_and_two_paints_stay_two() -> None:
    ramp = np.linspace(0.8, 1.0, 200)[None, :, None] * [210, 60, 50] * np.ones((40, 1, 1))
    ramp = np.dstack([np.rint(ramp), np.full((40, 200), 255)]).astype(np.uint8)
    assert len(extract_palette([ramp]).colors) == 1
    base, shadow = (214, 120, 80), (160, 80, 60)
    assert as_set(extract_palette([block((base, 60), (shadow, 40))])) == {base, shadow}


@pytest.mark.parametrize("quality", [70, 85, 95])
def test_jpeg_noise_does_not_shatter_colours(quality: int) -> None:
    big = RGBA.repeat(2, axis=0).repeat(2, axis=1)
    over_white = big[..., :3] * (big[..., 3:] / 255.0) + 255 * (1 - big[..., 3:] / 255.0)
    buffer = io.BytesIO()
    Image.fromarray(over_white.astype(np.uint8)).save(buffer, "JPEG", quality=quality)
    noisy = np.dstack([np.asarray(Image.open(buffer)), big[..., 3]])
    palette = extract_palette([noisy])
    assert len(palette.colors) == 5
    drawn = oklab_from_rgb(np.concatenate([COLORS[:4], [(0, 0, 0)]]).astype(np.uint8))
    for color in palette.colors:
        away = drawn - oklab_from_rgb(np.array(color.rgb, dtype=np.uint8))
        near_black = max(color.rgb) <= 16  # the ink, but for the noise
        assert near_black or np.linalg.norm(away, axis=1).min() < 0.02


def test_if_nothing_reaches_the_share_the_largest_is_kept_and_said() -> None:
    picture = block(((200, 30, 40), 40), ((20, 60, 180), 35), ((30, 160, 60), 25))
    palette = extract_palette([picture], PaletteOptions(min_share=0.5))
    assert [color.rgb for color in palette.colors] == [(200, 30, 40)]
    assert palette.warnings == (
        "no colour reaches 50.0% of the pixels; the largest, with 40.0%, was kept alone: lower "
        "--min-share",
    )
    assert [color.rgb for color in palette.dropped] == [(20, 60, 180), (30, 160, 60)]


def test_hand_picked_colours_keep_their_order_and_say_their_share() -> None:
    picture = block(((200, 30, 40), 75), ((20, 60, 180), 25))
    picked = np.array([(0, 0, 255), (255, 0, 0), (0, 255, 0)], dtype=np.uint8)
    palette = pick_palette([picture], picked)
    assert np.array_equal(palette.rgb, picked)
    assert [color.share for color in palette.colors] == [0.25, 0.75, 0.0]
    assert palette.warnings == ("no pixel is nearest to #00ff00",)


def test_nothing_to_see_is_an_error() -> None:
    with pytest.raises(PaletteError, match="no picture given"):
        extract_palette([])
    with pytest.raises(PaletteError, match="no opaque pixel"):
        extract_palette([np.zeros((9, 9, 4), dtype=np.uint8)])
    with pytest.raises(PaletteError, match="min share 5; it is a share from 0 to 1"):
        PaletteOptions(min_share=5.0)
    with pytest.raises(PaletteError, match="max colours 0; 1 to 255 are possible"):
        PaletteOptions(max_colors=0)
    with pytest.raises(PaletteError, match="0 colours; 1 to 255 are needed"):
        Palette((), "none")
    with pytest.raises(PaletteError, match="256 colours; 1 to 255 are needed"):
        Palette(tuple(PaletteColor((0, 0, i), 0.0, "x") for i in range(256)), "many")


def test_nearest_is_the_brute_force_nearest() -> None:
    rng = np.random.default_rng(3)
    colors = rng.integers(0, 256, (500, 3), dtype=np.uint8)
    palette = rng.integers(0, 256, (17, 3), dtype=np.uint8)
    slow = ((colors[:, None].astype(int) - palette) ** 2).sum(axis=2).argmin(axis=1)
    assert np.array_equal(nearest_colors(colors, palette), slow)


def test_oklab_of_known_colours() -> None:
    # Source: B. Ottosson's table and the CSS Color 4 samples
    rgb = np.array([(255, 255, 255), (0, 0, 0), (255, 0, 0), (0, 0, 255)], dtype=np.uint8)
    expected = [(1, 0, 0), (0, 0, 0), (0.62796, 0.22486, 0.12585), (0.45201, -0.03246, -0.31153)]
    np.testing.assert_allclose(oklab_from_rgb(rgb), expected, atol=2e-4)


def test_names_name_themselves() -> None:
    for name, rgb in NAMED.items():
        assert name_of(rgb) == name
    assert name_of((12, 9, 11)) == "black"
    assert name_of((228, 30, 30)) == "red"
