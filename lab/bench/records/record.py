"""One record format for every measurement, its table, and what machine it was made on."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

Direction = Literal["lower", "higher"]  # which is better
DEFAULT = "default"  # the method that users get
CPU_SECONDS = "CPU seconds"  # the metric that a busy machine does not stretch


@dataclass(frozen=True)
class Record:
    """A measured quantity over n samples.

    Attributes:
        method: what was measured, e.g. "default" or "nominal angles".
        metric: e.g. "rotation error".
        value: the figure to quote (the median unless `metric` says otherwise).
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

    @property
    def mean(self) -> float:
        """Return the mean over the cases; the value where cases are not known."""
        return float(np.mean(list(self.by_case.values()))) if self.by_case else self.value


@dataclass(frozen=True)
class Recorder:
    """Makes the records of one method under one condition."""

    method: str
    group: str
    seed: int

    def samples(
        self,
        metric: str,
        values: Sequence[float],
        unit: str = "deg",
        direction: Direction = "lower",
        by_case: Mapping[str, float] | None = None,
    ) -> Record:
        """Return the record of at least one sample; its value is their median."""
        samples = np.asarray(values, dtype=float)
        median = float(np.median(samples))
        tail = float(np.percentile(samples, 95 if direction == "lower" else 5))
        of = (self.method, metric, median, unit, direction, len(samples), median, tail)
        return Record(*of, self.seed, machine(), self.group, by_case or {})

    def total(self, metric: str, hits: Sequence[bool], unit: str = "views") -> Record:
        """Return how many of at least one it is; median and p95 are the same number."""
        return replace(self.samples(metric, [float(sum(hits))], unit), n=len(hits))

    def share(
        self, metric: str, hits: Sequence[bool], direction: Direction = "higher"
    ) -> list[Record]:
        """Return which share it is, 0 to 1; nothing of no samples."""
        if not hits:
            return []
        record = self.samples(metric, [sum(hits) / len(hits)], "1", direction)
        return [replace(record, n=len(hits))]


@dataclass(frozen=True)
class Column:
    """A column of the table of methods.

    Attributes:
        metric: whose records it shows.
        heading: over it.
        form: of the number.
        statistic: "value", "median", "p95", or "mean": over the cases.
        scale: what the number is multiplied by, e.g. 100 for a share.
    """

    metric: str
    heading: str
    form: str = "{:.3g}"
    statistic: Literal["value", "median", "p95", "mean"] = "value"
    scale: float = 1.0

    def cell(self, record: Record | None) -> str:
        """Return the cell's text; "-" without a record."""
        return (
            "-"
            if record is None
            else self.form.format(self.scale * getattr(record, self.statistic))
        )


def methods_table(records: Sequence[Record], columns: Sequence[Column]) -> str:
    """Return a text per group: a row per method, n, and the columns that the group has."""
    lines: list[str] = []
    for group in dict.fromkeys(record.group for record in records):
        own = {(r.method, r.metric): r for r in records if r.group == group}
        metrics = {metric for _, metric in own}
        shown = [column for column in columns if column.metric in metrics]
        rows = [("method", "n", *(column.heading for column in shown))]
        for method in dict.fromkeys(method for method, _ in own):
            found = [own.get((method, column.metric)) for column in shown]
            n = next((str(record.n) for record in found if record is not None), "")
            rows.append((method, n, *(c.cell(r) for c, r in zip(shown, found, strict=True))))
        lines += ["", group, *aligned(rows, words=1)]
    return "\n".join(lines[1:])


def machine() -> str:
    """Return processor and usable cores, e.g. "AMD EPYC, 2 cores"."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{(names or [name])[0]}, {cores} cores"


def as_dicts(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Return the records as plain data."""
    return [asdict(record) for record in records]


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
