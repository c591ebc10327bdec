"""A figure of five balls, drawn exactly, bent, or out of place, without any renderer."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import cv2
import numpy as np

from tests.nerf.ellipsoids import Parts, first_hit
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.synthetic.hand_error import displacement_field

SIDE = 96
BALLS = (  # middle, half axes: body, head, two arms, a pack
    ((0.0, 0.0, 0.0), (0.35, 0.6, 0.3)),
    ((0.0, 0.85, 0.05), (0.35, 0.35, 0.35)),
    ((0.5, 0.2, 0.1), (0.3, 0.1, 0.1)),
    ((-0.55, 0.1, 0.0), (0.3, 0.12, 0.1)),
    ((0.2, 0.1, -0.4), (0.2, 0.3, 0.2)),
)


def camera_at(yaw_deg: float, elevation_deg: float = 8.0, side: int = SIDE) -> Camera:
    return Camera.looking_at(
        np.array([0.0, 0.3, 0.0]),
        math.radians(yaw_deg),
        math.radians(elevation_deg),
        0.36 * side,
        (side, side),
        k=0.1,
    )


def draw(camera: Camera, balls: Parts = BALLS) -> np.ndarray:
    """Return the balls' picture: coloured by place, so that what moves can be seen."""
    hit = first_hit(camera.resized(4), balls)[0] >= 0
    side = camera.size_wh[0]
    alpha = hit.reshape(side, 4, side, 4).mean(axis=(1, 3))
    grid = camera.pixel_grid() / side
    rgba = np.dstack([grid[..., 0], grid[..., 1], 0.5 + 0 * alpha, alpha])
    rgba[..., :3] *= alpha[..., None] > 0
    return (rgba * 255 + 0.5).astype(np.uint8)


@cache
def sheet(views: int = 8, side: int = SIDE) -> Scene:
    cameras = [camera_at(360 * i / views, side=side) for i in range(views)]
    frames = [Frame(f"{i:03d}.png", camera, draw(camera)) for i, camera in enumerate(cameras)]
    return Scene(tuple(frames), None, "balls")


@cache
def bent_sheet(rms_px: float = 1.5) -> tuple[Scene, tuple[np.ndarray, ...]]:
    frames, fields = [], []
    for i, frame in enumerate(sheet().frames):
        figure = frame.rgba[..., 3] > 127
        field = displacement_field(np.random.default_rng(i), figure, rms_px)
        place = (frame.camera.pixel_grid() + field - 0.5).astype(np.float32)
        across, down = place[..., 0].copy(), place[..., 1].copy()
        rgba = cv2.remap(frame.rgba, across, down, cv2.INTER_LINEAR)
        frames.append(replace(frame, rgba=rgba))
        fields.append(field)
    return replace(sheet(), frames=tuple(frames)), tuple(fields)


@cache
def misplaced(seed: int) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Return the sheet with every drawing shifted by up to 3 px and sized by up to 3 %."""
    generator = np.random.default_rng(seed)
    shifts, sizes = generator.uniform(-3, 3, (8, 2)), generator.uniform(0.97, 1.03, 8)
    frames = []
    for frame, shift, size in zip(sheet().frames, shifts, sizes, strict=True):
        offset = shift + SIDE / 2 * (1 - size) + 0.5 * (size - 1)
        matrix = np.array([[size, 0, offset[0]], [0, size, offset[1]]])
        alpha = cv2.warpAffine(frame.rgba[..., 3], matrix, (SIDE, SIDE), flags=cv2.INTER_LINEAR)
        rgba = np.dstack([np.full((SIDE, SIDE, 3), 128, np.uint8), alpha])
        frames.append(replace(frame, rgba=rgba))
    return replace(sheet(), frames=tuple(frames)), shifts, sizes
