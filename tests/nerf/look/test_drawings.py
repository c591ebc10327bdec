"""Drawings as textures, their outline, and the flow between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.nerf.look.painted import (
    LINE_PX,
    PALETTE,
    camera_at,
    depth_of,
    draw,
    drawings,
    ring,
    scene_of,
    surface,
)
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.look.build import drawings_of
from toonset.nerf.look.crisp_depth import crisp_depth
from toonset.nerf.look.drawing import depth_of as depth_of_levels
from toonset.nerf.look.drawing import levels_of
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.outline import crisp_outline, outline_of, without_crumbs
from toonset.nerf.look.paint_flow import neighbours
from toonset.nerf.look.texture import look_up


def test_the_outlines_width_is_measured() -> None:
    found = outline_of([draw(camera) for camera in ring(4)])
    assert found is not None
    assert found.width_px == pytest.approx(LINE_PX, abs=0.15)
    assert max(found.rgb) < 16
    assert outline_of([draw(camera, line_px=0.0) for camera in ring(4)]) is None
    assert outline_of([]) is None


def test_a_soft_border_becomes_crisp_and_stays_where_it_is() -> None:
    y, x = np.mgrid[:100, :100] - 49.5
    soft = 1 / (1 + np.exp(-(30 - np.hypot(x, y)) / 2))
    alpha, ink = crisp_outline(soft, 0.5, 3.0, 60.0)
    exact = np.pi * 30**2
    assert alpha.sum() == pytest.approx(exact, rel=0.01)
    assert ((alpha > 0.01) & (alpha < 0.99)).sum() < 4 * np.pi * 30
    assert ink.sum() == pytest.approx(exact - np.pi * 27**2, rel=0.03)
    assert (ink <= alpha).all()
    inner, _ = crisp_outline(soft, 0.65, 0.0, 60.0)
    radius = 30 - 2 * np.log(0.65 / 0.35)  # where the coverage is 0.65
    assert inner.sum() == pytest.approx(np.pi * radius**2, rel=0.01)


def test_crumbs_pinholes_and_holes_go_up_to_their_size() -> None:
    whole = np.zeros((20, 20), dtype=bool)
    whole[3:18, 3:18] = True
    dotted, torn = whole.copy(), whole.copy()
    dotted[10, 10], dotted[1, 1] = False, True
    torn[8:11, 8:11] = False
    np.testing.assert_array_equal(without_crumbs(dotted, 4), whole)
    np.testing.assert_array_equal(without_crumbs(torn, 4, 10), whole)
    np.testing.assert_array_equal(without_crumbs(torn, 4), torn)


def test_levels_of_depth_come_back_within_half_a_level() -> None:
    depth = np.array([[np.nan, -1.0, 0.3, 2.0]])
    levels = levels_of(depth, (-1.0, 2.0))
    back = depth_of_levels(levels, (-1.0, 2.0))
    assert levels.tolist()[0][:2] == [0, 1]
    assert levels[0, 3] == 255
    np.testing.assert_allclose(back[0, 1:], depth[0, 1:], atol=1.5 / 254)
    np.testing.assert_array_equal(levels_of(back, (-1.0, 2.0)), levels)


def test_a_drawing_shows_its_own_side_only(egg: Drawings) -> None:
    camera = camera_at(0.6)
    points, seen = surface(camera)
    front = look_up(egg.textures[0], points, 0.05, 4)
    back = look_up(egg.textures[4], points, 0.05, 4)
    there = front.mask[seen].mean()
    assert 0.75 < there < 1
    assert back.mask[seen].mean() < 0.2
    assert (points[front.mask & seen][:, 2] > -0.15).all()


def test_depth_has_no_mixtures_of_near_and_far() -> None:
    depth = np.full((9, 9), np.nan)
    depth[2:7, 2:7] = 1.0
    depth[2:7, 4] = 1.7
    depth[2:7, 5:7] = 2.0
    crisp = crisp_depth(depth)
    assert crisp[4, 4] == pytest.approx(1.85)
    assert np.isfinite(crisp).all()


def test_neighbours_follow_each_other_round_the_figure(egg: Drawings) -> None:
    pairs = {(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7), (0, 7)}
    assert set(neighbours(egg)) == pairs
    assert neighbours(drawings(ring(2))) == []  # front and back show nothing in common
    assert neighbours(drawings([camera_at(0.0), camera_at(0.7)])) == [(0, 1)]


def test_drawings_that_agree_are_not_floated(egg: Drawings) -> None:
    found = next(flow for flow in egg.flows if flow.pair == (0, 1))
    eyes = np.array([[[0.22, 0.35, 0.4], [-0.22, 0.35, 0.4]]])  # a belt says nothing across
    assert np.abs(found.at(eyes)).max() < 0.5


@pytest.mark.parametrize("shift", [(3.0, 0.0), (0.0, -2.0)])
def test_paint_that_lies_apart_is_found(shift: tuple[float, float]) -> None:
    """The second drawing's paint moved by `shift`: F at the eyes is that."""
    cameras = [camera_at(-0.2), camera_at(0.2)]
    moved = np.broadcast_to(-np.array(shift), (120, 120, 2))
    frames = (
        Frame("a.png", cameras[0], draw(cameras[0])),
        Frame("b.png", cameras[1], draw(cameras[1], bend=moved)),
    )
    scene = Scene(frames, PALETTE, "egg")
    found = drawings_of(scene, scene, depth_of, bent=False)
    assert found is not None
    middle = np.array([[[0.0, 0.35, 0.45]]])  # between the eyes
    flow = found.flows[0].at(middle)[0, 0]
    np.testing.assert_allclose(flow, shift, atol=0.8)


def test_colours_stand_in_for_a_missing_palette() -> None:
    scene = replace(scene_of(ring()), palette=None)
    found = drawings_of(scene, scene, depth_of, bent=False)
    assert found is not None
    near = np.abs(found.palette.astype(int) - (240, 200, 160)).max(axis=1).min()
    assert near <= 16
    empty = replace(scene.frames[0], rgba=np.zeros_like(scene.frames[0].rgba))
    nothing = replace(scene, frames=(empty,))
    assert drawings_of(nothing, nothing, depth_of, bent=False) is None
