"""Borders where drawings meet are smooth; lines, labels and texture beside them stay."""

from __future__ import annotations

import numpy as np
import pytest

from tests.nerf.look.test_choose import INSIDE, X, Y, look_at
from toonset.nerf.look.choose import Look
from toonset.nerf.look.settle import JUMP_PX, discontinuities, settled

INK = (10, 10, 10)
PAINTS = np.array([(200, 60, 60), (60, 200, 60), (60, 60, 200)], np.uint8)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def ragged(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return paint 0 above paint 1, their border ragged by up to two pixels, and its labels."""
    steps = size // 2 + rng.integers(-2, 3, size)
    labels = (np.arange(size)[:, None] >= steps).astype(np.uint8)
    return PAINTS[labels] / np.float32(255), labels


def test_a_ragged_border_is_smooth_and_soft_by_a_pixel(rng: np.random.Generator) -> None:
    size = 400
    color, labels = ragged(rng, size)
    inside = np.ones((size, size), bool)
    breaks = np.zeros_like(inside)
    breaks[size // 2 - 3 : size // 2 + 3] = True
    shown, names = settled(color, labels, breaks, inside, None, 400.0)
    heights = names.argmax(axis=0)[20:-20]
    assert np.abs(np.diff(heights)).mean() < np.abs(np.diff(labels.argmax(axis=0))).mean() / 4
    assert np.abs(heights - size // 2).max() <= 2
    between = np.abs(shown - color[0, 0]).max(axis=-1) * np.abs(shown - color[-1, 0]).max(axis=-1)
    assert 0.5 < (between[:, 20:-20] > 0.01).sum(axis=0).mean() < 3
    far = np.abs(np.arange(size) - size // 2) > 12
    np.testing.assert_array_equal(shown[far], color[far])
    np.testing.assert_array_equal(names[far], labels[far])


@pytest.mark.parametrize("figure_px", [300.0, 1000.0])
@pytest.mark.parametrize("width", [2, 4, 8])
def test_a_line_keeps_its_width_its_label_and_its_paints_texture_where_drawings_meet(
    width: int, figure_px: float
) -> None:
    size = 200
    labels = np.zeros((size, size), np.uint8)
    labels[:, 100:] = 1
    labels[:, 100 - width // 2 : 100 + width // 2] = 3
    color = np.concatenate([PAINTS, [INK]])[labels] / np.float32(255)
    grain = np.random.default_rng(0).normal(0, 0.01, (size, size, 1)).astype(np.float32)
    color = np.where(labels[..., None] < 3, color + grain, color)
    breaks = np.zeros((size, size), bool)
    breaks[100] = True
    pen = (float(width), INK)
    shown, names = settled(color, labels, breaks, np.ones_like(breaks), pen, figure_px)
    dark = (1 - shown.max(axis=-1) / color[0, 0].max()).clip(0.2, 1) - 0.2
    assert dark[100].sum() == pytest.approx(dark[20].sum(), abs=0.35)
    assert abs(int((names[100] == 3).sum()) - width) <= 1
    np.testing.assert_array_equal(shown[100, :80], color[100, :80])  # grain stays


def test_no_black_gets_into_tips_far_from_any_other_paint() -> None:
    color, labels = np.full((120, 120, 3), 0.9, np.float32), np.zeros((120, 120), np.uint8)
    inside = np.zeros((120, 120), bool)
    inside[40:80, 40:80] = inside[20:40, 60] = True  # a spike
    labels[40:80, 40:44], color[40:80, 40:44] = 1, (0.6, 0.3, 0.3)
    shown, _ = settled(color, labels, inside, inside, None, 1000.0)
    assert shown[20:30, 60].min() > 0.85


def test_without_discontinuities_or_a_figure_nothing_is_settled(rng: np.random.Generator) -> None:
    color, labels = ragged(rng, 50)
    nothing, everything = np.zeros((50, 50), bool), np.ones((50, 50), bool)
    for breaks, inside in ((nothing, everything), (everything, nothing)):
        shown, names = settled(color, labels, breaks, inside, None, 50.0)
        assert shown is color
        assert names is labels


def test_discontinuities_are_where_neighbours_show_other_drawings_or_other_places() -> None:
    paint = np.full((*INSIDE.shape, 3), 0.6, np.float32)
    looks = [look_at(paint, 0.5), look_at(paint, 0.5)]
    chosen = np.where(X < 60, 0, 1)
    assert np.flatnonzero(discontinuities(looks, chosen, INSIDE).any(axis=0)).tolist() == [59, 60]
    assert not discontinuities(looks, np.zeros_like(chosen), INSIDE).any()
    folded = X + np.float32(2 * JUMP_PX) * (Y > 30)
    step = Look(looks[0].texture, folded, Y, INSIDE, 1.0, 1.0)
    assert np.flatnonzero(
        discontinuities([step], np.zeros_like(chosen), INSIDE).any(axis=1)
    ).tolist() == [30, 31]
    finer = Look(looks[0].texture, folded, Y, INSIDE, 1.0, 0.4)  # of a pixel of the view
    assert not discontinuities([finer], np.zeros_like(chosen), INSIDE).any()
    disc = (X - 60) ** 2 + (Y - 60) ** 2 < 900
    assert not discontinuities(
        looks, np.where(disc, 0, -1), disc
    ).any()  # an outline does not count
