"""What must not get worse: figures of a quick bench, and those of a committed one.

A guard is one figure with what it may lose. Seconds differ from machine to machine, so those of the
processor are guarded as multiples of what `yardstick_s` took in the same run; those of the clock,
which other programs stretch, are not.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import cv2
import numpy as np

from lab.bench.records.record import DEFAULT, Direction, Record, aligned
from toonset.errors import BundleError

FORMAT = 1
SECONDS, CPU, YARDS = ("s", "s/MP"), "CPU", "yardsticks"
LOSS = {"dB": 0.3, "1": 0.02, "%": 2.0, "deg": 0.1, "views": 0.0, "px": 0.1, "levels/px": 0.1}
SHARE = {"deg": 0.2, YARDS: 0.5}  # of the value, on top of it
ANY_SHARE = 0.05  # of figures in other units
ROUNDING = 1e-9  # of any figure: errors of 1e-16 are none
SMALL = 0.2  # share of a number without unit that is lost at most: errors of 0.02 may not double
YARDSTICK_RUNS = 5
HEAD = ("", "subject", "group", "metric", "committed", "now", "may lose", "unit")


@dataclass(frozen=True)
class Guard:
    """A figure of a subject's default setting, as its record has it, and how much may be lost."""

    subject: str
    group: str
    metric: str
    value: float
    unit: str
    direction: Direction
    tolerance: float
    n: int
    seed: int
    machine: str

    @property
    def key(self) -> tuple[str, str, str]:
        """Return what it is compared by."""
        return self.subject, self.group, self.metric


@dataclass(frozen=True)
class Compared:
    """A committed guard beside the figure of now; None: nothing like it was measured."""

    committed: Guard
    now: float | None

    @property
    def lost(self) -> float:
        """Return by how much the figure is worse, negative where it is better."""
        if self.now is None:
            return np.inf
        loss = self.now - self.committed.value
        return loss if self.committed.direction == "lower" else -loss

    @property
    def fails(self) -> bool:
        """Return whether more is lost than may be."""
        return self.lost > self.committed.tolerance


def yardstick_s() -> float:
    """Return CPU seconds of work like the stages' own: a product, a filter, a distance transform.

    The fastest of some runs: other programs only ever slow it down.
    """
    rng = np.random.default_rng(0)
    matrix = rng.random((768, 768), dtype=np.float32)
    picture = rng.random((1024, 1024), dtype=np.float32)
    spots = (picture > 0.01).astype(np.uint8)
    found = []
    for _ in range(YARDSTICK_RUNS):
        began = time.process_time()
        np.matmul(matrix, matrix)
        cv2.GaussianBlur(picture, (0, 0), 3)
        cv2.distanceTransform(spots, cv2.DIST_L2, 5)
        np.sort(picture, axis=1)
        found.append(time.process_time() - began)
    return min(found)


def guards_of(subject: str, records: Sequence[Record], yard_s: float) -> list[Guard]:
    """Return the guards of a bench's default setting; `yard_s` is `yardstick_s` of the same run."""
    own = [record for record in records if record.method == DEFAULT]
    kept = [r for r in own if r.unit not in SECONDS or r.metric.startswith(CPU)]
    return [_guard(subject, record, yard_s) for record in kept]


def compared(committed: Sequence[Guard], now: Sequence[Guard]) -> list[Compared]:
    """Return every committed guard beside its like of now."""
    found = {guard.key: guard.value for guard in now}
    return [Compared(guard, found.get(guard.key)) for guard in committed]


def as_text(rows: Sequence[Compared]) -> str:
    """Return what failed, worst first, and a line that counts."""
    failed = sorted(
        (row for row in rows if row.fails), key=lambda row: -row.lost / row.committed.tolerance
    )
    better = sum(row.lost < -row.committed.tolerance for row in rows)
    counts = f"{len(rows)} figures: {len(failed)} worse, {better} better than they may vary"
    if not failed:
        return counts
    cells = [_cells(row) for row in failed]
    return "\n".join([*aligned([HEAD, *cells], words=4), counts])


def as_plain(guards: Sequence[Guard]) -> dict[str, Any]:
    """Return the guards as data for JSON."""
    return {"format": FORMAT, "guards": [asdict(guard) for guard in guards]}


def from_plain(data: Any, place: str) -> list[Guard]:
    """Return the guards of a file.

    Raises:
        BundleError: the data hold no guards.
    """
    try:
        guards = [Guard(**entry) for entry in data["guards"]]
    except (KeyError, TypeError) as error:
        raise BundleError(f"{place}: holds no figures to compare with; pass --renew") from error
    if data.get("format") != FORMAT:
        raise BundleError(f"{place}: format {data.get('format')}, {FORMAT} is read; pass --renew")
    return guards


def _guard(subject: str, record: Record, yard_s: float) -> Guard:
    value, unit = record.value, record.unit
    if unit in SECONDS:
        value, unit = value / yard_s, YARDS
    spared = min(LOSS[unit], SMALL * abs(value)) if unit == "1" else LOSS.get(unit, 0.0)
    share = SHARE.get(unit, 0.0 if unit in LOSS else ANY_SHARE)
    tolerance = max(spared + share * abs(value), ROUNDING)
    about = (record.direction, tolerance, record.n, record.seed, record.machine)
    return Guard(subject, record.group, record.metric, value, unit, *about)


def _cells(row: Compared) -> tuple[str, ...]:
    guard = row.committed
    now = "missing" if row.now is None else f"{row.now:.4g}"
    figures = (f"{guard.value:.4g}", now, f"{guard.tolerance:.2g}", guard.unit)
    return ("worse", guard.subject, guard.group, guard.metric, *figures)
