"""One record format for every measurement, and what machine it was made on."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

Direction = Literal["lower", "higher"]  # which is better
CPU_SECONDS = "CPU seconds"  # the metric that a busy machine does not stretch


@dataclass(frozen=True)
class Record:
    """A measured quantity over n samples.

    Attributes:
        method: what was measured, e.g. "default" or "nominal angles".
        metric: e.g. "rotation error".
        value: the figure to quote (the median unless `metric` says mean).
        unit: e.g. "deg", "dB", "s".
        direction: which is better, "lower" or "higher".
        n: samples.
        median: over the samples.
        p95: 95th percentile towards the bad end.
        seed: of everything random.
        machine: processor and cores.
        group: the condition, e.g. "exact".
        by_case: where methods are to be paired, the figure in every case by the case's name.
    """

    method: str
    metric: str
    value: float
    unit: str
    direction: Direction
    n: int
    median: float
    p95: float
    seed: int
    machine: str
    group: str = "all"
    by_case: Mapping[str, float] = field(default_factory=dict)


def summarise(
    samples: Sequence[float],
    *,
    method: str,
    metric: str,
    unit: str,
    direction: Direction,
    seed: int,
    group: str = "all",
    by_case: Mapping[str, float] | None = None,
) -> Record:
    """Return the record of samples; its value is their median."""
    values = np.asarray(samples, dtype=float)
    bad_end = 95 if direction == "lower" else 5
    median, tail = float(np.median(values)), float(np.percentile(values, bad_end))
    return Record(
        method,
        metric,
        median,
        unit,
        direction,
        len(values),
        median,
        tail,
        seed,
        machine(),
        group,
        by_case or {},
    )


def machine() -> str:
    """Return processor and usable cores, e.g. "AMD EPYC, 2 cores"."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        names = [
            line.split(":", 1)[1].strip()
            for line in info.read_text().splitlines()
            if line.startswith("model name")
        ]
        name = names[0] if names else name
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{name}, {cores} cores"


def as_dicts(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Return the records as plain data."""
    return [asdict(record) for record in records]


def table(records: Sequence[Record]) -> str:
    """Return the records as an aligned text table for people."""
    head = ("group", "method", "metric", "median", "p95", "unit", "n")
    rows = [
        (r.group, r.method, r.metric, f"{r.median:.3g}", f"{r.p95:.3g}", r.unit, str(r.n))
        for r in records
    ]
    return "\n".join(aligned((head, *rows), words=len(head)))


def aligned(rows: Sequence[Sequence[str]], words: int) -> list[str]:
    """Return rows as lines: so many columns of words from the left, then columns of numbers."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if number < words else cell.rjust(width)
            for number, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
