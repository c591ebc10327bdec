"""How many claims and results a second one table takes, with many rows in it."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from toonset.apps.batch.rows import Plan, StageRow
from toonset.apps.batch.stages import Entry
from toonset.apps.batch.table import Table
from toonset.apps.batch.table_file import TABLE

KEYS = {"calibrate": "0" * 64, "palette": "1" * 64}


def report(work: Path, rows: int, tried: int, say: Callable[[str], None]) -> None:
    """Print the pace of every operation.

    Args:
        work: folder for the table.
        rows: sheets in it.
        tried: operations of a kind.
        say: prints a line.
    """
    with closing(Table(work / TABLE, make=True)) as table:
        began = time.perf_counter()
        plans = [Plan(Entry(f"s{n:06d}", (f"/s{n:06d}.png",)), n, KEYS) for n in range(rows)]
        for start in range(0, rows, 500):
            table.plan(plans[start : start + 500], lambda name: {*KEYS})
        say(f"put in: {rows / (time.perf_counter() - began):,.0f} sheets a second")
        began = time.perf_counter()
        table.choose(plan.entry.name for plan in plans)
        claims = [table.claim("me", 60) for _ in range(tried)]
        say(f"claim: {tried / (time.perf_counter() - began):,.0f} a second, {rows:,} rows")
        done = [StageRow(stage, key, "done", ended=1.0) for stage, key in KEYS.items()]
        began = time.perf_counter()
        for row in claims:
            assert row is not None
            table.record("me", row.name, done)
        say(f"record: {tried / (time.perf_counter() - began):,.0f} a second")
        began = time.perf_counter()
        table.renew("me", 60)
        say(f"renew: {1000 * (time.perf_counter() - began):.2f} ms")
        began = time.perf_counter()
        count = sum(1 for _ in table.rows())
        say(f"read: {count / (time.perf_counter() - began):,.0f} sheets a second")
        began = time.perf_counter()
        for start in range(0, rows, 500):
            table.plan(plans[start : start + 500], lambda name: {*KEYS})
        say(f"plan again: {rows / (time.perf_counter() - began):,.0f} sheets a second")
    size = sum(file.stat().st_size for file in work.iterdir())
    say(f"{size / rows:,.0f} bytes a sheet")
