"""From a scene to its hull: with the hull's corners, or without."""

from __future__ import annotations

import math

import numpy as np
import torch

from toonset.camera import Camera
from toonset.dataset.scene import Frame, Scene
from toonset.nerf.options import TrainOptions
from toonset.nerf.shape import LEVELS, hull_of

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
    def volume(*, fair: bool) -> float:
        hull, _ = hull_of(ball(4), TrainOptions(fair=fair))
        assert torch.equal(hull.support, (hull.support * 255).round() / 255)
        assert len(hull.support.unique()) <= LEVELS + 1
        return float(hull.inside.sum()) * hull.voxel**3

    true = 4 / 3 * math.pi * RADIUS**3
    carved = 16 / 3 * RADIUS**3  # two cylinders that cross
    assert abs(volume(fair=False) / carved - 1) < 0.05
    assert abs(volume(fair=True) / true - 1) < 0.12
