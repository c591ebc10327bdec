"""A figure whose pictures are computed exactly: coloured ellipsoids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.options import TrainOptions

Parts = Sequence[tuple[Any, Any]]  # middle and half axes
SIDE, FINE = 48, 3
PARTS = (  # middle, half axes, colour: body, head, a pack on one side of the back
    ((0.0, 0.0, 0.0), (0.45, 0.7, 0.35), (200, 40, 40)),
    ((0.0, 0.9, 0.05), (0.4, 0.4, 0.4), (240, 200, 160)),
    ((0.3, 0.1, -0.4), (0.25, 0.35, 0.25), (40, 80, 200)),
)
QUICK = TrainOptions(steps=60, device="cpu", missing_views=0)


def first_hit(camera: Camera, parts: Parts) -> tuple[np.ndarray, np.ndarray]:
    """Return which ellipsoid every pixel shows, -1: none, and where in the world."""
    origins, directions = camera.rays(camera.pixel_grid())
    which, best = np.full(origins.shape[:2], -1), np.full(origins.shape[:2], np.inf)
    for number, (middle, axes) in enumerate(parts):
        o, d = (origins - middle) / axes, directions / axes
        a, b, c = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
        inside = b * b - a * c
        t = (-b - np.sqrt(np.maximum(inside, 0))) / a
        nearer = (inside > 0) & (t < best)
        which[nearer], best[nearer] = number, t[nearer]
    return which, origins + np.where(which < 0, 0, best)[..., None] * directions


def draw(camera: Camera) -> np.ndarray:
    """Return the RGBA picture of the ellipsoids, area-averaged."""
    which, _ = first_hit(camera.resized(FINE), [(middle, axes) for middle, axes, _ in PARTS])
    table = np.array([*((*np.array(rgb) / 255, 1) for *_, rgb in PARTS), (0, 0, 0, 0)])
    mean = table[which].reshape(SIDE, FINE, SIDE, FINE, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], 1e-9)
    return (mean * 255 + 0.5).astype(np.uint8)


def scene_of(yaws: list[float], elevation: float, k: float, unit: float = 1.0) -> Scene:
    """Return the drawn scene in a world of `unit` times the size (drawn in the world of 1)."""
    frames = []
    for i, yaw in enumerate(yaws):
        camera = Camera.looking_at(np.array([0, 0.3, 0]), yaw, elevation, 19.0, (SIDE, SIDE), k=k)
        moved = replace(
            camera, target=camera.target * unit, scale=camera.scale / unit, k=camera.k / unit
        )
        frames.append(Frame(f"{i:03d}.png", moved, draw(camera)))
    return Scene(tuple(frames), None, "ellipsoids")


def train_scene(k: float = 0.15, unit: float = 1.0) -> Scene:
    return scene_of([2 * np.pi * i / 8 for i in range(8)], 0.1, k, unit)


def held_out(k: float = 0.15, unit: float = 1.0) -> Scene:
    return scene_of([0.3, 1.9, 4.1], 0.2, k, unit)
