"""From a scene to its hull: with the hull's corners, or without."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.hull.scene_hull import LEVELS, hull_of
from toonset.nerf.options import TrainOptions

RADIUS, SCALE, SIDE = 1.0, 12.0, 32


def ball(views: int) -> Scene:
    """Return views of a ball at the origin, without distance."""
    frames = []
    for i in range(views):
        yaw = 2 * math.pi * i / views
        camera = Camera.looking_at(np.zeros(3), yaw, 0.0, SCALE, (SIDE, SIDE))
        off = np.linalg.norm(camera.pixel_grid() - SIDE / 2, axis=-1) / SCALE
        rgba = np.full((SIDE, SIDE, 4), 200, dtype=np.uint8)
        rgba[..., 3] = np.clip(255 * (0.5 + (RADIUS - off) * SCALE), 0, 255)
        frames.append(Frame(f"{i}", camera, rgba))
    return Scene(tuple(frames), None, "ball")


def test_the_fair_surface_is_rounder_than_the_hull_as_carved() -> None:
    def volume(*, fairing: bool) -> float:
        hull, _ = hull_of(ball(4), TrainOptions(fairing=fairing))
        assert torch.equal(hull.support, (hull.support * 255).round() / 255)
        assert len(hull.support.unique()) <= LEVELS + 1
        return float(hull.inside.sum()) * hull.voxel**3

    true = 4 / 3 * math.pi * RADIUS**3
    carved = 16 / 3 * RADIUS**3  # two cylinders that cross
    assert abs(volume(fairing=False) / carved - 1) < 0.05
    assert abs(volume(fairing=True) / true - 1) < 0.12


@pytest.mark.parametrize(("views", "kept"), [(8, True), (4, False)])
def test_a_thin_plate_is_kept_by_many_views(views: int, *, kept: bool) -> None:
    """A plate of a third of a pixel, standing through a ball, is in no mask from the side."""
    frames = []
    for frame in ball(views).frames:
        fine = frame.camera.resized(8)
        origins, directions = fine.rays(fine.pixel_grid())
        away = np.linalg.norm(np.cross(origins, directions), axis=-1)
        along = (origins[..., 2] / -directions[..., 2])[..., None]
        x, y, _ = np.moveaxis(origins + along * directions, -1, 0)
        drawn = (away < 0.5) | ((np.abs(x) < 0.8) & (np.abs(y) < 0.9))
        if abs(directions[0, 0, 2]) < 1e-6:  # from its edge
            drawn = (away < 0.5) | ((np.abs(origins[..., 2]) < 1 / 72) & (np.abs(y) < 0.9))
        rgba = frame.rgba.copy()
        rgba[..., 3] = 255 * drawn.reshape(SIDE, 8, SIDE, 8).mean(axis=(1, 3))
        frames.append(Frame(frame.name, frame.camera, rgba))
    hull, _ = hull_of(Scene(tuple(frames), None, "plate"), TrainOptions(missing_views=0))
    places = np.stack(np.meshgrid([-0.7, 0.7], [-0.8, 0.8], [0.0]), axis=-1).reshape(-1, 3)
    support = hull.support_at(torch.as_tensor(places, dtype=torch.float32))
    assert ((support > 0.2) == kept).all()
