"""Cameras turned off the drawings: those that were estimated turn back, others never."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from toonset.camera import rotation_from_angles
from toonset.dataset.bundle.scene import Scene
from toonset.nerf.options import TrainOptions
from toonset.nerf.prepare.prepare import prepared
from toonset.nerf.prepare.refine_yaw import Turning, turned

LEFT = 0.65  # of the error: round figures and opposite views tell little of yaws


def with_sigmas(scene: Scene, *sigmas_deg: float) -> Scene:
    frames = [
        replace(frame, yaw_sigma=math.radians(sigmas_deg[i % len(sigmas_deg)]))
        for i, frame in enumerate(scene.frames)
    ]
    return replace(scene, frames=tuple(frames))


def turned_off(scene: Scene, yaws_deg: np.ndarray) -> Scene:
    frames = []
    for frame, yaw_deg in zip(scene.frames, yaws_deg, strict=True):
        yaw, elevation, roll = frame.camera.angles
        rotation = rotation_from_angles(yaw + math.radians(yaw_deg), elevation, roll)
        frames.append(replace(frame, camera=replace(frame.camera, rotation=rotation)))
    return replace(scene, frames=tuple(frames))


def off_deg(scene: Scene, truth: Scene) -> np.ndarray:
    apart = [
        a.camera.angles[0] - b.camera.angles[0]
        for a, b in zip(scene.frames, truth.frames, strict=True)
    ]
    return (np.degrees(apart) + 180) % 360 - 180


def errors(seed: int, rms_deg: float = 4.0) -> np.ndarray:
    numbers = np.random.default_rng(seed).normal(size=8)
    numbers -= numbers.mean()
    return rms_deg * numbers / numbers.std()


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_yaws_are_found_within_their_sigmas(balls, seed: int) -> None:
    scene = with_sigmas(turned_off(balls.sheet(), errors(seed)), 2.0)
    result, found = turned(scene)
    assert found is not None
    assert found.applied
    left = off_deg(result, balls.sheet())
    assert left.std() < LEFT * errors(seed).std()
    assert abs(left.mean()) < 1e-6  # the whole body's turn cannot be told
    assert found.apart_px[1] < 0.5 * found.apart_px[0]
    told = np.degrees([view.yaw for view in found.views])
    np.testing.assert_allclose(told, off_deg(result, scene), atol=1e-9)
    for before, after in zip(scene.frames, result.frames, strict=True):
        assert after.rgba is before.rgba
        np.testing.assert_allclose(after.camera.angles[1:], before.camera.angles[1:], atol=1e-9)


@pytest.mark.parametrize("known", ["no sigma", "one without", "sigma 0"])
def test_cameras_that_are_known_stay_to_the_bit(balls, known: str) -> None:
    off = turned_off(balls.sheet(), errors(0))
    scene = {"no sigma": off, "sigma 0": with_sigmas(off, 0.0)}.get(known, with_sigmas(off, 2.0))
    if known == "one without":
        scene = replace(scene, frames=(replace(scene.frames[0], yaw_sigma=None), *scene.frames[1:]))
    result, found = turned(scene)
    assert result is scene
    assert found is None


def test_a_camera_with_a_locked_yaw_keeps_it(balls) -> None:
    off = errors(1)
    off[::2] = 0
    result, found = turned(with_sigmas(turned_off(balls.sheet(), off), 0.0, 2.0))
    assert found is not None
    assert found.applied
    left = off_deg(result, balls.sheet())
    assert np.abs(left[::2]).max() < 1e-9
    assert left[1::2].std() < LEFT * off[1::2].std()


def test_drawings_that_agree_stay(balls) -> None:
    scene = with_sigmas(balls.sheet(), 2.0)
    result, found = turned(scene)
    assert result is scene
    assert found is not None
    assert not found.applied


def test_narrow_sigmas_hold(balls) -> None:
    wide, narrow = (
        turned(with_sigmas(turned_off(balls.sheet(), errors(2)), sigma))[1] for sigma in (2.0, 0.1)
    )
    assert wide is not None
    assert narrow is not None
    moves = [np.abs([view.yaw for view in found.views]).max() for found in (wide, narrow)]
    assert moves[1] < 0.3 * moves[0]


def test_where_drawings_bend_cameras_do_not_turn(balls) -> None:
    drawn = with_sigmas(balls.bent_sheet()[0], 2.0)
    for unbend in (True, False):
        ready = prepared(drawn, TrainOptions(unbend=unbend))
        assert ready.turning is not None
        assert ready.turning.gain_nats > 0  # bends pass for turns, but explain themselves better
        assert not ready.turning.applied
        assert np.abs(off_deg(ready.scene, drawn)).max() == 0


def test_turns_that_leave_drawings_bent_are_not_believed(balls, monkeypatch) -> None:
    """However much they explain: with five views bends can pass for turns."""
    drawn = with_sigmas(balls.bent_sheet()[0], 2.0)

    def sure(scene: Scene) -> tuple[Scene, Turning | None]:
        result, found = turned(scene)
        assert found is not None
        return result, replace(found, gain_nats=1e6)

    monkeypatch.setattr("toonset.nerf.prepare.prepare.turned", sure)
    ready = prepared(drawn, TrainOptions())
    assert ready.turning is not None
    assert not ready.turning.applied
    assert np.abs(off_deg(ready.scene, drawn)).max() == 0


def test_turns_are_made_and_switched_off(balls) -> None:
    scene = with_sigmas(turned_off(balls.sheet(), errors(0)), 2.0)
    ready = prepared(scene, TrainOptions())
    assert ready.turning is not None
    assert ready.turning.applied
    assert off_deg(ready.scene, balls.sheet()).std() < LEFT * errors(0).std()
    assert 0 < ready.apart_px <= ready.turning.apart_px[1]
    again = json.loads(json.dumps(ready.to_json(), allow_nan=False))
    assert len(again["turning"]["views"]) == 8
    for options in (TrainOptions(turn=False), TrainOptions(register=False)):
        kept = prepared(scene, options)
        assert kept.turning is None
        assert np.abs(off_deg(kept.scene, scene)).max() == 0
