"""A body of two balls, one before the other, drawn as an artist would: lines, shadow, errors.

Bodies, sheets and shapes are made once and belong to all tests: nobody may change them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
import trimesh

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.mesh.rasterize import depth_and_normals, depth_map
from toonset.mesh import Mesh
from toonset.nerf.hull.mannequin_shape import Shape, shape_of
from toonset.nerf.look.step_lines import StepLines, draw_steps

SIDE, FINE, LINE_PX = 150, 3, 2.0
SKIN, BELT, ARM = (240, 200, 160), (60, 60, 160), (90, 150, 60)
PALETTE = np.array([SKIN, BELT, ARM, (10, 10, 10)], dtype=np.uint8)
INK = np.array([10, 10, 10], dtype=np.float32)
STEPS = StepLines(0.05, 1.5, 1.5)
HEIGHT = 1.8


@dataclass(frozen=True)
class Hand:
    """How a sheet is drawn.

    Attributes:
        lines: outlines, and lines at steps of STEPS.
        shadow: colours in shadow over those in light; 1: there is none.
        grain: levels, of noise.
        bend: of the picture's side: a smooth error of every drawing's own.
        beyond_px: as far outlines are drawn outside of the silhouette.
    """

    lines: bool = True
    shadow: float = 1.0
    grain: float = 0.0
    bend: float = 0.0
    beyond_px: float = 0.0


LIGHT = np.array([-0.5, -0.6, -0.6])  # in camera axes, from the surface to it


@cache
def body(scale: float = 1.0, arm: bool = True) -> Mesh:
    """Return a tall ball and a small one before it, at its left."""
    torso = trimesh.creation.icosphere(subdivisions=3)
    vertices, faces = torso.vertices * [0.5 * scale, 0.9, 0.45 * scale], torso.faces
    if arm:
        ball = trimesh.creation.icosphere(subdivisions=2)
        vertices = np.concatenate([vertices, ball.vertices * 0.2 + [0.2, 0.1, 0.75]])
        faces = np.concatenate([faces, ball.faces + len(torso.vertices)])
    return Mesh(np.array(vertices), np.array(faces))


def with_bobble(mesh: Mesh) -> Mesh:
    """Return a body with a small ball on its head."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices = np.concatenate([mesh.vertices, ball.vertices * 0.09 + [0, 0.93, 0]])
    return Mesh(vertices, np.concatenate([mesh.faces, ball.faces + len(mesh.vertices)]))


def camera_at(yaw: float, side: int = SIDE) -> Camera:
    return Camera.looking_at(np.zeros(3), yaw, 0.1, 0.45 * side, (side, side))


def ring(views: int = 8) -> list[Camera]:
    return [camera_at(2 * np.pi * i / views) for i in range(views)]


def drawing(mesh: Mesh, camera: Camera, hand: Hand = Hand(), seed: int = 0) -> np.ndarray:
    """Return what an artist draws of a body, RGBA."""
    fine = camera.resized(FINE)
    depth, normal = depth_and_normals(mesh.vertices, mesh.faces, fine)
    there = np.isfinite(depth)
    points = fine.unproject(fine.pixel_grid(), np.where(there, depth, 0))
    color = np.broadcast_to(np.array(SKIN, np.float32), (*depth.shape, 3)).copy()
    color[np.abs(points[..., 1] + 0.3) < 0.15] = BELT
    color[points[..., 2] > 0.5] = ARM
    color[normal @ LIGHT < 0.3] *= hand.shadow
    if hand.beyond_px:
        outside = cv2.distanceTransform((~there).astype(np.uint8), cv2.DIST_L2, 5)
        there = outside <= hand.beyond_px * FINE
    alpha = _smaller(there.astype(np.float32))
    rgb = _smaller(color * there[..., None]) / np.maximum(alpha, 1e-6)[..., None]
    if hand.lines:
        inside = cv2.distanceTransform(there.astype(np.uint8), cv2.DIST_L2, 5)
        ink = _smaller((inside <= LINE_PX * FINE).astype(np.float32))
        at_steps = draw_steps(np.where(np.isfinite(depth), depth, np.nan), STEPS, HEIGHT, FINE, 1.0)
        ink = np.maximum(ink, at_steps)[..., None]
        rgb = rgb * (1 - ink) + INK * ink
    rng = np.random.default_rng(seed)
    rgb = rgb + hand.grain * rng.normal(size=rgb.shape)
    rgba = np.dstack([rgb * alpha[..., None], 255 * alpha]).astype(np.float32)
    if hand.bend:
        rgba = _bent(rgba, hand.bend, rng)
    rgba[..., :3] *= 255 / np.maximum(rgba[..., 3:], 1e-6)
    return (rgba + 0.5).clip(0, 255).astype(np.uint8)


@cache
def sheet(mesh: Mesh, hand: Hand = Hand(), mannequin: Mesh | None = None, views: int = 8) -> Scene:
    """Return the drawings of a body, every one with its own errors, and a mannequin."""
    frames = [
        Frame(f"{i:03d}.png", camera, drawing(mesh, camera, hand, i))
        for i, camera in enumerate(ring(views))
    ]
    return Scene(tuple(frames), PALETTE, "sheet", mannequin)


@cache
def own_shape(views: int = 8) -> Shape:
    """Return the body as seen from all round."""
    return shape_of(body(), ring(views))


def depths(mesh: Mesh, camera: Camera) -> np.ndarray:
    depth = depth_map(mesh.vertices, mesh.faces, camera)
    return np.where(np.isfinite(depth), depth, np.nan)


def moved(mesh: Mesh, by: tuple[float, float, float]) -> Mesh:
    return replace(mesh, vertices=mesh.vertices + np.array(by))


def _smaller(picture: np.ndarray) -> np.ndarray:
    size = (picture.shape[1] // FINE, picture.shape[0] // FINE)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))


def _bent(rgba: np.ndarray, size: float, rng: np.random.Generator) -> np.ndarray:
    side = rgba.shape[0]
    coarse = rng.normal(size=(5, 5, 2)).astype(np.float32)
    move = size * side * cv2.resize(coarse, (side, side), interpolation=cv2.INTER_CUBIC)
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).astype(np.float32)
    x, y = np.moveaxis(grid + move, -1, 0)
    return np.asarray(cv2.remap(rgba, x, y, cv2.INTER_LINEAR))
