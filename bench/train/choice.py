"""Whether the field that a training chooses for itself is as good as the best fixed one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bench.records.pareto import DEFAULT
from bench.train.plan import PLANES
from bench.train.run import RunResult

NEAR_DB = 0.3


@dataclass(frozen=True)
class Chosen:
    """One character under one condition: the field that was chosen, beside the fixed ones.

    Attributes:
        group: the condition.
        case: the character.
        best: name of the best fixed field.
        behind_db: how far the chosen one's held-out PSNR lies below the best's, means of the seeds
            that both have; negative: it is better.
        share: its parameters, of the finest planes'.
    """

    group: str
    case: str
    best: str
    behind_db: float
    share: float


def choices_of(runs: Sequence[RunResult]) -> list[Chosen]:
    """Return one entry per condition and character that has all fixed fields and the default."""
    found = []
    for group, case in dict.fromkeys((run.group, run.case) for run in runs if not run.note):
        own = [run for run in runs if (run.group, run.case) == (group, case) and not run.note]
        by_method = {name: _psnr(own, name) for name in (DEFAULT, *PLANES)}
        if not all(by_method.values()):
            continue
        seeds = set.intersection(*(set(psnr) for psnr in by_method.values()))
        means = {
            name: float(np.mean([psnr[seed] for seed in seeds])) for name, psnr in by_method.items()
        }
        best = max(PLANES, key=lambda name: means[name])
        sizes = {run.method: run.parameters for run in own if run.seed in seeds}
        finest = sizes[next(iter(PLANES))]
        behind = means[best] - means[DEFAULT]
        found.append(Chosen(group, case, best, behind, sizes[DEFAULT] / finest))
    return found


def choices_text(choices: Sequence[Chosen]) -> str:
    """Return what was chosen, a line per condition and one per character; empty without any."""
    lines = []
    for group in dict.fromkeys(choice.group for choice in choices):
        own = [choice for choice in choices if choice.group == group]
        near = sum(choice.behind_db <= NEAR_DB for choice in own)
        smaller = sum(choice.share < 1 for choice in own)
        lines.append(
            f"{group}: the chosen planes are within {NEAR_DB:g} dB of the best fixed ones on "
            f"{near} of {len(own)} characters, and smaller than the finest on {smaller}"
        )
        lines += [
            f"  {choice.case}: {-choice.behind_db:+.2f} dB beside {choice.best}, "
            f"{100 * choice.share:.0f} % of the finest planes' parameters"
            for choice in own
        ]
    return "\n".join(lines)


def _psnr(runs: Sequence[RunResult], method: str) -> dict[int, float]:
    found = {run.seed: run.figures.get("psnr") for run in runs if run.method == method}
    return {seed: value for seed, value in found.items() if value is not None}
