"""Turns pass through every drawing, at the drawings' size; previews keep away from them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from toonset.camera import Camera, rotation_distance
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.look.drawing import Drawing
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.render.turntable import (
    FILL,
    RING,
    angles_between,
    between_drawings,
    filled_box,
    ring_of,
    turn_angles,
    turntable,
)
from toonset.nerf.render.views import render
from toonset.nerf.train.result import Training

TURN = 2 * math.pi


def cameras_at(*degrees: Sequence[float], scale: float = 30.0) -> list[Camera]:
    """Return cameras at (yaw, elevation, roll)."""
    angles = np.radians([[*one, 0.0, 0.0][:3] for one in degrees])
    return [
        Camera.looking_at(np.zeros(3), yaw, elevation, scale, (64, 64), roll)
        for yaw, elevation, roll in angles
    ]


def yaws_of(cameras: list[Camera], count: int) -> np.ndarray:
    return np.degrees(turn_angles(ring_of(cameras), count)[:, 0])


def some_yaws(seed: int) -> np.ndarray:
    """Return one to eight yaws in degrees, 2 or more apart."""
    rng = np.random.default_rng(seed)
    return 2.0 * rng.choice(180, int(rng.integers(1, 9)), replace=False) + 0.25


@pytest.mark.parametrize("seed", range(40))
def test_every_drawing_is_a_view_and_the_widest_step_is_the_least(seed: int) -> None:
    drawn = some_yaws(seed)
    apart = np.diff(np.sort(drawn), append=drawn.min() + 360)
    count = len(drawn) + seed % 37
    yaws = yaws_of(cameras_at(*([yaw] for yaw in drawn)), count)
    assert len(yaws) == count
    assert (np.diff(yaws) > 0).all()
    assert yaws[-1] - yaws[0] < 360
    missed = np.abs((drawn[:, None] - yaws + 180) % 360 - 180).min(axis=1)
    assert missed.max() < 1e-9
    step = np.diff(yaws, append=yaws[0] + 360).max()
    needed = np.ceil(apart / step - 1e-9).sum()
    assert needed <= count  # these steps suffice ...
    assert np.ceil(apart / (step - 1e-6)).sum() > count  # ... and no smaller ones would


@pytest.mark.parametrize("drawn", [(0, 45, 90, 180), (0, 90, 180, 270), (0, 180), (90,), (45, 315)])
@pytest.mark.parametrize("count", [8, 24, 72])
def test_drawings_on_the_grid_leave_the_turn_even(drawn: tuple[int, ...], count: int) -> None:
    yaws = yaws_of(cameras_at(*([yaw] for yaw in drawn)), count)
    np.testing.assert_allclose(yaws, 360 * np.arange(count) / count, atol=1e-9)


def test_a_turn_begins_at_the_drawing_that_is_the_front() -> None:
    drawn = cameras_at([175], [354.5], [82])
    for count in (2, 3, 12, 36):
        assert yaws_of(drawn, count)[0] == pytest.approx(-5.5)
    assert abs(yaws_of(cameras_at([90], [270]), 5)[0]) <= 45  # no front is drawn


def test_fewer_views_than_drawings_go_all_round_and_take_drawings_that_are_near() -> None:
    drawn = cameras_at([0], [44], [91], [137], [180])
    np.testing.assert_allclose(yaws_of(drawn, 4), [0, 91, 180, 270], atol=1e-9)
    np.testing.assert_allclose(yaws_of(drawn, 1), [0], atol=1e-9)


def test_views_lean_and_look_as_the_drawings_beside_them() -> None:
    drawn = cameras_at([0, 4, 1], [90, 8, -3], [180, 6, 0], [270, 80, 0])
    ring = ring_of(drawn)
    assert len(ring) == 3  # the one from above is no part of the turn
    found = np.degrees(turn_angles(ring, 8))
    at = {round(float(yaw)): angles for yaw, *angles in found}
    for yaw, tilt in ((0, (4, 1)), (45, (6, -1)), (90, (8, -3)), (180, (6, 0))):
        assert at[yaw] == pytest.approx(tilt)
    assert np.abs(found[:, 1] - 6).max() <= 2
    twins = ring_of(cameras_at([0, 2], [0.4, 5], [359.8, 1], [90, 3]))
    np.testing.assert_allclose(np.degrees(twins[:, :2]), [[0, 2], [90, 3]], atol=1e-9)
    assert np.degrees(RING) > 10


@pytest.mark.parametrize("seed", range(40))
def test_views_between_keep_away_from_drawings(seed: int) -> None:
    ring, count = ring_of(cameras_at(*([yaw] for yaw in some_yaws(seed)))), 1 + seed % 8
    found = angles_between(ring, count)[:, 0]
    assert len(set(np.round(found % TURN, 6))) == count
    arcs = np.diff(ring[:, 0], append=ring[0, 0] + TURN)
    away = np.abs((found[:, None] - ring[:, 0] + math.pi) % TURN - math.pi).min(axis=1)
    widest = arcs.max() / 2 if count == 1 else 0
    assert away.max() >= widest - 1e-9
    assert away.min() >= arcs.min() / 2 - 1e-9 or count > len(ring)
    assert away.min() > 1e-3


def test_views_between_show_the_side_that_nobody_drew() -> None:
    half = ring_of(cameras_at([0], [45], [90], [135], [180]))
    found = np.degrees(angles_between(half, 4)[:, 0])
    assert 270 in np.round(found % 360, 6)
    ring = ring_of(cameras_at(*([45 * i] for i in range(8))))
    apart = np.diff(np.degrees(angles_between(ring, 4)[:, 0]))
    np.testing.assert_allclose(apart, 90, atol=1e-6)


def drawn_by(trained: TrainedField, cameras: list[Camera]) -> TrainedField:
    """Return a field with drawings by cameras, of which only those are looked at."""
    rgba, paint = np.zeros((64, 64, 4), np.uint8), np.zeros((64, 64, 3), np.uint8)
    views = tuple(Drawing(camera, rgba, paint, rgba[..., 0]) for camera in cameras)
    palette = np.zeros((1, 3), np.uint8)
    drawings = Drawings(views, (), None, None, palette, 1.0, (0.0, 1.0), bent=False)
    return replace(trained, drawings=drawings)


def test_a_turn_looks_as_the_drawings_do(training: Training) -> None:
    trained = training.result
    drawn = cameras_at([0, 5, 2], [90, 6, -1], [181, 4, 0], scale=52.0)
    turn = turntable(drawn_by(trained, drawn), 12)
    for camera in drawn:
        nearest = min(rotation_distance(camera.rotation, one.rotation) for one in turn)
        assert nearest < 1e-7
    assert len({(one.scale, one.size_wh, *one.target) for one in turn}) == 1
    middle = turn[1].center
    assert all(np.abs(one.center - middle).max() <= 0.5 for one in turn)
    for camera in drawn:  # a drawing moves by whole pixels into the turn
        own = min(turn, key=lambda one: rotation_distance(camera.rotation, one.rotation))
        away = own.center - camera.project(own.target[None])[0][0]
        np.testing.assert_allclose(away, np.rint(away), atol=1e-9)
    assert turn[0].scale == pytest.approx(52.0, rel=0.2 * trained.k + 1e-9)
    low, high = filled_box(trained.hull)
    assert turn[0].size_wh[0] >= FILL * 52.0 * (high - low).max()
    for camera in turn[::5]:
        alpha = render(trained, camera).alpha
        assert max(alpha[[0, -1]].max(), alpha[:, [0, -1]].max()) == 0
    asked = turntable(drawn_by(trained, drawn), 12, 0.2, 40)
    assert all(one.size_wh == (40, 40) for one in asked)
    np.testing.assert_allclose([one.angles[1:] for one in asked], [[0.2, 0.0]] * 12, atol=1e-9)


def test_what_a_drawing_shows_beside_the_surface_fits_in(training: Training) -> None:
    trained = drawn_by(training.result, cameras_at([0], [90], scale=20.0))
    assert trained.drawings is not None
    usual = turntable(trained, 4)[0]
    wide = np.zeros((64, 64, 4), np.uint8)
    wide[30:34, 2:64] = 255  # a pole, held to one side
    first, *others = trained.drawings.views
    views = (replace(first, rgba=wide), *others)
    drawings = replace(trained.drawings, views=views)
    for image_of in (views[0], replace(views[0], mirrored=True)):
        own = replace(drawings, views=(image_of, *others))
        front = turntable(replace(trained, drawings=own), 4)[0]
        pole_px = first.camera.unproject(np.array([[2.0, 32.0], [64.0, 32.0]]), np.zeros(2))
        inside = front.project(pole_px)[0]
        fits = inside.min() >= 0 and inside.max() <= front.size_wh[0]
        assert fits is not image_of.mirrored
        assert (front.size_wh == usual.size_wh) is image_of.mirrored


def test_without_drawings_turns_are_even_and_level(training: Training) -> None:
    bare = replace(training.result, drawings=None)
    turn = turntable(bare, 4)
    found = np.degrees([one.angles for one in turn]) % 360
    np.testing.assert_allclose(found, [[90 * i, 0, 0] for i in range(4)], atol=1e-9)
    assert turn[0].size_wh == (bare.size_px, bare.size_px)
    assert [len(between_drawings(bare, count, 24)) for count in (1, 4)] == [1, 4]
