"""Drawings in other light than the others: their gain is found, and only theirs."""

import numpy as np
import pytest

from tests.palette.pictures import block
from toonset.palette.extract import extract_palette, paint_maps
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.view_gain import view_gains, with_gains

COLORS = (
    (217, 84, 48),
    (38, 138, 140),
    (124, 72, 48),
    (46, 58, 104),
    (220, 180, 140),
    (60, 160, 60),
)


def views(count: int = 5) -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    return [block(*((color, int(rng.integers(20, 60))) for color in COLORS)) for _ in range(count)]


def lit(picture: np.ndarray, gain: tuple[float, float, float]) -> np.ndarray:
    other = picture.copy()
    other[..., :3] = np.rint(other[..., :3] * np.array(gain)).clip(0, 255)
    return other


@pytest.mark.parametrize("gain", [(1.1, 1.0, 0.92), (0.9, 0.9, 0.9), (1.0, 1.12, 1.08)])
def test_gain_is_found_and_taken_off(gain: tuple[float, float, float]) -> None:
    pictures = views()
    turned = [*pictures[:3], lit(pictures[3], gain), pictures[4]]
    gains = view_gains(turned)
    assert gains is not None
    np.testing.assert_allclose(gains[3], 1 / np.array(gain), rtol=0.02)
    np.testing.assert_allclose(np.delete(gains, 3, axis=0), 1, rtol=0.01)
    off = with_gains(turned, gains)[3][..., :3].astype(int) - pictures[3][..., :3]
    assert np.abs(off).max() <= 4
    found = extract_palette(turned)
    assert len(found.colors) == len(COLORS)
    assert "picture 3 differ as a whole" in found.warnings[0]
    maps = paint_maps(turned, find_contours(turned), found)
    own = paint_maps(pictures, find_contours(pictures), found)
    assert (maps[3].labels == own[3].labels).mean() > 0.98


def test_drawings_in_one_light_have_no_gain() -> None:
    assert view_gains(views()) is None
    assert view_gains(views(1)) is None
    assert view_gains([]) is None


def test_other_clothes_and_shadow_are_no_gain() -> None:
    pictures = views()
    other = block(*(((255 - r, 255 - g, 255 - b), 40) for r, g, b in COLORS))
    assert view_gains([*pictures, other]) is None
    half = pictures[0].copy()
    half[20:, :, :3] = np.rint(0.8 * half[20:, :, :3])
    assert view_gains([*pictures, half]) is None
