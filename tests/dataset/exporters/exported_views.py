"""Views all round a target, as exports are given them, and where their cameras see it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from toonset.camera import Camera
from toonset.dataset.exporters.common import ExportView
from toonset.mesh import Mesh

TARGET = np.array([0.1, 0.9, -0.05])
RADIUS, HEIGHT, SCALE = 1.0, 1.8, 47.0
MODELS = pytest.mark.parametrize("k", [0.0, 0.2], ids=["orthographic", "pinhole"])


def spot(size_wh: tuple[int, int], at: tuple[float, float], sigma: float = 6.0) -> np.ndarray:
    """Return a soft red spot; its centre of mass tells where the picture went."""
    width, height = size_wh
    v, u = np.mgrid[:height, :width] + 0.5
    alpha = 255 * np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2) / (2 * sigma**2))
    rgba = np.zeros((height, width, 4), np.uint8)
    rgba[..., 0], rgba[..., 3] = 200, np.rint(alpha)
    return rgba


def egg() -> Mesh:
    """Return a body of few faces: 1.8 high, on the ground."""
    sphere = trimesh.creation.icosphere(2)
    vertices = np.asarray(sphere.vertices) * [0.4, 0.9, 0.3] + [0.1, 0.9, -0.05]
    return Mesh(vertices, np.asarray(sphere.faces))


def camera_at(
    i: int,
    count: int,
    size_wh: tuple[int, int],
    scale: float,
    center: tuple[float, float],
    k: float,
) -> Camera:
    """Return one of `count` cameras round TARGET, its elevation and roll unlike the others'."""
    return Camera.looking_at(
        TARGET,
        yaw=2 * math.pi * i / count + 0.2,
        elevation=0.1 * i - 0.2,
        roll=0.05 * i,
        scale=scale,
        size_wh=size_wh,
        center=np.array(center),
        k=k,
    )


def views_all_round(
    count: int = 5, *, k: float = 0.0, aspect: float = 1.0
) -> tuple[ExportView, ...]:
    """Return views that each have a size, scale, roll and principal point of their own."""
    views = []
    for i in range(count):
        size = (90 + 3 * i, 120 - 2 * i)
        camera = camera_at(i, count, size, SCALE + i, (44.3 + i, 61.7), k)
        camera = replace(camera, pixel_aspect=aspect)
        shown = camera.project(np.array([[0.2, 1.0, 0.1]]))[0][0]
        distance = 100 * HEIGHT if k == 0 else 1 / k
        rgba = spot(size, (float(shown[0]), float(shown[1])))
        views.append(ExportView(f"{i:03d}.png", rgba, camera, distance, RADIUS))
    return tuple(views)


def around(target: np.ndarray) -> np.ndarray:
    """Return 1,000 points within RADIUS of the target."""
    rng = np.random.default_rng(5)
    direction = rng.normal(size=(1000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return target + direction * RADIUS * rng.random((1000, 1)) ** (1 / 3)


def off_px(pixels: np.ndarray, camera: Camera) -> float:
    points = around(TARGET)
    return float(np.linalg.norm(pixels - camera.project(points)[0], axis=1).max())
