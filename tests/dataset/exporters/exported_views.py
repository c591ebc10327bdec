"""Views all round a target, as exports are given them, and where their cameras see it."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from toonset.camera import Camera
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.exporters.common import ExportView
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.load import save_obj
from toonset.mesh import Mesh
from toonset.write import write_bytes, write_json

TARGET = np.array([0.1, 0.9, -0.05])
SHOWN = np.array([[0.2, 1.0, 0.1]])  # where the spot is
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


def noise(size_wh: tuple[int, int], at: tuple[float, float]) -> np.ndarray:
    """Return noise on a transparent ground; its figure is an ellipse, whatever the place."""
    width, height = size_wh
    rgba = np.random.default_rng(width).integers(0, 256, (height, width, 4)).astype(np.uint8)
    v, u = np.mgrid[:height, :width]
    inside = ((u - width / 2) / width) ** 2 + ((v - height / 2) / height) ** 2 < 0.16
    rgba[..., 3] = np.where(inside, 255, 0)
    return rgba


def views_all_round(
    count: int = 5,
    *,
    k: float = 0.0,
    aspect: float = 1.0,
    picture: Callable[[tuple[int, int], tuple[float, float]], np.ndarray] = spot,
) -> tuple[ExportView, ...]:
    """Return views that each have a size, scale, roll and principal point of their own."""
    views = []
    for i in range(count):
        size = (90 + 3 * i, 120 - 2 * i)
        camera = camera_at(i, count, size, SCALE + i, (44.3 + i, 61.7), k)
        camera = replace(camera, pixel_aspect=aspect)
        u, v = camera.project(SHOWN)[0][0].tolist()
        distance = 100 * HEIGHT if k == 0 else 1 / k
        views.append(ExportView(f"{i:03d}.png", picture(size, (u, v)), camera, distance, RADIUS))
    return tuple(views)


def bundle_of(views: tuple[ExportView, ...], folder: Path, mesh: Mesh | None = None) -> Path:
    named = [(f"images/{view.name}", view.camera) for view in views]
    for view in views:
        write_bytes(folder / "images" / view.name, encode_png(view.rgba))
    write_json(folder / "transforms.json", transforms_dict(named, HEIGHT, RADIUS))
    if mesh is not None:
        write_bytes(folder / "mannequin.obj", save_obj(mesh))
    return folder


def around(target: np.ndarray) -> np.ndarray:
    """Return 1,000 points within RADIUS of the target."""
    rng = np.random.default_rng(5)
    direction = rng.normal(size=(1000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return target + direction * RADIUS * rng.random((1000, 1)) ** (1 / 3)


def off_px(pixels: np.ndarray, camera: Camera) -> float:
    points = around(TARGET)
    return float(np.linalg.norm(pixels - camera.project(points)[0], axis=1).max())
