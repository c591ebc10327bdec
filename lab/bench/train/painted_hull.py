"""The coloured visual hull: no training, each place takes its colour from the views that see it.

    colour(x) = sum_v w_v colour_v(project_v(x)) / sum_v w_v,   w_v = cos^4 of the angle of sight

over the views in which the hull hides x behind nothing. Places that no view sees take the colour of
the nearest one that some view does.
"""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float
from scipy import ndimage
from torch import Tensor

from lab.bench.train.voxel import VoxelField
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.hull.hull import LEVEL, Hull
from toonset.nerf.hull.march import march, rays_of
from toonset.nerf.hull.support import project
from toonset.nerf.train.fit_field import finest_cells

DENSITY_SLOPE = 16.0  # of the grid's values over the hull's support: about 0 outside, 8 inside
REACH = 2.0  # cells behind the first surface that still count as seen
GRAZING = 0.05  # cosine that a view at a glancing angle still counts with
SHARPNESS = 4  # of the preference for views that look straight at the surface
LOGIT_EDGE = 0.004  # colours are kept this far from 0 and 1, where logits are finite


def painted(scene: Scene, hull: Hull) -> VoxelField:
    """Return a scene's hull in the drawings' colours."""
    field = VoxelField(hull.box, finest_cells(scene))
    paint(field, hull, scene)
    return field


@torch.no_grad()
def paint(field: VoxelField, hull: Hull, scene: Scene) -> None:
    """Set the grid of `field` to the drawings' colours, opaque inside the hull."""
    points = field.corners()
    slope = torch.stack(torch.gradient(F.pad(hull.support, (1,) * 6)))[:, 1:-1, 1:-1, 1:-1]
    normal = F.normalize(-_sampled(slope, points, hull), dim=1)
    total, weight = torch.zeros(len(points), 3), torch.zeros(len(points))
    support = hull.support_at(points)
    for frame in scene.frames:
        seen, toward = _seen(points, frame.camera, hull, field.cell)
        color, covered = _drawn(points, frame)
        facing = (normal * toward).sum(dim=1).clamp(GRAZING, 1)
        w = (seen & (support > 0)) * covered * facing**SHARPNESS
        total += w[:, None] * color
        weight += w
    color = total / weight.clamp_min(1e-12)[:, None]
    color = _filled(color.view(*field.shape, 3), (weight > 1e-9).view(field.shape))
    field.grid[:, 0] = DENSITY_SLOPE * (support - LEVEL)
    field.grid[:, 1:] = torch.logit(color.reshape(-1, 3), eps=LOGIT_EDGE)


def _filled(
    color: Float[Tensor, "x y z 3"], known: Bool[Tensor, "x y z"]
) -> Float[Tensor, "x y z 3"]:
    """Return the colours with the nearest known one where none is known."""
    if not bool(known.any()):
        return color
    nearest = np.asarray(
        ndimage.distance_transform_edt(~known.numpy(), return_distances=False, return_indices=True)
    )
    return color[tuple(torch.as_tensor(index) for index in nearest)]


def _sampled(
    volumes: Float[Tensor, "c x y z"], points: Float[Tensor, "n 3"], hull: Hull
) -> Float[Tensor, "n c"]:
    size = torch.tensor(volumes.shape[1:], dtype=torch.float32)
    unit = (points - torch.as_tensor(hull.low, dtype=torch.float32)) * (2 / hull.voxel / size) - 1
    grid = unit.flip(-1)[None, None, None]
    return F.grid_sample(volumes[None], grid, align_corners=False)[0, :, 0, 0].T


def _seen(
    points: Float[Tensor, "n 3"], camera: Camera, hull: Hull, cell: float
) -> tuple[Bool[Tensor, " n"], Float[Tensor, "n 3"]]:
    """Return which points a camera sees, and the directions from all of them towards it."""
    width, height = camera.size_wh
    rays = rays_of(camera, camera.pixel_grid().reshape(-1, 2), hull)
    first = march(rays, hull, hull.voxel, 1, LEVEL)
    distance = torch.full((width * height,), -np.inf)
    distance[first.ray] = first.distance
    pixels, in_front = project(points, camera)
    at = pixels.floor().long()
    in_picture = in_front & (at >= 0).all(1) & (at[:, 0] < width) & (at[:, 1] < height)
    index = at[:, 1].clamp(0, height - 1) * width + at[:, 0].clamp(0, width - 1)
    directions = rays.directions[index]
    along = ((points - rays.origins[index]) * directions).sum(dim=1)
    return in_picture & (along <= distance[index] + REACH * cell), -directions


def _drawn(
    points: Float[Tensor, "n 3"], frame: Frame
) -> tuple[Float[Tensor, "n 3"], Float[Tensor, " n"]]:
    """Return a drawing's straight colour and coverage at the points, bilinear."""
    rgba = torch.as_tensor(frame.rgba / np.float32(255)).permute(2, 0, 1)
    layers = torch.cat([rgba[:3] * rgba[3:], rgba[3:]])
    pixels, _ = project(points, frame.camera)
    size = torch.tensor(frame.camera.size_wh, dtype=torch.float32)
    grid = (pixels * (2 / size) - 1)[None, None]
    found = F.grid_sample(layers[None], grid, align_corners=False)[0, :, 0].T
    return found[:, :3] / found[:, 3:].clamp_min(1e-3), found[:, 3]
