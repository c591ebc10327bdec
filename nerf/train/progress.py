"""Report a training's progress, in numbers and in one line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from toonset.errors import duration

if TYPE_CHECKING:  # torch takes seconds to import, and these lines need none
    from toonset.nerf.train.loop import Moment
    from toonset.nerf.train.result import HeldOut

RECENT = 50  # steps whose mean loss is shown: single batches differ


@dataclass(frozen=True)
class Status:
    """A training just after a step.

    Attributes:
        steps: done.
        of: asked for.
        loss: mean of the last steps.
        seconds: of training so far.
        left_s: seconds that are still to come, by steps or budget, whichever ends first.
        held_out: held-out views when they were last looked at; None: they were not.
    """

    steps: int
    of: int
    loss: float
    seconds: float
    left_s: float
    held_out: HeldOut | None


def status_of(moment: Moment, held_out: HeldOut | None) -> Status:
    """Return where a training stands."""
    recent = [step.loss for step in moment.history[-RECENT:]]
    last = moment.history[-1]
    left_s = last.seconds * (1 / max(moment.progress, 1e-9) - 1)
    loss = sum(recent) / len(recent)
    return Status(len(moment.history), moment.of, loss, last.seconds, left_s, held_out)


def line_of(status: Status) -> str:
    """Return a status as one line."""
    seen = status.held_out
    held_out = "" if seen is None else f", held-out {seen.psnr:.2f} dB (step {seen.step})"
    return (
        f"training: step {status.steps} of {status.of}, loss {status.loss:.4f}{held_out}, "
        f"{duration(status.left_s)} left"
    )
