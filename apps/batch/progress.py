"""Say where a batch stands: while it runs a line for every stage, and as a whole."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from toonset.apps.batch.rows import SheetRow, StageRow
from toonset.apps.batch.stages import dependents
from toonset.apps.batch.table import BAD
from toonset.errors import counted, duration

LIVE_S, LOG_S = 0.5, 30.0  # between lines on a terminal; in a log
HOUR_S = 3600.0
UNREACHED = "not reached"  # stages after one that failed
ERASE_LINE = "\x1b[K"
VERDICTS = ("ok", "weak", "ambiguous", "failed", "none")
MOST_BAD = 20  # lines of what failed


class Teller(Protocol):
    """Who is told how it goes: a command's printer."""

    @property
    def quiet(self) -> bool:
        """Return whether results and reasons only are wanted."""
        ...

    def say(self, text: str) -> None:
        """Take a line for people, which is left out where they want quiet."""

    def doubt(self, text: str) -> None:
        """Take a line that says what to look at."""

    def progress(self, text: str) -> None:
        """Take where the work stands, which replaces what was said so before."""


@dataclass(frozen=True)
class Result:
    """What a command of a batch found.

    Attributes:
        values: for machines.
        text: for people.
        failed: how many sheets.
    """

    values: dict[str, Any]
    text: str
    failed: int = 0


@dataclass
class Progress:
    """Where the stages of the chosen sheets stand.

    Attributes:
        tell: who is told.
        counts: of sheets by state, for every stage.
    """

    tell: Teller
    counts: Mapping[str, Counter[str]]
    _began: float = field(default_factory=time.monotonic)
    _said: float = field(default_factory=time.monotonic)
    _first: Mapping[str, int] = field(default_factory=dict)
    _lines: int = 0

    def __post_init__(self) -> None:
        """Remember what was done before."""
        self._first = {stage: _ended(count) for stage, count in self.counts.items()}

    def take(self, name: str, rows: Iterable[StageRow], due: Container[str]) -> None:
        """Count the stages of a sheet that ended, of those that were due; say what failed."""
        ended = {row.stage: row for row in rows}
        failed = next((row for row in ended.values() if row.state in BAD), None)
        for stage, count in self.counts.items():
            if stage in ended or (failed is not None and stage in due):
                count["waiting"] -= 1
                count[ended[stage].state if stage in ended else UNREACHED] += 1
        if failed is not None:
            self._erase()
            self.tell.doubt(f"{name}: {failed.state}: {failed.error}")

    def tick(self) -> None:
        """Say where it stands, if that is due."""
        live = sys.stderr.isatty()
        if self.tell.quiet or time.monotonic() - self._said < (LIVE_S if live else LOG_S):
            return
        self._said = time.monotonic()
        self._erase()
        lines = self.lines()
        for line in lines:
            self.tell.say(line)
        self._lines = len(lines) if live else 0

    def close(self, counts: Mapping[str, Counter[str]]) -> None:
        """Say where it stands at the end, with what others did."""
        self._erase()
        self.counts = counts
        for line in self.lines():
            self.tell.say(line)

    def _erase(self) -> None:
        """Go back over the lines that were said last, on a terminal."""
        if self._lines:
            print(f"\x1b[{self._lines}A\x1b[J", end="", file=sys.stderr, flush=True)
            self._lines = 0

    def lines(self) -> list[str]:
        """Return a line for every stage: how many are done, failures, rate, time left."""
        spent = max(time.monotonic() - self._began, 1e-9)
        width = max(map(len, self.counts), default=0)
        found = []
        for stage, count in self.counts.items():
            rate = (_ended(count) - self._first[stage]) / spent
            parts = [f"{stage:{width}}  {count['done']} of {sum(count.values())}"]
            parts += [f"{count[state]} {state}" for state in BAD if count[state]]
            if rate > 0:
                parts.append(f"{rate * HOUR_S:,.0f} an hour")
                parts += [f"{duration(count['waiting'] / rate)} left"] * (count["waiting"] > 0)
            found.append(", ".join(parts))
        return found


def count_stages(rows: Iterable[SheetRow], stages: Sequence[str]) -> dict[str, Counter[str]]:
    """Return how many sheets are in which state, for every stage."""
    counts = {stage: Counter[str]() for stage in stages}
    for row in rows:
        found = {one.stage: one.state for one in row.stages}
        cut = {s for one in row.stages if one.state in BAD for s in dependents(one.stage)}
        for stage in stages:
            state = found.get(stage, "waiting")
            is_cut = state == "waiting" and (row.state in BAD or stage in cut)
            counts[stage][UNREACHED if is_cut else state] += 1
    return counts


def _ended(count: Counter[str]) -> int:
    return sum(count.values()) - count["waiting"]


@dataclass
class Status:
    """Where a batch stands, counted."""

    sheets: Counter[str] = field(default_factory=Counter)
    verdicts: Counter[str] = field(default_factory=Counter)
    stages: dict[str, Counter[str]] = field(default_factory=dict)
    wall_s: Counter[str] = field(default_factory=Counter)
    peak_mb: dict[str, float] = field(default_factory=dict)
    bad: list[tuple[str, str, str]] = field(default_factory=list)  # name, state, why

    def add(self, rows: Iterable[SheetRow]) -> None:
        """Count a table's sheets."""
        for row in rows:
            self.sheets[row.state] += 1
            self.verdicts[row.verdict or "none"] += 1
            for one in row.stages:
                self.stages.setdefault(one.stage, Counter())[one.state] += 1
                self.wall_s[one.stage] += one.wall_s  # type: ignore[assignment]
                self.peak_mb[one.stage] = max(self.peak_mb.get(one.stage, 0), one.peak_mb)
            if row.state in BAD:
                self.bad.append((row.name, row.state, row.error))

    def values(self) -> dict[str, Any]:
        """Return it for machines."""
        return {
            "sheets": dict(self.sheets),
            "verdicts": dict(self.verdicts),
            "stages": {stage: dict(count) for stage, count in self.stages.items()},
            "failed": [{"name": n, "state": s, "error": e} for n, s, e in self.bad],
        }

    def lines(self) -> list[str]:
        """Return it for people."""
        total = sum(self.sheets.values())
        said = ", ".join(f"{self.verdicts[v]} {v}" for v in VERDICTS if self.verdicts[v])
        found = [f"{counted(total, 'sheet')}: {_said(self.sheets)}", f"cameras: {said}"]
        for stage, count in self.stages.items():
            mean, peak = self.wall_s[stage] / max(count["done"], 1), self.peak_mb[stage]
            each = f"; {mean:.1f} s each, {peak:.0f} MB at most" if count["done"] else ""
            found.append(f"{stage}: {_said(count)}{each}")
        found += [f"{name}: {state}: {error}" for name, state, error in self.bad[:MOST_BAD]]
        more = len(self.bad) - MOST_BAD
        return [*found, *([f"... and {more} more; all are in index.html"] if more > 0 else [])]


def _said(counts: Counter[str]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counts.most_common() if count)
