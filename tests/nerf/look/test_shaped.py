"""The drawn look over a mannequin's shape: outlines, inner lines and shadows are the view's own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.nerf.bodies import ARM, PALETTE, Hand, body, camera_at, depths, drawing, own_shape, sheet
from toonset.camera import Camera
from toonset.nerf.look.blend import blend_view
from toonset.nerf.look.build import drawings_of
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.drawn_view import Geometry
from toonset.nerf.look.outline import Outline
from toonset.nerf.render.layers import color_picture
from toonset.nerf.score.metrics import compare


@cache
def drawn(hand: Hand, views: int = 8) -> Drawings:
    scene = sheet(body(), hand, views=views)
    found = drawings_of(
        scene, scene, lambda camera: depths(body(), camera), own_shape(views), bent=False
    )
    assert found is not None
    return found


def misty(camera: Camera) -> Geometry:
    """Return a field that knows neither outline nor depth."""
    size = camera.size_wh[::-1]
    return Geometry(camera, np.full(size, 0.4), np.full(size, np.nan))


@pytest.fixture(scope="module")
def lined() -> Drawings:
    return drawn(Hand())


@pytest.fixture(scope="module")
def shaded() -> Drawings:
    return drawn(Hand(shadow=0.7))


@pytest.mark.parametrize("shadow", [1.0, 0.7])
@pytest.mark.parametrize("degrees", [0.0, 22.5, 100.0])
def test_views_are_what_would_have_been_drawn(
    lined: Drawings, shaded: Drawings, shadow: float, degrees: float
) -> None:
    camera = camera_at(np.radians(degrees))
    view = blend_view(lined if shadow == 1 else shaded, misty(camera))
    true = drawing(body(), camera, Hand(shadow=shadow))
    found = compare(color_picture(view.rgb, view.alpha), true)
    assert found["psnr"] is not None
    assert found["psnr"] > 25
    assert view.by_field < 0.02


def test_lines_at_steps_follow_the_view(lined: Drawings) -> None:
    """The arm lies elsewhere before the belly than in any drawing, and so does its line."""
    camera = camera_at(np.radians(22))
    ink = blend_view(lined, misty(camera)).ink
    exact = drawing(body(), camera)
    inside = depths(body(), camera)
    arm = np.isfinite(inside) & (np.abs(exact[..., :3].astype(int) - ARM).max(axis=-1) < 20)
    rows, columns = np.nonzero(arm)
    row = int(np.median(rows))
    left, right = columns[rows == row].min(), columns[rows == row].max()
    assert ink[row, left - 3 : left].max() > 0.8
    assert ink[row, right + 1 : right + 4].max() > 0.8
    assert ink[arm].mean() < 0.25


def test_a_wider_pen_widens_lines_at_steps_and_none_draws_none(lined: Drawings) -> None:
    shown = misty(camera_at(0.4))
    assert lined.outline is not None
    plain, wide, bare = (
        blend_view(replace(lined, pen=pen), shown)
        for pen in (lined.outline, Outline((90, 0, 120), 2 * lined.outline.width_px), None)
    )
    assert 1.6 < wide.ink.sum() / plain.ink.sum() < 2.2
    assert not bare.ink.any()
    assert (bare.rgb.max(axis=-1)[bare.alpha == 1] > 0.15).all()


def test_recolouring_keeps_the_shadow(shaded: Drawings) -> None:
    shown = misty(camera_at(0.35))
    palette = PALETTE.copy()
    palette[1] = (200, 60, 60)
    before = blend_view(shaded, shown)
    after = blend_view(replace(shaded, repaint=palette), shown)
    belt = (before.labels == 1) & (before.ink == 0) & (before.alpha == 1)
    belt &= np.roll(belt, 2, 0) & np.roll(belt, -2, 0)
    red = after.rgb[belt][:, 0]
    assert red.max() == pytest.approx(200 / 255, abs=0.05)
    assert red.min() == pytest.approx(0.7 * 200 / 255, abs=0.06)


def test_small_views_take_smaller_drawings(lined: Drawings) -> None:
    camera = camera_at(0.4, 60)
    view = blend_view(lined, misty(camera))
    found = compare(color_picture(view.rgb, view.alpha), drawing(body(), camera))
    assert found["psnr"] is not None
    assert found["psnr"] > 17  # lines are scaled, not as many pixels wide
    assert lined.half.views[0].levels is None


def test_a_view_beside_the_shape_is_empty(lined: Drawings) -> None:
    away = camera_at(0.1).moved((1000, 0), (80, 80))
    view = blend_view(lined, misty(away))
    assert not view.alpha.any()


def test_two_drawings_leave_the_rest_to_a_guess() -> None:
    few = drawn(Hand(), views=2)
    view = blend_view(few, misty(camera_at(np.pi / 2)))
    assert np.isfinite(view.rgb).all()
    assert 0.0 < view.by_field < 1
