"""Rendering new views of a trained field.

A pixel is the mean of a grid of rays; outlines are soft through the hull's occupancy.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.hull import occupancy
from toonset.nerf.losses import straight
from toonset.nerf.march import Rays, Samples, march, pixels_near, rays_of
from toonset.nerf.rendering import compositing_weights, padded
from toonset.nerf.trained import TrainedField
from toonset.palette.labels import UNLABELLED

RAYS_PER_SIDE = 2  # of a pixel; 3 gains 0.04 dB and doubles the time
FIRST_SAMPLES = 8  # of every ray; most rays are opaque by then
OPAQUE_FROM = 0.99  # opacity at which a ray ends
RAYS_PER_CHUNK = 1 << 13
SEEN_FROM = 0.5  # opacity from which a pixel has a depth and a label


@dataclass(frozen=True, eq=False)
class Rendering:
    """One rendered view.

    Attributes:
        rgb: (height, width, 3) premultiplied colour in [0, 1].
        alpha: (height, width) opacity in [0, 1].
        depth: (height, width) mean distance past the plane through the camera's target, world
            units; nan where nothing is seen.
        labels: (height, width) most frequent palette label, 255 where nothing is seen; None
            without palette.
        shares: (height, width, colors) share of a pixel that each palette colour covers
            (premultiplied by alpha); None without palette.
    """

    rgb: Float[np.ndarray, "height width 3"]
    alpha: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]
    labels: UInt8[np.ndarray, "height width"] | None
    shares: Float[np.ndarray, "height width colors"] | None


@torch.no_grad()
def render(trained: TrainedField, camera: Camera) -> Rendering:
    """Return the view of `camera`, orthographic or pinhole, of any size."""
    width, height = camera.size_wh
    fine = camera.resized(RAYS_PER_SIDE)
    near = pixels_near(fine, trained.hull).reshape(-1)
    rays = rays_of(fine, fine.pixel_grid().reshape(-1, 2)[near], trained.hull)
    color, opacity, distance = _render_rays(trained, rays)
    shares = _label_shares(trained, color, opacity)
    forward = torch.as_tensor(np.array(camera.rotation[2]), dtype=torch.float32)
    offset = float(np.array(camera.rotation[2]) @ camera.target)
    # distance is opacity-weighted, hence the opacity before the constant parts
    depth = opacity * (rays.origins @ forward - offset) + distance * (rays.directions @ forward)
    columns = [color, opacity[:, None], depth[:, None], *([] if shares is None else [shares])]
    seen_table = torch.cat(columns, dim=1)
    table = torch.zeros(len(near), seen_table.shape[1])
    table[torch.as_tensor(near)] = seen_table
    s = RAYS_PER_SIDE
    mean = table.view(height, s, width, s, -1).mean(dim=(1, 3)).numpy()
    alpha = mean[..., 3].clip(0, 1)
    seen = alpha >= SEEN_FROM
    depth_map = np.where(seen, mean[..., 4] / np.where(seen, alpha, 1), np.nan)
    if shares is None:
        return Rendering(mean[..., :3], alpha, depth_map, None, None)
    labels = np.where(seen, mean[..., 5:].argmax(axis=-1), UNLABELLED).astype(np.uint8)
    return Rendering(mean[..., :3], alpha, depth_map, labels, mean[..., 5:])


def _render_rays(trained: TrainedField, rays: Rays) -> tuple[Tensor, Tensor, Tensor]:
    """Return premultiplied colour, opacity, and distance weighted with opacity, of every ray."""
    samples = march(rays, trained.hull, trained.step, trained.samples)
    table = torch.zeros(samples.rays, 5)
    hit, ray = torch.unique_consecutive(samples.ray, return_inverse=True)
    ends = torch.searchsorted(ray, torch.arange(0, len(hit) + RAYS_PER_CHUNK, RAYS_PER_CHUNK))
    for number, (first, last) in enumerate(pairwise(ends.tolist())):
        start = number * RAYS_PER_CHUNK
        part = slice(first, last)
        local = Samples(
            samples.points[part],
            ray[part] - start,
            samples.order[part],
            samples.distance[part],
            samples.support[part],
            min(RAYS_PER_CHUNK, len(hit) - start),
        )
        table[hit[start : start + RAYS_PER_CHUNK]] = _two_passes(trained, local)
    return table[:, :3], table[:, 3], table[:, 4]


def _two_passes(trained: TrainedField, samples: Samples) -> Float[Tensor, "rays 5"]:
    """Composite the first samples of all rays, then the others of rays that are not opaque yet."""
    front = samples.order < FIRST_SAMPLES
    result = _composite(trained, samples, front, 0, FIRST_SAMPLES)
    open_rays = result[:, 3] < OPAQUE_FROM
    behind = ~front & open_rays[samples.ray]
    if bool(behind.any()):
        most = trained.samples - FIRST_SAMPLES
        rest = _composite(trained, samples, behind, FIRST_SAMPLES, most)
        result = result + (1 - result[:, 3:4]) * rest
    return result


def _composite(
    trained: TrainedField, samples: Samples, chosen: Tensor, first: int, most: int
) -> Float[Tensor, "rays 5"]:
    which = chosen.nonzero()[:, 0]
    density, rgb = trained.field(samples.points[which])
    density = density * occupancy(samples.support[which])
    distance = samples.distance[which]
    packed = torch.cat([(density * trained.step)[:, None], rgb, distance[:, None]], dim=1)
    order = samples.order[which] - first
    table = padded(packed, samples.ray[which], order, samples.rays, most)
    weights = compositing_weights(table[..., 0])
    color = (weights[..., None] * table[..., 1:4]).sum(dim=1)
    columns = [color, weights.sum(dim=1, keepdim=True), (weights * table[..., 4]).sum(1, True)]
    return torch.cat(columns, dim=1)


def _label_shares(
    trained: TrainedField, color: Float[Tensor, "rays 3"], opacity: Float[Tensor, " rays"]
) -> Float[Tensor, "rays colors"] | None:
    """Return each ray's opacity in the column of its label."""
    if trained.classifier is None or trained.palette is None:
        return None
    shares = torch.zeros(len(color), len(trained.palette))
    hit = (opacity > 0).nonzero()[:, 0]
    label = trained.classifier(straight(color[hit], opacity[hit])).argmax(dim=1)
    shares[hit, label] = opacity[hit]
    return shares
