"""The training loop: Adam over precomputed batches."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from toonset.nerf import losses
from toonset.nerf.batches import Batch
from toonset.nerf.classifier import PaletteClassifier
from toonset.nerf.field import TriplaneField
from toonset.nerf.options import TrainOptions
from toonset.nerf.rendering import compositing_weights
from toonset.nerf.trained import Step

PLANES_RATE, DECODER_RATE = 0.2, 0.02  # Adam
BETAS = (0.9, 0.99)  # a few hundred steps are too few for a memory of a thousand
LAST_RATE = 0.1  # of the first: exponential decay over the training
SNAPSHOT_EVERY = 20  # steps between kept good states

Progress = Callable[[str], None]


class Model(nn.Module):
    """The parameters of a training: field and, with a palette, classifier."""

    def __init__(self, field: TriplaneField, classifier: PaletteClassifier | None) -> None:
        """Hold both."""
        super().__init__()
        self.field = field
        self.classifier = classifier


@dataclass(frozen=True)
class Weights:
    """Weights of the loss's terms, and what a step needs to know about sampling.

    Attributes:
        palette: of the cross-entropy.
        smoothness: of the planes' total variation.
        step: distance of samples, world units.
        most: samples per ray.
    """

    palette: float
    smoothness: float
    step: float
    most: int


def fit(
    model: Model,
    batches: list[Batch],
    weights: Weights,
    options: TrainOptions,
    generator: torch.Generator,
    tell: Progress,
) -> tuple[list[Step], str]:
    """Fit `model` in place; return the history and why it ended.

    A loss that is not finite ends the training with the last state known to be good.
    """
    optimizer = _optimizer(model)
    good, good_step = copy.deepcopy(model.state_dict()), 0
    history: list[Step] = []
    queue: list[int] = []
    began = time.perf_counter()
    for number in range(options.steps):
        spent = time.perf_counter() - began
        if options.budget_s is not None and spent >= options.budget_s and number:
            return history, "budget"
        _set_rates(optimizer, _progress(number, spent, options))
        queue = queue or torch.randperm(len(batches), generator=generator).tolist()
        terms = loss_terms(model, batches[queue.pop()], weights)
        loss = torch.stack(terms).sum()
        if not losses.is_finite(loss):
            model.load_state_dict(good)
            return history, f"loss not finite at step {number}, kept the state of step {good_step}"
        # The loss before this update was finite, so the state that gave it is good.
        if number % SNAPSHOT_EVERY == 0:
            good, good_step = copy.deepcopy(model.state_dict()), number
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
        photometric, cross_entropy = float(terms[0].detach()), float(terms[1].detach())
        history.append(Step(number, float(loss.detach()), photometric, cross_entropy, spent))
        tell(f"training: step {number + 1} of {options.steps}, loss {history[-1].loss:.4f}")
    if not all(bool(torch.isfinite(p).all()) for p in model.parameters()):
        model.load_state_dict(good)
        return history, f"parameters not finite at the end, kept the state of step {good_step}"
    return history, "steps"


def loss_terms(
    model: Model, batch: Batch, weights: Weights
) -> tuple[Float[Tensor, ""], Float[Tensor, ""], Float[Tensor, ""]]:
    """Return the weighted photometric, cross-entropy and smoothness terms of a batch."""
    color, opacity = render_batch(model.field, batch, weights.step, weights.most)
    photometric = losses.photometric(color, opacity, batch.rgb, batch.alpha)
    entropy = photometric.new_zeros(())
    if model.classifier is not None:
        logits = model.classifier(losses.straight(color, opacity))
        entropy = weights.palette * losses.cross_entropy(logits, batch.labels)
    smooth = weights.smoothness * losses.total_variation(model.field.plane_images())
    return photometric, entropy, smooth


def render_batch(
    field: TriplaneField, batch: Batch, step: float, most: int
) -> tuple[Float[Tensor, "rays 3"], Float[Tensor, " rays"]]:
    """Return premultiplied colour and opacity of a batch's rays."""
    density, rgb = field.decode(batch.operator(field.planes))
    rays = len(batch.rgb)
    optical = density * batch.occupancy * step
    depth = density.new_zeros(rays * most).index_copy(0, batch.slots, optical)
    weights = compositing_weights(depth.view(rays, most))
    weighted = weights.reshape(-1)[batch.slots, None] * rgb
    color = rgb.new_zeros(rays * most, 3).index_copy(0, batch.slots, weighted)
    return color.view(rays, most, 3).sum(dim=1), weights.sum(dim=1)


def _optimizer(model: Model) -> torch.optim.Adam:
    planes = model.field.planes
    rest = [p for p in model.parameters() if p is not planes]
    groups = [
        {"params": [planes], "lr": PLANES_RATE, "first_rate": PLANES_RATE},
        {"params": rest, "lr": DECODER_RATE, "first_rate": DECODER_RATE},
    ]
    return torch.optim.Adam(groups, betas=BETAS, fused=True)


def _progress(number: int, spent: float, options: TrainOptions) -> float:
    """Return how much of the training is over, by steps or by the clock, whichever is further."""
    by_clock = 0.0 if options.budget_s is None else spent / options.budget_s
    return max(number / options.steps, min(by_clock, 1.0))


def _set_rates(optimizer: torch.optim.Adam, progress: float) -> None:
    for group in optimizer.param_groups:
        group["lr"] = group["first_rate"] * LAST_RATE**progress
