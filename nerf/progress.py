"""Where a training stands, in numbers and in one line."""

from __future__ import annotations

from dataclasses import dataclass

from toonset.nerf.fitting import Moment

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
        psnr: of held-out views when they were last looked at, dB; None without.
    """

    steps: int
    of: int
    loss: float
    seconds: float
    left_s: float
    psnr: float | None


def status_of(moment: Moment, of: int, psnr: float | None) -> Status:
    """Return where a training stands."""
    recent = [step.loss for step in moment.history[-RECENT:]]
    last = moment.history[-1]
    left_s = last.seconds * (1 / max(moment.progress, 1e-9) - 1)
    return Status(len(moment.history), of, sum(recent) / len(recent), last.seconds, left_s, psnr)


def line_of(status: Status) -> str:
    """Return a status as one line."""
    held_out = "" if status.psnr is None else f", held-out {status.psnr:.2f} dB"
    return (
        f"training: step {status.steps} of {status.of}, loss {status.loss:.4f}{held_out}, "
        f"{duration(status.left_s)} left"
    )


def duration(seconds: float) -> str:
    """Return seconds as people say them: "8 s", "3 min 20 s", "2 h 5 min"."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
