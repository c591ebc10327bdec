"""Cut the rays of all drawings into batches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor

from toonset.dataset.bundle.scene import Scene
from toonset.nerf.fields.base import Constants, Field, Places
from toonset.nerf.hull.hull import Hull, occupancy
from toonset.nerf.hull.march import Rays, Samples, march, order_in_ray, rays_of
from toonset.nerf.kernels.threads import side_by_side
from toonset.palette.pixels.labels import UNLABELLED

RAYS_PER_STEP = 2048  # activations stay in a core's cache
QUARTERS = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / 4  # pixels from the centre
MOST_RAYS = 200_000  # drawn by lot from larger scenes; bounds memory at about 2 GB


@dataclass(frozen=True, eq=False)
class Batch:
    """Some rays with their samples.

    Attributes:
        constants: what the field knows of the samples' places.
        ray: (samples,) which ray a sample belongs to, ascending; every ray has one at least.
        length: (samples,) world units that a sample stands for, less where the hull is soft.
        rgb: (pixels, 3) the drawing's straight colour in [0, 1].
        alpha: (pixels,) the drawing's coverage in [0, 1].
        labels: (pixels,) the drawing's palette label, 255 = none.
        pixel: (rays,) which pixel a ray goes through, ascending; None: each has one ray.
        share: (rays,) of its pixel that a ray stands for; None: all of it.
        even: every ray has as many samples.
    """

    constants: Constants
    ray: Int[Tensor, " samples"]
    length: Float[Tensor, " samples"]
    rgb: Float[Tensor, "pixels 3"]
    alpha: Float[Tensor, " pixels"]
    labels: Int[Tensor, " pixels"]
    pixel: Int[Tensor, " rays"] | None = None
    share: Float[Tensor, " rays"] | None = None
    even: bool = False

    @property
    def rays(self) -> int:
        """Return how many rays there are."""
        return len(self.rgb if self.pixel is None else self.pixel)

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
            pixel=None if self.pixel is None else self.pixel.to(device),
            share=None if self.share is None else self.share.to(device),
        )

    def kept(self, samples: Bool[Tensor, " samples"], field: Field) -> Batch:
        """Return the batch with some of its samples, laid out for a field; every ray keeps one."""
        assert isinstance(self.constants, Places)
        constants = field.constants(self.constants.points[samples])
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
        step: distance of samples along a ray, world units.
        most: samples per ray.
        generator: shuffles.
        most_rays: drawn by lot from larger scenes.
        parts: batches of a step, which may be rendered side by side.
    """
    rays, drawn = _near_figure(scene, hull)
    chosen = torch.randperm(len(drawn.alpha), generator=generator)[:most_rays]
    first = (drawn.rays.cumsum(0) - drawn.rays)[chosen]
    drawn = drawn.at(chosen)
    pixel = torch.arange(len(chosen)).repeat_interleave(drawn.rays)
    rays = rays.at(first[pixel] + order_in_ray(pixel, len(chosen)))
    count = max(1, round(len(chosen) / RAYS_PER_STEP))
    cuts = np.linspace(0, len(chosen), count * parts + 1).astype(int).tolist()
    ends = torch.cat([first.new_zeros(1), drawn.rays.cumsum(0)])[cuts].tolist()

    def cut(number: int) -> Batch | None:
        part = slice(*cuts[number : number + 2])
        samples = march(rays.at(slice(*ends[number : number + 2])), hull, step, most)
        return _batch(samples, step, drawn.at(part)) if len(samples.ray) else None

    made = side_by_side([partial(cut, number) for number in range(len(cuts) - 1)])
    steps = (made[i : i + parts] for i in range(0, len(made), parts))
    kept = (tuple(batch for batch in step if batch is not None) for step in steps)
    return [batches for batches in kept if batches]


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Drawn colours of some pixels, and how many rays go through each."""

    rgb: Float[Tensor, "n 3"]
    alpha: Float[Tensor, " n"]
    labels: Int[Tensor, " n"]
    rays: Int[Tensor, " n"]

    def at(self, index: slice | Tensor) -> _Drawn:
        return _Drawn(self.rgb[index], self.alpha[index], self.labels[index], self.rays[index])


def _near_figure(scene: Scene, hull: Hull) -> tuple[Rays, _Drawn]:
    rays, rgb, alpha, labels, counts = [], [], [], [], []
    for frame in scene.frames:
        # with the pixel beside the figure, so that the border's place is known from both sides
        covered = torch.as_tensor(frame.rgba[..., 3] > 0)[None].float()
        mask = (F.max_pool2d(covered, 3, stride=1, padding=1)[0] > 0).numpy()
        drawn = torch.as_tensor(frame.rgba[mask] / np.float32(255))
        partly = ((drawn[:, 3] > 0) & (drawn[:, 3] < 1)).numpy()
        through, count = _through(frame.camera.pixel_grid()[mask], partly)
        rays.append(rays_of(frame.camera, through, hull))
        counts.append(torch.as_tensor(count))
        rgb.append(drawn[:, :3])
        alpha.append(drawn[:, 3])
        none = np.full(frame.rgba.shape[:2], UNLABELLED, dtype=np.uint8)
        known = none if frame.labels is None else frame.labels
        labels.append(torch.as_tensor(known[mask].astype(np.int64)))
    parts = ([getattr(r, name) for r in rays] for name in ("origins", "directions", "start"))
    return Rays(*map(torch.cat, parts)), _Drawn(*map(torch.cat, (rgb, alpha, labels, counts)))


def _through(
    centres: Float[np.ndarray, "n 2"], partly: Bool[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "rays 2"], Int[np.ndarray, " n"]]:
    """Return where rays go through pixels, pixel after pixel, and how many through each.

    One through the centre; through those that the figure covers in part, one through each quarter.
    """
    counts = np.where(partly, len(QUARTERS), 1)
    number = np.repeat(np.arange(len(centres)), counts)
    order = np.arange(len(number)) - np.repeat(counts.cumsum() - counts, counts)
    return centres[number] + QUARTERS[order] * partly[number, None], counts


def _batch(samples: Samples, step: float, drawn: _Drawn) -> Batch:
    hit, ray = torch.unique_consecutive(samples.ray, return_inverse=True)
    length = occupancy(samples.support) * step
    of = torch.arange(len(drawn.rays)).repeat_interleave(drawn.rays)[hit]
    shown, pixel = torch.unique_consecutive(of, return_inverse=True)
    seen = drawn.at(shown)
    share, colors = (1 / seen.rays)[pixel], (seen.rgb, seen.alpha, seen.labels)
    return Batch(Places(samples.points), ray, length, *colors, pixel, share)
