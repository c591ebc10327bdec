"""The rays of all drawings, cut once into batches whose interpolation weights are constants."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

from toonset.dataset.bundle.scene import Scene
from toonset.nerf.fields.base import Constants, Field
from toonset.nerf.hull.hull import Hull, occupancy
from toonset.nerf.hull.march import Rays, Samples, march, rays_of
from toonset.nerf.kernels.threads import side_by_side
from toonset.palette.pixels.labels import UNLABELLED

RAYS_PER_STEP = 2048  # activations stay in a core's cache
MOST_RAYS = 200_000  # drawn by lot from larger scenes; bounds memory at about 2 GB


@dataclass(frozen=True, eq=False)
class Batch:
    """Some rays with their samples.

    Attributes:
        constants: what the field knows of the samples' places.
        ray: (samples,) which ray a sample belongs to, ascending; every ray has one at least.
        length: (samples,) world units that a sample stands for, less where the hull is soft.
        rgb: (rays, 3) the drawing's straight colour in [0, 1].
        alpha: (rays,) the drawing's coverage in [0, 1].
        labels: (rays,) the drawing's palette label, 255 = none.
        even: every ray has as many samples.
    """

    constants: Constants
    ray: Int[Tensor, " samples"]
    length: Float[Tensor, " samples"]
    rgb: Float[Tensor, "rays 3"]
    alpha: Float[Tensor, " rays"]
    labels: Int[Tensor, " rays"]
    even: bool = False

    def to(self, device: torch.device) -> Batch:
        """Return the batch on a device."""
        return replace(
            self,
            constants=self.constants.to(device),
            ray=self.ray.to(device),
            length=self.length.to(device),
            rgb=self.rgb.to(device),
            alpha=self.alpha.to(device),
            labels=self.labels.to(device),
        )

    def kept(self, samples: Bool[Tensor, " samples"]) -> Batch:
        """Return the batch with some of its samples; every ray must keep one."""
        constants = self.constants.kept(samples)
        return replace(
            self,
            constants=constants,
            ray=self.ray[samples],
            length=self.length[samples],
            even=False,
        )


def make_batches(
    scene: Scene,
    hull: Hull,
    field: Field,
    step: float,
    most: int,
    generator: torch.Generator,
    most_rays: int = MOST_RAYS,
    parts: int = 1,
) -> list[tuple[Batch, ...]]:
    """Return the scene's rays on and just beside the figure, shuffled and cut up for the steps.

    Args:
        scene: the drawings.
        hull: where samples may lie.
        field: says what it knows of the samples' places.
        step: distance of samples along a ray, world units.
        most: samples per ray.
        generator: shuffles.
        most_rays: drawn by lot from larger scenes.
        parts: batches of a step, which may be rendered side by side.
    """
    rays, drawn = _near_figure(scene, hull)
    chosen = torch.randperm(len(drawn.alpha), generator=generator)[:most_rays]
    rays, drawn = rays.at(chosen), drawn.at(chosen)
    count = max(1, round(len(chosen) / RAYS_PER_STEP))
    cuts = np.linspace(0, len(chosen), count * parts + 1).astype(int).tolist()

    def cut(first: int, last: int) -> Batch | None:
        part = slice(first, last)
        samples = march(rays.at(part), hull, step, most)
        return _batch(samples, field, step, drawn.at(part)) if len(samples.ray) else None

    made = side_by_side([partial(cut, first, last) for first, last in pairwise(cuts)])
    steps = (made[i : i + parts] for i in range(0, len(made), parts))
    kept = (tuple(batch for batch in step if batch is not None) for step in steps)
    return [batches for batches in kept if batches]


@dataclass(frozen=True, eq=False)
class _Drawn:
    rgb: Float[Tensor, "n 3"]
    alpha: Float[Tensor, " n"]
    labels: Int[Tensor, " n"]

    def at(self, index: slice | Tensor) -> _Drawn:
        return _Drawn(self.rgb[index], self.alpha[index], self.labels[index])


def _near_figure(scene: Scene, hull: Hull) -> tuple[Rays, _Drawn]:
    rays, rgb, alpha, labels = [], [], [], []
    for frame in scene.frames:
        # with the pixel beside the figure, so that the border's place is known from both sides
        covered = torch.as_tensor(frame.rgba[..., 3] > 0)[None].float()
        mask = (F.max_pool2d(covered, 3, stride=1, padding=1)[0] > 0).numpy()
        rays.append(rays_of(frame.camera, frame.camera.pixel_grid()[mask], hull))
        drawn = torch.as_tensor(frame.rgba[mask] / np.float32(255))
        rgb.append(drawn[:, :3])
        alpha.append(drawn[:, 3])
        none = np.full(frame.rgba.shape[:2], UNLABELLED, dtype=np.uint8)
        known = none if frame.labels is None else frame.labels
        labels.append(torch.as_tensor(known[mask].astype(np.int64)))
    parts = ([getattr(r, name) for r in rays] for name in ("origins", "directions", "start"))
    return Rays(*map(torch.cat, parts)), _Drawn(*map(torch.cat, (rgb, alpha, labels)))


def _batch(samples: Samples, field: Field, step: float, drawn: _Drawn) -> Batch:
    hit, ray = torch.unique_consecutive(samples.ray, return_inverse=True)
    constants, length = field.constants(samples.points), occupancy(samples.support) * step
    seen = drawn.at(hit)
    return Batch(constants, ray, length, seen.rgb, seen.alpha, seen.labels)
