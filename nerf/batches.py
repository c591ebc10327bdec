"""The rays of all drawings, cut once into batches whose interpolation weights are constants."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from toonset.dataset.scene import UNLABELLED, Scene
from toonset.nerf.field import TriplaneField
from toonset.nerf.hull import Hull
from toonset.nerf.interpolation import Operator
from toonset.nerf.march import Rays, Samples, march, rays_of

OPAQUE = 128  # alpha from which a pixel's colour is the figure's own
RAYS_PER_BATCH = 2048  # activations of a batch stay in a core's cache
MOST_RAYS = 100_000  # drawn by lot from larger scenes; bounds memory at about 1 GB


@dataclass(frozen=True, eq=False)
class Batch:
    """Some rays with their samples.

    Attributes:
        operator: from the planes' table to the samples' features.
        slots: (samples,) place of each sample in the flat (rays, most) table.
        rgb: (rays, 3) the drawing's colour in [0, 1].
        labels: (rays,) the drawing's palette label, 255 = none.
    """

    operator: Operator
    slots: Int[Tensor, " samples"]
    rgb: Float[Tensor, "rays 3"]
    labels: Int[Tensor, " rays"]

    def to(self, device: torch.device) -> Batch:
        """Return the batch on a device."""
        operator = self.operator.to(device)
        return Batch(operator, *(t.to(device) for t in (self.slots, self.rgb, self.labels)))


def make_batches(
    scene: Scene,
    hull: Hull,
    field: TriplaneField,
    step: float,
    most: int,
    generator: torch.Generator,
) -> list[Batch]:
    """Return the scene's foreground rays that meet the hull, shuffled and cut into batches."""
    rays, rgb, labels = _foreground(scene, hull)
    chosen = torch.randperm(len(rgb), generator=generator)[:MOST_RAYS]
    rays = Rays(rays.origins[chosen], rays.directions[chosen], rays.start[chosen])
    rgb, labels = rgb[chosen], labels[chosen]
    count = max(1, round(len(rgb) / RAYS_PER_BATCH))
    cuts = np.linspace(0, len(rgb), count + 1).astype(int).tolist()
    batches = []
    for first, last in pairwise(cuts):
        part = slice(first, last)
        some = Rays(rays.origins[part], rays.directions[part], rays.start[part])
        samples = march(some, hull, step, most)
        if len(samples.ray):
            batches.append(_batch(samples, field, most, rgb[part], labels[part]))
    return batches


def _foreground(scene: Scene, hull: Hull) -> tuple[Rays, Float[Tensor, "n 3"], Int[Tensor, " n"]]:
    origins, directions, start, rgb, labels = [], [], [], [], []
    for frame in scene.frames:
        mask = frame.rgba[..., 3] >= OPAQUE
        rays = rays_of(frame.camera, frame.camera.pixel_grid()[mask], hull)
        origins.append(rays.origins)
        directions.append(rays.directions)
        start.append(rays.start)
        rgb.append(torch.as_tensor(frame.rgba[mask][:, :3] / np.float32(255)))
        none = np.full(frame.rgba.shape[:2], UNLABELLED, dtype=np.uint8)
        known = none if frame.labels is None else frame.labels
        labels.append(torch.as_tensor(known[mask].astype(np.int64)))
    rays = Rays(torch.cat(origins), torch.cat(directions), torch.cat(start))
    return rays, torch.cat(rgb), torch.cat(labels)


def _batch(samples: Samples, field: TriplaneField, most: int, rgb: Tensor, labels: Tensor) -> Batch:
    hit, ray = torch.unique_consecutive(samples.ray, return_inverse=True)
    rows, weights = field.taps(samples.points)
    operator = Operator.of(rows, weights, len(field.planes))
    return Batch(operator, ray * most + samples.order, rgb[hit], labels[hit])
