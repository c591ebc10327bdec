"""Run the training loop: Adam over batches of rays."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

import torch

from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.kernels.adam import Adam, Group
from toonset.nerf.options import TrainOptions
from toonset.nerf.train.carved_rays import TrainingRays
from toonset.nerf.train.divergence import LastGood
from toonset.nerf.train.gradients import gradients_of
from toonset.nerf.train.loss import Model, Weights
from toonset.nerf.train.result import Step

TABLES_RATE = 0.2
BETAS = (0.9, 0.99)  # a few hundred steps are too few for a memory of a thousand
LAST_RATE = 0.1  # of the first: exponential decay over the training
LEAST_STEPS = 30  # that a budget leaves: fewer show nothing
HALF_FROM = 4096  # values: tables of this size and more are stored in half precision

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Moment:
    """A training just after a step.

    Attributes:
        history: every step so far.
        of: how many steps are asked for.
        progress: how much of the training is over, 0 to 1.
    """

    history: list[Step]
    of: int
    progress: float


class Watch(Protocol):
    """Callback while a field is fitted; its seconds do not count as training."""

    def begin(self, trained: TrainedField) -> None:
        """Take the field that will be fitted."""

    def look(self, moment: Moment) -> str:
        """Look at a training after each step; return why it should end, or None."""
        ...


def fit(
    model: Model,
    rays: TrainingRays,
    weights: Weights,
    options: TrainOptions,
    generator: torch.Generator,
    watch: Watch | None = None,
    spent_s: float = 0.0,
) -> tuple[list[Step], str]:
    """Fit `model` in place; return the history and why it ended.

    A training that goes wrong ends with the last state known to be good (see `LastGood`). The model
    ends as run folders store it: large tables in half precision.

    Args:
        model: parameters to fit.
        rays: where batches come from.
        weights: of the loss's terms.
        options: steps, which are chosen, and budget.
        generator: shuffles the batches.
        watch: looks on after every step, and may end the training.
        spent_s: seconds of the budget that are over.
    """
    loop = _Loop(model, rays, weights, options, generator, spent_s)
    good = LastGood(model)
    stopped = "steps"
    while len(loop.history) < loop.of:
        if loop.out_of_time():
            stopped = "budget"
            break
        if wrong := loop.step(good):
            return loop.history, wrong
        if watch is not None:
            with loop.clock.stopped():
                stopped = watch.look(Moment(loop.history, loop.of, loop.progress()))
            if stopped:
                break
            stopped = "steps"
    wrong = good.wrong_at_end(len(loop.history))
    store_in_half(model)
    return loop.history, wrong or stopped


@torch.no_grad()
def store_in_half(model: Model) -> None:
    """Round large tables to half precision: run folders hold them so."""
    most = torch.finfo(torch.float16).max
    for values in model.parameters():
        if values.numel() >= HALF_FROM:
            values.copy_(values.clamp(-most, most).half())


class _Clock:
    """Seconds that run on, except while stopped."""

    def __init__(self) -> None:
        self.began = time.perf_counter()

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.began

    @contextmanager
    def stopped(self) -> Iterator[None]:
        paused = time.perf_counter()
        yield
        self.began += time.perf_counter() - paused


class _Loop:
    """The state of a training, and its one step."""

    def __init__(
        self,
        model: Model,
        rays: TrainingRays,
        weights: Weights,
        options: TrainOptions,
        generator: torch.Generator,
        spent_s: float,
    ) -> None:
        self._model, self._rays, self._weights = model, rays, weights
        assert options.steps is not None
        self.of, self._options = options.steps, options
        self._generator, self._spent_s = generator, spent_s
        tables = {id(values) for values in model.field.tables()}
        named = sorted(model.named_parameters(), key=lambda pair: id(pair[1]) not in tables)
        values = [parameter for _, parameter in named]  # tables first
        fast = Group(values[: len(tables)], TABLES_RATE)
        slow = Group(values[len(tables) :], model.field.decoder_rate)
        self._adam = Adam([fast, slow], BETAS)
        self._queue: list[int] = []
        self.history: list[Step] = []
        self.clock = _Clock()

    def out_of_time(self) -> bool:
        """Return whether the budget is spent; a few steps are always taken."""
        return len(self.history) >= LEAST_STEPS and self._by_clock() >= 1

    def progress(self) -> float:
        """Return how much of the training is over, by steps or by the clock if that is further."""
        steps = len(self.history)
        return max(steps / self.of, min(self._by_clock(), steps / LEAST_STEPS, 1.0))

    def _by_clock(self) -> float:
        """Return which share of the budget's seconds for steps is over."""
        if self._options.budget_s is None:
            return 0.0
        left_s = self._options.budget_s - self._spent_s
        return self.clock.seconds / left_s if left_s > 0 else math.inf

    def step(self, good: LastGood) -> str:
        """Take a step, unless something is wrong: then return what."""
        number, rate = len(self.history), LAST_RATE ** self.progress()
        if not self._queue:
            order = torch.randperm(len(self._rays), generator=self._generator)
            self._queue = order.tolist()
        batches = self._rays.batches(self._queue.pop(), number)
        terms, gradients = gradients_of(self._model, batches, self._weights)
        loss = terms.sum()
        # one transfer from the device for all of them
        value, photometric, entropy = torch.stack([loss, *terms[:2]]).tolist()
        if wrong := good.wrong(loss, value, number):
            return wrong
        for parameter, gradient in zip(self._model.parameters(), gradients, strict=True):
            parameter.grad = gradient
        self._adam.step(rate)
        self._rays.after(number, self._model)
        self.history.append(Step(number, value, photometric, entropy, self.clock.seconds))
        return ""
