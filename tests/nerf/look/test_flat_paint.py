"""Drawings as paint alone: without lines, grain and shadow."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.nerf.bodies import ARM, HEIGHT, SKIN, Hand, body, drawing, own_shape, ring, sheet
from toonset.nerf.hull.mannequin_shape import ShapeView
from toonset.nerf.look.flat_paint import FlatPaint, flat_paint
from toonset.nerf.look.outline import outline_of
from toonset.nerf.look.shade import learn_shade, smoothed

FACTOR = 0.7


@cache
def painted(hand: Hand, views: int = 8) -> tuple[FlatPaint, list[ShapeView], list[np.ndarray]]:
    drawn = [drawing(body(), camera, hand, i) for i, camera in enumerate(ring(views))]
    shape = own_shape(views)
    sights = [shape.seen(camera, normals=True) for camera in ring(views)]
    return flat_paint(drawn, outline_of(drawn), sights, HEIGHT), sights, drawn


def off(found: FlatPaint, sights: list[ShapeView], plain: Hand) -> float:
    """Return the mean difference from the body's own colours, levels, inside the figure."""
    exact = [drawing(body(), camera, plain) for camera in ring(len(sights))]
    apart = [
        np.abs(paint.astype(float) - rgba[..., :3])[sight.alpha == 1].mean()
        for paint, rgba, sight in zip(found.paints, exact, sights, strict=True)
    ]
    return float(np.mean(apart))


def test_no_line_is_left_and_paint_lies_under_each() -> None:
    found, sights, drawn = painted(Hand())
    assert found.steps is not None
    assert found.shade is None
    for paint, sight, rgba in zip(found.paints, sights, drawn, strict=True):
        inside = sight.alpha == 1
        assert (rgba[inside][:, :3].max(axis=-1) < 60).any()
        assert (paint[inside].max(axis=-1) < 60).mean() < 0.002
    assert off(found, sights, Hand(lines=False)) < 2.5


def test_each_side_of_a_step_keeps_its_own_paint() -> None:
    found, sights, _ = painted(Hand())
    paint, near = found.paints[0].astype(int), sights[0].depth < -0.6  # the arm, from the front
    near &= np.isfinite(sights[0].depth)
    beside = (sights[0].depth > -0.6) & (sights[0].alpha == 1)
    assert np.abs(paint[near] - ARM).max(axis=-1).mean() < 12
    assert (np.abs(paint[beside] - ARM).max(axis=-1) < 20).mean() < 0.02


def test_a_sheet_without_lines_is_its_own_paint() -> None:
    found, sights, drawn = painted(Hand(lines=False))
    assert found.steps is found.shade is None
    for paint, rgba, sight in zip(found.paints, drawn, sights, strict=True):
        deep = sight.alpha == 1
        wrong = np.abs(paint[deep].astype(int) - rgba[deep][:, :3]).max(axis=-1) > 1
        assert wrong.mean() < 0.06  # the rim's pixels, mixed with what is beside them


def test_a_shape_known_from_drawings_alone_keeps_lines_and_shadows() -> None:
    drawn = [frame.rgba for frame in sheet(body(), Hand(shadow=FACTOR)).frames]
    found = flat_paint(drawn, outline_of(drawn), None, HEIGHT)
    assert found.steps is None
    assert found.shade is None
    assert any((paint.max(axis=-1) < 60).any() for paint in found.paints)


def test_grain_goes_and_clean_paint_stays() -> None:
    noisy, sights, drawn = painted(Hand(lines=False, grain=4.0))
    exact = [drawing(body(), camera, Hand(lines=False)) for camera in ring()]
    deep = [sight.alpha == 1 for sight in sights]
    before, after = (
        np.mean(
            [
                np.abs(a[m][:, :3].astype(float) - b[m][:, :3]).mean()
                for a, b, m in zip(pictures, exact, deep, strict=True)
            ]
        )
        for pictures in (drawn, noisy.paints)
    )
    assert after < 0.6 * before


@pytest.mark.parametrize("factor", [0.6, 0.8])
def test_a_shadow_is_found_and_taken_off(factor: float) -> None:
    found, sights, _ = painted(Hand(shadow=factor))
    assert found.shade is not None
    np.testing.assert_allclose(found.shade.factor, factor, atol=0.05)
    light = -np.array(found.shade.slope)
    true = np.array([-0.5, -0.6, -0.6])
    cosine = light @ true / np.linalg.norm(light) / np.linalg.norm(true)
    assert np.degrees(np.arccos(cosine)) < 25
    assert off(found, sights, Hand(lines=False)) < 6


@pytest.mark.parametrize("hand", [Hand(bend=0.01), Hand(grain=3.0)])
def test_flat_sheets_have_no_shadow(hand: Hand) -> None:
    assert painted(hand)[0].shade is None


def test_a_shadow_that_stays_with_the_world_is_none() -> None:
    """It is paint: it turns with the character, and the left-out drawing tells."""
    shape = own_shape()
    sights = [shape.seen(camera, normals=True) for camera in ring()]
    paints = []
    for sight in sights:
        world = sight.normal @ sight.camera.rotation
        dark = (world @ np.array([0.8, 0.5, 0.2]) < 0.1)[..., None]
        paints.append(np.rint(np.where(dark, 0.7, 1.0) * np.array(SKIN)).astype(np.uint8))
    normals = [smoothed(sight.normal, 135) for sight in sights]
    clear = [sight.alpha == 1 for sight in sights]
    shade, same = learn_shade(paints, normals, clear)
    assert shade is None
    assert all(one is other for one, other in zip(same, paints, strict=True))


def test_casting_a_shadow_undoes_taking_it_off() -> None:
    found, sights, drawn = painted(Hand(shadow=FACTOR, lines=False))
    assert found.shade is not None
    for paint, sight, rgba in zip(found.paints, sights, drawn, strict=True):
        tone = found.shade.tone(smoothed(sight.normal, 135), 3)
        deep = sight.alpha == 1
        wrong = np.abs(paint[deep] * tone[deep] - rgba[deep][:, :3]).max(axis=-1) > 20
        assert wrong.mean() < 0.12


@pytest.mark.parametrize("size", [4, 20])
@pytest.mark.parametrize("value", [0, 255])
@pytest.mark.parametrize("there", [False, True])
def test_black_white_small_and_empty_pictures_have_no_shadow(
    size: int, value: int, there: bool
) -> None:
    paint = np.full((size, size, 3), value, np.uint8)
    normal, clear = np.zeros((size, size, 3), np.float32), np.full((size, size), there)
    assert learn_shade([paint], [normal], [clear]) == (None, [paint])
