"""Paints that flat pixels do not tell of: found where an area has edges, and not in gradients."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from toonset.palette.colors import oklab_from_rgb
from toonset.palette.extract import extract_palette
from toonset.palette.palette import Palette

INK, SKIN, LEATHER, SKIRT = (12, 10, 8), (248, 218, 190), (161, 116, 75), (98, 158, 96)
GOLD, BOOTS = (236, 205, 70), (112, 81, 52)  # boots: leather in the dark, between it and ink


def drawn(seed: int, *, crown: bool = True, edge: bool = True) -> np.ndarray:
    """Return a figure with a sketched crown and dark boots; without an edge, these fade out."""
    rng = np.random.default_rng(seed)
    rgba = np.zeros((300, 160, 4), dtype=np.uint8)
    wide = 40 + 4 * seed

    def block(top: int, bottom: int, half: int, color: tuple[int, int, int]) -> None:
        rgba[top:bottom, 80 - half : 80 + half] = (*INK, 255)
        rgba[top + 2 : bottom - 2, 82 - half : 78 + half, :3] = color

    block(24, 90, 34, SKIN)
    block(88, 150, wide, LEATHER)
    block(148, 220, wide + 8, SKIRT)
    block(218, 292, 30, LEATHER)
    if edge:
        rgba[268:290, 52:108, :3] = np.clip(BOOTS + rng.normal(0, 7, (22, 56, 1)), 0, 255)
    else:
        fade = np.linspace(0, 1, 70)[:, None, None]
        rgba[220:290, 52:108, :3] = np.rint(LEATHER + fade * np.subtract(BOOTS, LEATHER))
    if crown:
        cv2.line(rgba, (48, 24), (112, 24), (*INK, 255), 2)
        noise = rng.normal(0, 9, (14, 60, 1)) + rng.normal(0, 4, (14, 60, 3))
        rgba[10:24, 50:110, :3] = np.clip(GOLD + noise, 0, 255)
        rgba[10:24, 50:110, 3] = 255
    return rgba


def has(palette: Palette, rgb: tuple[int, int, int]) -> bool:
    away = oklab_from_rgb(palette.rgb) - oklab_from_rgb(np.array(rgb, np.uint8))
    return bool(np.linalg.norm(away, axis=1).min() < 0.03)


@pytest.fixture(scope="module")
def found() -> Palette:
    return extract_palette([drawn(seed) for seed in range(3)])


@pytest.mark.parametrize("rgb", [SKIN, LEATHER, SKIRT, INK, GOLD, BOOTS])
def test_sketched_and_blended_paints_are_found(found: Palette, rgb: tuple[int, int, int]) -> None:
    assert has(found, rgb)


def test_features_are_not_called_kept_by_hand(found: Palette) -> None:
    assert found.features
    assert "kept by hand" not in found.rule


def test_what_fades_out_is_a_shade() -> None:
    found = extract_palette([drawn(seed, edge=False) for seed in range(3)])
    assert has(found, GOLD)
    assert not has(found, BOOTS)


def test_without_them_there_is_nothing_more() -> None:
    plain = [drawn(seed, crown=False) for seed in range(3)]
    for picture in plain:
        picture[268:290, 52:108, :3] = LEATHER
    assert len(extract_palette(plain).colors) == 4
