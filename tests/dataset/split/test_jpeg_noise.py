"""JPEG ripples are told from other small differences by the grid of blocks that they end at."""

import io

import numpy as np
import pytest
from PIL import Image

from lab.bench.messy.sheet import make_messy_sheet
from toonset.dataset.images.jpeg_noise import has_jpeg_grid
from toonset.dataset.split.background import difference, find_background, with_final_tolerance

WHITE = np.full((1, 1, 3), 255, np.uint8)


def drawn(seed: int, *what: str) -> np.ndarray:
    return make_messy_sheet(seed, what or ("plain",)).rgba[..., :3]


def through_jpeg(rgb: np.ndarray, quality: int, subsampling: int = 2) -> np.ndarray:
    buffer = io.BytesIO()
    Image.fromarray(rgb).save(buffer, "JPEG", quality=quality, subsampling=subsampling)
    return np.asarray(Image.open(buffer).convert("RGB"))


def away_from_white(rgb: np.ndarray) -> np.ndarray:
    return difference(rgb, np.broadcast_to(WHITE, rgb.shape))


@pytest.mark.parametrize("quality", [50, 75, 90])
@pytest.mark.parametrize("subsampling", [0, 2])
def test_the_grid_of_a_jpeg_is_found(quality: int, subsampling: int) -> None:
    rgb = through_jpeg(drawn(7100), quality, subsampling)
    assert has_jpeg_grid(away_from_white(rgb), 0.0)


@pytest.mark.parametrize("corner", [(1, 0), (3, 5), (7, 2)])
def test_a_cropped_jpeg_is_found(corner: tuple[int, int]) -> None:
    rgb = through_jpeg(drawn(7101), 80)[corner[0] :, corner[1] :]
    assert has_jpeg_grid(away_from_white(rgb), 0.0)


@pytest.mark.parametrize("seed", range(7100, 7106))
@pytest.mark.parametrize("kind", ["plain", "line art", "shadows", "captions"])
def test_a_clean_drawing_has_none(seed: int, kind: str) -> None:
    assert not has_jpeg_grid(away_from_white(drawn(seed, kind)), 0.0)


@pytest.mark.parametrize("scale", [2, 4, 8, 16])
def test_enlarged_pixel_art_has_none(scale: int) -> None:
    art = np.random.default_rng(0).integers(240, 256, (60, 80, 3), dtype=np.uint8)
    art[:12] = art[-12:] = 255
    large = art.repeat(scale, axis=0).repeat(scale, axis=1)
    assert not has_jpeg_grid(away_from_white(large), 0.0)


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (9, 9)])
def test_tiny_and_empty_pictures_have_none(shape: tuple[int, int]) -> None:
    assert not has_jpeg_grid(np.zeros(shape, np.uint8), 0.0)


def test_ripples_widen_the_tolerance_and_grain_does_not() -> None:
    def tolerance(rgb: np.ndarray) -> int:
        rgba = np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)])
        ground = find_background(rgba)
        height, width = rgb.shape[:2]
        away = difference(rgb, ground.colors((0, 0, width, height)))
        return with_final_tolerance(ground, away).tolerance

    clean = drawn(7104)
    assert tolerance(clean) == 2
    assert 5 <= tolerance(through_jpeg(clean, 75)) <= 40
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 4, clean.shape[:2])[..., None]
    grainy = np.clip(clean.astype(float) * 0.9 + noise, 0, 255).astype(np.uint8)
    assert 12 <= tolerance(grainy) <= 18  # 4.0 sigma is one pixel in 16,000, both signs
