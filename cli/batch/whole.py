"""Say where a batch stands as a whole, put its parts together, take sheets out of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toonset.cli.batch.dispatch import PICTURES, THUMBS
from toonset.cli.batch.page import write_page
from toonset.cli.batch.sheets import named
from toonset.cli.batch.table import BAD, SHARDS, TABLE, SheetRow, Table, tables_in
from toonset.cli.common.output import Printer, counted
from toonset.errors import UsageError

VERDICTS = ("ok", "weak", "ambiguous", "failed", "none")
MOST_BAD = 20  # lines of what failed


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


def say_status(out: Path, printer: Printer) -> None:
    """Say where a batch stands, its parts together."""
    status = Status()
    with ExitStack() as stack:
        tables = _opened(out, stack)
        whole = tables[0]
        if len(tables) > 1:  # a sheet may be in several
            whole = stack.enter_context(closing(Table(Path(":memory:"), make=True)))
            for table in tables:
                whole.take_in(table)
        status.add(whole.rows())
    printer.result({"out": out, **status.values()}, "\n".join(status.lines()))


def merge(out: Path, printer: Printer) -> None:
    """Put the parts' tables into the batch's own, and write the page."""
    if not (shards := [name for name in tables_in(out) if name != TABLE]):
        raise UsageError(f"{out}: has no {SHARDS}; run toonset batch --shard first")
    with closing(Table(out / TABLE, make=True)) as table:
        for name in shards:
            with closing(Table(out / name)) as part:
                table.take_in(part)
                table.store = part.store
        write_page(out, table.rows(), out.resolve().name, store=table.store)
        count = len(table.names())
    parts = int(shards[0].partition("of")[2].removesuffix(".sqlite"))
    if len(shards) < parts:
        printer.say(f"{parts - len(shards)} of {parts} parts are missing")
    text = (
        f"{out}: {counted(count, 'sheet')} from {len(shards)} parts; look at {out / 'index.html'}"
    )
    printer.result({"out": out, "sheets": count, "parts": len(shards)}, text)


def forget(out: Path, patterns: Sequence[str], printer: Printer) -> None:
    """Take sheets out of the table and its parts, and write the page."""
    with ExitStack() as stack:
        tables = _opened(out, stack)
        every = {name for table in tables for name in table.names()}
        gone = named(every, patterns, "--forget")
        for table in tables:
            table.forget(gone)
        if tables[0].path.name == TABLE:
            write_page(out, tables[0].rows(), out.resolve().name, store=tables[0].store)
    for name in gone:
        for end in PICTURES:
            (out / THUMBS / f"{name}{end}").unlink(missing_ok=True)
    text = f"{out}: forgot {', '.join(sorted(gone))}; delete their folders in sheets/ if you like"
    printer.result({"out": out, "forgot": sorted(gone)}, text)


def _opened(out: Path, stack: ExitStack) -> list[Table]:
    """Return the open tables of a batch's folder."""
    return [stack.enter_context(closing(Table(out / name))) for name in tables_in(out) or [TABLE]]


def _said(counts: Counter[str]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counts.most_common() if count)
