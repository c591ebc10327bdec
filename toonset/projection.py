"""Project points with the camera model in torch: batched, differentiable, on any device.

Rotations are kornia's `So3`, the division is its `project_points_z1`: with the homogeneous depth
1 + k z_c the pinhole and the orthographic camera are one expression, and k = 0 is a regular point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from kornia.geometry.camera import project_points_z1
from kornia.geometry.liegroup import So3
from torch import Tensor

from toonset.camera import Camera


@dataclass(frozen=True, eq=False)
class CameraTensors:
    """Several cameras as tensors, any of which may require gradients.

    Attributes:
        rotation: camera_from_world.
        target: world points on the optical axes, at whose depth `scale_uv` holds.
        center: pixels at which the targets appear.
        scale_uv: pixels per world unit along u and v.
        k: 1 / distance between camera centre and target; 0 = orthographic.
    """

    rotation: Float[Tensor, "views 3 3"]
    target: Float[Tensor, "views 3"]
    center: Float[Tensor, "views 2"]
    scale_uv: Float[Tensor, "views 2"]
    k: Float[Tensor, " views"]

    @classmethod
    def of(cls, cameras: Sequence[Camera], like: Tensor | None = None) -> CameraTensors:
        """Return cameras as tensors of the device and dtype of `like` (default: CPU, float64)."""
        kind = torch.zeros((), dtype=torch.float64) if like is None else like
        columns = (
            [camera.rotation for camera in cameras],
            [camera.target for camera in cameras],
            [camera.center for camera in cameras],
            [(camera.scale, camera.scale * camera.pixel_aspect) for camera in cameras],
            [camera.k for camera in cameras],
        )
        return cls(*(torch.as_tensor(np.array(column)).to(kind) for column in columns))


def project(
    cameras: CameraTensors | Sequence[Camera], points: Float[Tensor, "#views points 3"]
) -> Float[Tensor, "views points 2"]:
    """Return the pixels of world points in several cameras.

    Differentiable with respect to the points and every tensor of the cameras, on any device, for
    orthographic (k = 0) and pinhole cameras alike. Points at or behind a pinhole's centre have no
    pixel: NaN.

    Args:
        cameras: one per view.
        points: (views, points, 3) world coordinates, or (1, points, 3) for the same in all views.
    """
    if not isinstance(cameras, CameraTensors):
        cameras = CameraTensors.of(cameras, points)
    offsets = points - cameras.target[:, None]
    return project_offsets(cameras.rotation, cameras.center, cameras.scale_uv, cameras.k, offsets)


def project_with_jacobian(
    cameras: CameraTensors, points: Float[Tensor, "views points 3"]
) -> tuple[Float[Tensor, "views points 2"], Float[Tensor, "views points 2 7"]]:
    """Return pixels and their derivatives by (turn, center, log scale, k).

    The turn is the increment of `rotate`: d X_c = turn x X_c = -hat(X_c) turn. Points at or behind
    a pinhole's centre are NaN, derivatives too.

    Args:
        cameras: one per view.
        points: (views, points, 3) world coordinates.
    """
    local = (points - cameras.target[:, None]) @ cameras.rotation.transpose(-1, -2)
    pixels = project(cameras, points)
    flat = pixels - cameras.center[:, None]
    relative_depth = (1 + cameras.k[:, None] * local[..., 2])[..., None, None]
    pull = -cameras.k[:, None, None, None] * flat[..., None]  # d (u, v) / d z_c, times the depth
    by_local = torch.cat([torch.diag_embed(cameras.scale_uv[:, None].expand_as(flat)), pull], -1)
    by_turn = -(by_local / relative_depth) @ So3.hat(local.reshape(-1, 3)).view(*local.shape, 3)
    by_center = torch.eye(2).to(flat).expand(*flat.shape, 2)
    by_k = -(local[..., 2:] * flat / relative_depth[..., 0])[..., None]
    return pixels, torch.cat([by_turn, by_center, flat[..., None], by_k], dim=-1)


def rotate(
    rotation: Float[Tensor, "views 3 3"], turn: Float[Tensor, "views 3"]
) -> Float[Tensor, "views 3 3"]:
    """Return exp(turn) rotation, the left increment of the solvers (rotation vectors, radians)."""
    return So3.exp(turn).matrix() @ rotation


def project_offsets(
    rotation: Float[Tensor, "views 3 3"],
    center: Float[Tensor, "views 2"],
    scale_uv: Float[Tensor, "views 2"],
    k: Float[Tensor, " views"],
    offsets: Float[Tensor, "views points 3"],
) -> Float[Tensor, "views points 2"]:
    """Return the pixels of points given relative to each camera's target.

    Points at or behind a pinhole's centre have no pixel: NaN.
    """
    local = offsets @ rotation.transpose(-1, -2)
    relative_depth = 1 + k[:, None] * local[..., 2]
    seen = relative_depth > 0
    safe = torch.where(seen, relative_depth, torch.ones_like(relative_depth))
    plane = project_points_z1(torch.cat([local[..., :2], safe[..., None]], dim=-1))
    pixels = center[:, None] + scale_uv[:, None] * plane
    return torch.where(seen[..., None], pixels, torch.nan)
