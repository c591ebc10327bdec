"""A figure whose pictures are computed exactly: coloured ellipsoids."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.options import TrainOptions

SIDE, FINE = 48, 3
PARTS = (  # middle, half axes, colour: body, head, a pack on one side of the back
    ((0.0, 0.0, 0.0), (0.45, 0.7, 0.35), (200, 40, 40)),
    ((0.0, 0.9, 0.05), (0.4, 0.4, 0.4), (240, 200, 160)),
    ((0.3, 0.1, -0.4), (0.25, 0.35, 0.25), (40, 80, 200)),
)
QUICK = TrainOptions(steps=60, device="cpu", missing_views=0)


def draw(camera: Camera) -> np.ndarray:
    """Return the RGBA picture of the ellipsoids, area-averaged."""
    fine = camera.resized(FINE)
    origins, directions = fine.rays(fine.pixel_grid())
    best = np.full(origins.shape[:2], np.inf)
    color = np.zeros((*best.shape, 4))
    for middle, axes, rgb in PARTS:
        o, d = (origins - middle) / axes, directions / axes
        a, b, c = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
        inside = b * b - a * c
        t = (-b - np.sqrt(np.maximum(inside, 0))) / a
        nearer = (inside > 0) & (t < best)
        best[nearer] = t[nearer]
        color[nearer] = (*np.array(rgb) / 255, 1)
    mean = color.reshape(SIDE, FINE, SIDE, FINE, 4).mean(axis=(1, 3))
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
