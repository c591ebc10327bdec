"""Bends are given back: a key view comes out as it was drawn."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from toonset.nerf.prepare.unwarp import Warp, warped
from toonset.nerf.prepare.warp_back import KeyWarps, give_back, view_shares
from toonset.nerf.run.records import KeysRecord


def test_back_undoes_a_warp(balls) -> None:
    warp = balls.random_warp(0)
    pixels = np.random.default_rng(1).uniform(0, 96, (300, 2))
    there = pixels + warp.at(pixels)
    np.testing.assert_allclose(there + warp.back(there), pixels, atol=2e-3)


def test_a_key_view_comes_out_as_it_was_drawn(balls) -> None:
    cameras = tuple(balls.camera_at(45 * i) for i in range(8))
    keys = KeyWarps(
        cameras, tuple(balls.random_warp(i) for i in range(8)), np.array([0.0, 0.3, 0.0])
    )
    drawn = balls.sheet().frames[2]
    corrected = warped(drawn, keys.warps[2])
    back = give_back({"rgb": corrected.rgba}, cameras[2], keys)["rgb"]
    before = np.abs(corrected.rgba[..., 3].astype(int) - drawn.rgba[..., 3]).mean()
    after = np.abs(back[..., 3].astype(int) - drawn.rgba[..., 3]).mean()
    assert after < 0.5 * before  # what two resamplings leave


def test_a_key_view_of_another_size_is_given_back_alike(balls) -> None:
    keys = KeyWarps((balls.camera_at(0),), (balls.random_warp(4),), np.array([0.0, 0.3, 0.0]))
    frame, large = balls.sheet().frames[0], balls.camera_at(0, side=2 * balls.SIDE)
    small = give_back({0: frame.rgba}, frame.camera, keys)[0]
    wide = give_back({0: balls.draw(large)}, large, keys)[0]
    halved = cv2.resize(wide[..., 3], (balls.SIDE, balls.SIDE), interpolation=cv2.INTER_AREA)
    assert np.abs(halved.astype(int) - small[..., 3]).mean() < 1.0


def test_shares_go_over_from_one_key_view_to_the_next(balls) -> None:
    keys = KeyWarps(
        tuple(balls.camera_at(45 * i) for i in range(8)),
        (Warp.none(),) * 8,
        np.array([0.0, 0.3, 0.0]),
    )
    for i in range(8):
        np.testing.assert_allclose(
            view_shares(balls.camera_at(45 * i), keys), np.eye(8)[i], atol=1e-6
        )
    between = view_shares(balls.camera_at(60), keys)
    np.testing.assert_allclose(between[[1, 2]], [2 / 3, 1 / 3], atol=0.02)
    assert between.sum() == pytest.approx(1, abs=0.01)
    yaws = np.linspace(0, 360, 721)
    all_shares = np.array([view_shares(balls.camera_at(yaw), keys) for yaw in yaws])
    assert np.abs(np.diff(all_shares, axis=0)).max() < 0.03  # no jump anywhere
    assert view_shares(balls.camera_at(10, elevation_deg=88), keys).sum() < 0.6


def test_drawings_without_bends_give_nothing_back(balls) -> None:
    keys = KeyWarps((balls.camera_at(0),), (Warp.none(),), np.zeros(3))
    picture = balls.draw(balls.camera_at(20))
    assert give_back({"rgb": picture}, balls.camera_at(20), keys)["rgb"] is picture


def test_warps_survive_a_file(balls) -> None:
    cameras = (balls.camera_at(0), balls.camera_at(45))
    keys = KeyWarps(cameras, (balls.random_warp(0), Warp.none()), np.ones(3))
    again = KeysRecord.model_validate_json(KeysRecord.of(keys).model_dump_json()).keys()
    np.testing.assert_array_equal(again.middle, keys.middle)
    pixels = np.random.default_rng(1).uniform(0, 96, (30, 2))
    for one, other in zip(keys.warps, again.warps, strict=True):
        np.testing.assert_array_equal(one.at(pixels), other.at(pixels))
    for one, other in zip(keys.cameras, again.cameras, strict=True):
        np.testing.assert_array_equal(one.project(np.eye(3))[0], other.project(np.eye(3))[0])
