"""A painted egg with an outline, drawn exactly from anywhere: two eyes, a belt, a patch behind."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import torch

from tests.nerf.ellipsoids import first_hit
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.hull.hull import Hull
from toonset.nerf.look.build import drawings_of
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.drawn_view import Geometry

SIDE, FINE, LINE_PX = 120, 4, 2.0
AXES = np.array([0.6, 0.9, 0.5])
SKIN, EYE, BELT, PATCH = (240, 200, 160), (40, 60, 160), (200, 40, 40), (60, 160, 60)
PALETTE = np.array([SKIN, EYE, BELT, PATCH], dtype=np.uint8)
INK = (10, 10, 10)
ARM = (120, 30, 160)


def camera_at(yaw: float, elevation: float = 0.0, side: int = SIDE) -> Camera:
    return Camera.looking_at(np.zeros(3), yaw, elevation, 0.5 * side, (side, side))


def ring(views: int = 8) -> list[Camera]:
    return [camera_at(2 * np.pi * i / views) for i in range(views)]


def surface(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return the world points that pixels show, and which show any."""
    which, points = first_hit(camera, [(np.zeros(3), AXES)])
    return points, which == 0


def depth_of(camera: Camera) -> np.ndarray:
    points, seen = surface(camera)
    return np.where(seen, (points - camera.target) @ camera.rotation[2], np.nan)


def paint_of(points: np.ndarray) -> np.ndarray:
    """Return the palette index of every place."""
    x, y, z = np.moveaxis(points, -1, 0)
    label = np.zeros(x.shape, dtype=int)
    label[np.abs(y + 0.25) < 0.1] = 2
    label[(z < 0) & (np.hypot(x, y - 0.3) < 0.25)] = 3
    for side in (-1, 1):
        label[(z > 0) & (np.hypot(x - 0.22 * side, y - 0.35) < 0.1)] = 1
    return label


def draw(
    camera: Camera,
    *,
    line_px: float = LINE_PX,
    bend: np.ndarray | None = None,
    gain: tuple[float, float, float] = (1, 1, 1),
) -> np.ndarray:
    """Return the RGBA drawing; `bend` says where every pixel's paint comes from, pixels."""
    fine = camera.resized(FINE)
    points, seen = surface(fine)
    color = PALETTE[paint_of(points)].astype(np.float32) * np.array(gain, dtype=np.float32)
    inside = cv2.distanceTransform(seen.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    color[inside <= line_px * FINE] = INK
    rgba = np.dstack([color * seen[..., None], 255.0 * seen]).astype(np.float32)
    if bend is not None:
        size = rgba.shape[1::-1]
        grid = np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), -1).astype(np.float32)
        places = grid + FINE * cv2.resize(bend.astype(np.float32), size)
        rgba = cv2.remap(rgba, places[..., 0], places[..., 1], cv2.INTER_LINEAR)
    rows, columns = camera.size_wh[::-1]
    mean = rgba.reshape(rows, FINE, columns, FINE, 4).mean(axis=(1, 3))
    mean[..., :3] *= 255 / np.maximum(mean[..., 3:], 1e-6)
    return (mean + 0.5).clip(0, 255).astype(np.uint8)


def scene_of(cameras: list[Camera], line_px: float = LINE_PX) -> Scene:
    frames = [Frame(f"{i:03d}.png", c, draw(c, line_px=line_px)) for i, c in enumerate(cameras)]
    return Scene(tuple(frames), PALETTE, "egg")


def drawings(cameras: list[Camera] | None = None, line_px: float = LINE_PX) -> Drawings:
    scene = scene_of(cameras or ring(), line_px)
    found = drawings_of(scene, scene, depth_of, bent=False)
    assert found is not None
    return found


def geometry(camera: Camera) -> Geometry:
    """Return what a perfect field would show."""
    _, seen = surface(camera.resized(FINE))
    rows, columns = camera.size_wh[::-1]
    alpha = seen.reshape(rows, FINE, columns, FINE).mean(axis=(1, 3))
    depth = np.where(alpha >= 0.5, depth_of(camera), np.nan)
    return Geometry(camera, alpha, depth)


def unseen(view: Geometry) -> Geometry:
    return replace(view, alpha=np.zeros_like(view.alpha), depth=np.full_like(view.depth, np.nan))


def with_an_arm() -> Drawings:
    """Return drawings, the first of which alone shows an arm that the field lacks."""
    scene = scene_of(ring())
    rgba = scene.frames[0].rgba.copy()
    rgba[54:64, 80:116] = (*ARM, 255)
    scene = replace(scene, frames=(replace(scene.frames[0], rgba=rgba), *scene.frames[1:]))
    at = np.stack(np.meshgrid(*[np.arange(40) * 0.05 - 0.975] * 3, indexing="ij"), axis=-1)
    inside = ((at / AXES) ** 2).sum(axis=-1) < 1
    hull = Hull(np.full(3, -1.0), 0.05, torch.as_tensor(inside.astype(np.float32)))
    found = drawings_of(scene, scene, depth_of, hull=hull, bent=False)
    assert found is not None
    return found
