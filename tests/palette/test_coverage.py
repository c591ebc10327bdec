"""Coverage: borders finer than pixels, against pictures averaged from larger ones."""

import numpy as np
import pytest

from toonset.palette.coverage import coverage_map
from toonset.palette.extract import paint_maps
from toonset.palette.palette import ContourColor, Palette, PaletteColor

PAINTS = ((210, 60, 40), (40, 90, 200), (240, 220, 120))
INK = (20, 16, 24)
SIDE, FINER = 96, 8


def palette_of(colors: tuple[tuple[int, int, int], ...]) -> Palette:
    found = tuple(PaletteColor(color, 1 / len(colors), str(color)) for color in colors)
    return Palette(found, "by hand", contour=ContourColor(INK, 0.1, 0.0, "ink"))


def disc(width: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a picture of a disc on two halves, how far paints cover it, and a line round it."""
    y, x = (np.mgrid[: SIDE * FINER, : SIDE * FINER] + 0.5) / FINER
    away = np.hypot(x - 47.3, y - 45.8) - 24.6
    labels = np.where(away < 0, 2, (x + 0.3 * y > 60.2).astype(int))
    ink = np.abs(away) < width / 2
    layers = np.stack([*((labels == paint) & ~ink for paint in range(3)), ink]).astype(float)
    shares = layers.reshape(4, SIDE, FINER, SIDE, FINER).mean(axis=(2, 4))
    rgb = np.rint(np.tensordot(shares, np.array([*PAINTS, INK], float), axes=(0, 0)))
    rgba = np.dstack([rgb, np.full((SIDE, SIDE), 255)]).astype(np.uint8)
    return rgba, shares[:3], np.rint(255 * shares[3]).astype(np.uint8)


def shares_of(ranks: np.ndarray) -> np.ndarray:
    first, second, part = ranks[..., 0], ranks[..., 1], ranks[..., 2] / 255
    paints = np.arange(3)[:, None, None]
    return (first == paints) * part + (second == paints) * (1 - part)


@pytest.mark.parametrize(("width", "grain", "bar"), [(0, 0, 0.01), (2.4, 0, 0.01), (0, 6, 0.06)])
def test_borders_are_finer_than_pixels(width: float, grain: float, bar: float) -> None:
    rgba, truth, contour = disc(width)
    noise = grain * np.random.default_rng(0).standard_normal((SIDE, SIDE, 1))
    rgba[..., :3] = np.rint(rgba[..., :3] + noise).clip(0, 255)
    palette = palette_of(PAINTS)
    (paint,) = paint_maps([rgba], [contour], palette)
    ranks = coverage_map(rgba, paint, contour, palette)
    border = truth.max(axis=0) < 1
    off = np.abs(shares_of(ranks) - truth)[:, border].sum(axis=0) / 2
    whole = np.eye(3)[truth.argmax(axis=0)].transpose(2, 0, 1)
    nearest = np.abs(whole - truth)[:, border].sum(axis=0) / 2
    assert off.mean() < bar
    assert nearest.mean() > 0.2
    assert (ranks[~border][:, 2] == 255).mean() > 0.99
    assert ((ranks[..., 1] != ranks[..., 0]) | (ranks[..., 0] == 255)).all()


def test_lines_of_a_paints_colour_are_that_paint_and_the_background_is_none() -> None:
    rgba, _, contour = disc(2.4)
    rgba[:20, :, 3] = 0
    palette = palette_of((*PAINTS, INK))
    (paint,) = paint_maps([rgba], [contour], palette)
    ranks = coverage_map(rgba, paint, contour, palette)
    assert (ranks[:20] == (255, 255, 0)).all()
    assert (ranks[contour == 255] == (3, 255, 255)).all()
    assert (ranks[20:, :, 0] != 255).all()
