"""Say where a batch stands while it runs: a line for every stage."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from toonset.cli.batch.stages import dependents
from toonset.cli.batch.table import BAD, SheetRow, StageRow
from toonset.cli.common.output import Printer

LIVE_S, LOG_S = 0.5, 30.0  # between lines on a terminal; in a log
HOUR_S = 3600.0
UNREACHED = "not reached"  # stages after one that failed
ERASE_LINE = "\x1b[K"


@dataclass
class Progress:
    """Where the stages of the chosen sheets stand.

    Attributes:
        printer: of the command.
        counts: of sheets by state, for every stage.
    """

    printer: Printer
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
            self.printer.doubt(f"{name}: {failed.state}: {failed.error}")

    def tick(self) -> None:
        """Say where it stands, if that is due."""
        live = sys.stderr.isatty()
        if self.printer.quiet or time.monotonic() - self._said < (LIVE_S if live else LOG_S):
            return
        self._said = time.monotonic()
        self._erase()
        lines = self.lines()
        for line in lines:
            self.printer.say(line)
        self._lines = len(lines) if live else 0

    def close(self, counts: Mapping[str, Counter[str]]) -> None:
        """Say where it stands at the end, with what others did."""
        self._erase()
        self.counts = counts
        for line in self.lines():
            self.printer.say(line)

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
                parts += [f"{_duration(count['waiting'] / rate)} left"] * (count["waiting"] > 0)
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


def _duration(seconds: float) -> str:
    from toonset.nerf.train.progress import duration

    return duration(seconds)
