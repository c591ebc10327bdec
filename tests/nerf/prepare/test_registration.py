"""Drawings placed and sized off: the cameras follow, the pixels stay."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.nerf.prepare import balls
from toonset.nerf.prepare.registration import register_drawings


@pytest.mark.parametrize("views", [2, 3, 8])
def test_a_perfect_sheet_keeps_its_cameras(views: int) -> None:
    result, found = register_drawings(balls.sheet(views))
    assert result is balls.sheet(views)
    assert not found.applied
    assert found.gain_nats <= 0
    assert len(found.views) == views


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_shifts_and_sizes_are_found(seed: int) -> None:
    scene, shifts, sizes = balls.misplaced(seed)
    result, found = register_drawings(scene)
    assert found.applied
    scales = np.array([view.scale for view in found.views])
    np.testing.assert_allclose(scales / scales.mean(), sizes / sizes.mean(), atol=0.016)
    left = np.array(
        [
            after.camera.center - before.camera.center - shift
            for before, after, shift in zip(
                balls.sheet().frames, result.frames, shifts, strict=True
            )
        ]
    )
    # The body has no place of its own, and outlines say nothing of what is between two sides:
    # told are heights against each other, and each side against the one opposite to it.
    assert np.abs(left[:, 1] - left[:, 1].mean()).max() < 1.0
    assert np.abs(left[:4, 0] + left[4:, 0]).max() < 1.0
    assert np.sqrt((shifts**2).mean()) > 1
    for before, after in zip(scene.frames, result.frames, strict=True):
        assert after.rgba is before.rgba
        np.testing.assert_array_equal(after.camera.rotation, before.camera.rotation)
    said = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert (said["applied"], len(said["views"])) == (True, 8)
    assert said["apart_px"][1] < said["apart_px"][0]


def test_the_body_stays_where_it_stands() -> None:
    """What all drawings share is no error: taken for one, it would push the body off its place."""
    scene, _ = balls.bent_sheet()
    result, _ = register_drawings(scene)
    moves = []
    for before, after in zip(scene.frames, result.frames, strict=True):
        pixels = before.camera.pixel_grid()[before.rgba[..., 3] > 127]
        ratio = after.camera.scale / before.camera.scale
        place = after.camera.center + ratio * (pixels - before.camera.center)
        moves.append((place - pixels).mean(axis=0))
    assert np.abs(moves).max() > 0.3
    for axis in np.eye(3) / 2:
        ends = np.array([0.0, 0.3, 0.0]) + np.stack([axis, -axis])
        aside = np.array([-np.diff(f.camera.project(ends)[0], axis=0)[0] for f in scene.frames])
        assert abs((aside * np.array(moves)).sum() / np.square(aside).sum()) < 5e-4  # world units


def test_registering_twice_changes_little() -> None:
    scene, _, _ = balls.misplaced(1)
    once, _ = register_drawings(scene)
    _, again = register_drawings(once)
    assert again.apart_px[0] < 0.6
    shifts = np.array([view.shift_px for view in again.views])
    assert np.abs(shifts).max() < 1.0
