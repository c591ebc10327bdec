"""Sample the views' alpha at points of the world, and how far the views agree."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from torch import Tensor

from toonset.camera import MIN_RELATIVE_DEPTH, Camera

MOST_MOVE = 1 / 8  # of the picture: where a ball appears larger, nothing is said of it


def agreement(
    points_world: Float[Tensor, "n 3"],
    cameras: Sequence[Camera],
    alphas: Sequence[Float[Tensor, "height width"]],
    missing: int,
) -> Float[Tensor, " n"]:
    """Return the (missing + 1)-th smallest of the views' alphas at the points."""
    views = zip(cameras, alphas, strict=True)
    return _ranked((alpha_at(points_world, *view) for view in views), missing)


def agreement_within(
    points_world: Float[Tensor, "n 3"],
    radius: float,
    cameras: Sequence[Camera],
    alphas: Sequence[Float[Tensor, "height width"]],
    missing: int,
) -> tuple[Float[Tensor, " n"], Float[Tensor, " n"]]:
    """Return bounds of the agreement anywhere in the balls around the points.

    A view's alpha in a ball lies between the least and the largest pixel where the ball appears,
    and ranks keep the order of bounds.

    Args:
        points_world: the balls' middles.
        radius: of the balls, world units.
        cameras: one per view.
        alphas: coverage in [0, 1] per view.
        missing: as of `agreement`.
    """
    within = [
        _alpha_within(points_world, radius, camera, alpha)
        for camera, alpha in zip(cameras, alphas, strict=True)
    ]
    least, most = (_ranked(bounds, missing) for bounds in zip(*within, strict=True))
    return least, most


def _ranked(values: Iterable[Float[Tensor, " n"]], rank: int) -> Float[Tensor, " n"]:
    """Return the (rank + 1)-th smallest, 1 where there are fewer."""
    lowest: list[Tensor] = []
    for value in values:
        for row in lowest:  # insertion into the sorted list of the smallest values so far
            smaller, value = torch.minimum(row, value), torch.maximum(row, value)
            row.copy_(smaller)
        if len(lowest) <= rank:
            lowest.append(value)
    return lowest[rank] if rank < len(lowest) else torch.ones_like(lowest[0])


def _alpha_within(
    points_world: Float[Tensor, "n 3"],
    radius: float,
    camera: Camera,
    alpha: Float[Tensor, "height width"],
) -> tuple[Float[Tensor, " n"], Float[Tensor, " n"]]:
    """Return a view's least and largest alpha within a radius of points, [0, 1] if unsure."""
    pixels, relative = _seen(points_world, camera)
    # u' - u = scale (dx - k dz x / relative) / relative', with |d| <= radius
    nearest = relative - camera.k * radius
    scale = camera.scale * max(1.0, camera.pixel_aspect)
    off_axis = (pixels - torch.as_tensor(camera.center.astype(np.float32))).norm(dim=1)
    moves_px = radius * (scale + camera.k * off_axis) / nearest.clamp_min(MIN_RELATIVE_DEPTH)
    sure = moves_px <= MOST_MOVE * max(camera.size_wh)
    reach = 1 + math.ceil(float(moves_px[sure].max())) if bool(sure.any()) else 1
    window = np.ones((2 * reach + 1, 2 * reach + 1), dtype=np.uint8)
    at = pixels.floor().long().clamp_min(0).minimum(torch.tensor(camera.size_wh) - 1)
    least, most = (
        torch.as_tensor(filtered(alpha.numpy(), window))[at[:, 1], at[:, 0]]
        for filtered in (cv2.erode, cv2.dilate)
    )
    return torch.where(sure, least, 0.0), torch.where(sure, most, 1.0)


def alpha_at(
    points_world: Float[Tensor, "n 3"], camera: Camera, alpha: Float[Tensor, "height width"]
) -> Float[Tensor, " n"]:
    """Return a view's alpha where the points appear in it; 0 behind the camera.

    Beyond the picture's edge the nearest pixel counts, so that a figure which the picture cuts
    off goes on, and background goes on as background.
    """
    pixels, in_front = project(points_world, camera)
    size = torch.tensor(camera.size_wh, dtype=torch.float32)
    grid = (pixels * (2 / size) - 1)[None, None]
    values = F.grid_sample(alpha[None, None], grid, padding_mode="border", align_corners=False)
    return torch.where(in_front, values[0, 0, 0], torch.zeros(()))


def project(
    points_world: Float[Tensor, "n 3"], camera: Camera
) -> tuple[Float[Tensor, "n 2"], Bool[Tensor, " n"]]:
    """Return the pixels of world points and whether they lie in front: `Camera.project` in torch.

    Pixels behind the camera have no meaning.
    """
    pixels, relative = _seen(points_world, camera)
    return pixels, relative > MIN_RELATIVE_DEPTH


def _seen(
    points_world: Float[Tensor, "n 3"], camera: Camera
) -> tuple[Float[Tensor, "n 2"], Float[Tensor, " n"]]:
    """Return pixels, and depths over the depth of the camera's target."""
    dtype = points_world.dtype
    rotation = torch.as_tensor(np.array(camera.rotation), dtype=dtype)
    local = (points_world - torch.as_tensor(np.array(camera.target), dtype=dtype)) @ rotation.T
    relative = 1 + camera.k * local[:, 2]
    scale = torch.tensor([camera.scale, camera.scale * camera.pixel_aspect], dtype=dtype)
    center = torch.as_tensor(np.array(camera.center), dtype=dtype)
    pixels = center + scale * local[:, :2] / relative.clamp_min(MIN_RELATIVE_DEPTH)[:, None]
    return pixels, relative
