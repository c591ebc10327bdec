"""Search the planes' resolution by short trainings.

For every candidate a field is fitted for a few steps to all drawings but one or two, inside the
hull of all of them, and compared with what was left out (see
`toonset.nerf.train.plane_choice`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import torch

from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.mask import figure_px
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.options import TrainOptions
from toonset.nerf.train.batches import Batch, make_batches
from toonset.nerf.train.carved_rays import FixedRays
from toonset.nerf.train.loop import fit
from toonset.nerf.train.loss import Model, Weights, render_batch
from toonset.nerf.train.plane_choice import (
    FEWEST_VIEWS,
    USUAL,
    Candidate,
    FieldChoice,
    chosen,
    shares_for,
)

SEEN_RAYS, UNSEEN_RAYS = 32_000, 8_000  # drawn by lot; a trial goes through the first four times
STEPS = 60  # by then the order of the candidates shows
TWO_FROM = 6  # views from which two drawings are left out, half a turn apart

Build = Callable[[int], TriplaneField]
Batches = Sequence[tuple[Batch, ...]]


@dataclass(frozen=True, eq=False)
class Ground:
    """Scene and settings that all candidates share.

    Attributes:
        scene: drawings as they are fitted, without mirror images.
        hull: of all of them.
        step: distance of samples along rays, world units.
        samples: most per ray.
        weights: of the loss's terms.
        options: of the training.
        device: where fields are fitted.
    """

    scene: Scene
    hull: Hull
    step: float
    samples: int
    weights: Weights
    options: TrainOptions
    device: torch.device

    def batches(self, frames: Sequence[Frame], most: int) -> Batches:
        """Return the rays of some drawings, `most` at most."""
        part = replace(self.scene, frames=tuple(frames))
        generator = torch.Generator().manual_seed(self.options.seed)
        found = make_batches(part, self.hull, self.step, self.samples, generator, most)
        return [tuple(batch.to(self.device) for batch in batches) for batches in found]


def choose_cells(ground: Ground, finest: int, build: Build, *, agree: bool) -> FieldChoice:
    """Return how many cells the planes get, and on what evidence.

    Args:
        ground: what candidates are fitted to.
        finest: cells of one per pixel.
        build: returns an untrained field of so many cells.
        agree: the drawings' outlines do, to the pixel.
    """
    frames = ground.scene.frames
    shown = [frame for frame in frames if figure_px(frame)]
    if untried := _why_untried(len(shown), ground.options):
        return FieldChoice(max(1, round(USUAL * finest)), untried)
    shares = shares_for(len(shown), agree=agree)
    cells = [max(1, round(share * finest)) for share in shares]
    left = left_out(shown)
    kept = [frame for frame in frames if frame not in left]
    torch.default_generator.manual_seed(ground.options.seed)
    fields = [build(count) for count in cells]
    seen, unseen = ground.batches(kept, SEEN_RAYS), ground.batches(left, UNSEEN_RAYS)
    tasks = [partial(_tried, ground, seen, unseen, field) for field in fields]
    candidates = tuple(side_by_side(tasks))
    names = tuple(frame.name for frame in left)
    return FieldChoice(chosen(candidates), "", candidates, names)


def _why_untried(views: int, options: TrainOptions) -> str:
    if not options.carve:
        return "no hull to try them in"
    assert options.steps is not None
    if options.budget_s is not None or options.steps < 2 * STEPS:
        return "too short a training for trials"
    return "too few drawings to leave one out" if views < FEWEST_VIEWS else ""


def left_out(frames: Sequence[Frame]) -> list[Frame]:
    """Return the drawings that are predicted: the second, and the one half a turn from it."""
    numbers = [1, 1 + len(frames) // 2] if len(frames) >= TWO_FROM else [1]
    return [frames[number] for number in numbers]


def _tried(ground: Ground, seen: Batches, unseen: Batches, field: TriplaneField) -> Candidate:
    generator = torch.Generator().manual_seed(ground.options.seed)
    model = Model(field, None).to(ground.device)
    few = replace(ground.options, steps=STEPS, budget_s=None)
    fit(model, FixedRays(seen), ground.weights, few, generator)
    parameters = sum(values.numel() for values in field.parameters())
    return Candidate(field.resolution, parameters, _psnr(field, unseen))


@torch.no_grad()
def _psnr(field: TriplaneField, batches: Batches) -> float:
    error, rays = 0.0, 0
    for batch in (batch for parts in batches for batch in parts):
        color, opacity = render_batch(field, batch)
        drawn = batch.rgb * batch.alpha[:, None] + 1 - batch.alpha[:, None]
        error += float(((color + 1 - opacity[:, None] - drawn) ** 2).mean(dim=1).sum())
        rays += len(drawn)
    return -10 * math.log10(max(error / max(rays, 1), 1e-10))
