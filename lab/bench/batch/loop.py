"""What a batch's loop costs with 1,000 cores: workers that do nothing."""

from __future__ import annotations

import os
import time
from base64 import b64encode
from collections import deque
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from toonset.apps.batch.dispatch import Limits, Runner
from toonset.apps.batch.job import Job, Outcome
from toonset.apps.batch.rows import Plan, StageRow
from toonset.apps.batch.stages import Entry
from toonset.apps.batch.table import Table
from toonset.apps.batch.table_file import TABLE

KEYS = {"calibrate": "0" * 64, "palette": "1" * 64}
AT_ONCE = 1000  # sheets that run
ANSWERS = 50  # of them that end at a time
PICTURE = b64encode(os.urandom(4000)).decode()  # as large as one of a small sheet


class Nothing:
    """Workers that say at once that a sheet is done."""

    capacity = AT_ONCE

    def __init__(self) -> None:
        """Begin with none."""
        self._jobs = deque[Job]()

    def submit(self, job: Job) -> None:
        """Take a sheet."""
        self._jobs.append(job)

    def wait(self, timeout_s: float) -> list[Outcome]:
        """Return the next that are done."""
        count = min(ANSWERS, len(self._jobs))
        return [self._outcome(self._jobs.popleft()) for _ in range(count)]

    def close(self) -> None:
        """Leave nothing."""

    def _outcome(self, job: Job) -> Outcome:
        rows = tuple(StageRow(stage, key, "done", ended=1.0) for stage, key in job.keys.items())
        return Outcome(job.name, "done", rows, pictures={".webp": PICTURE})


def report(work: Path, sheets: int, say: Callable[[str], None]) -> None:
    """Print what a sheet takes of the command that gives it out and records it.

    Args:
        work: folder for the batch.
        sheets: in it.
        say: prints a line.
    """
    plans = [Plan(Entry(f"s{n:06d}", (f"/s{n:06d}.png",)), n, KEYS) for n in range(sheets)]
    with closing(Table(work / TABLE, make=True)) as table:
        table.plan(plans, lambda name: set())
        table.choose(plan.entry.name for plan in plans)
        runner = Runner(work, Limits(60), tuple(KEYS))
        began, cpu = time.perf_counter(), time.process_time()
        runner.run(table, Nothing(), lambda *_: None, lambda: None)
        spent, cpu = time.perf_counter() - began, time.process_time() - cpu
    say(
        f"loop with {AT_ONCE:,} workers: {sheets / spent:,.0f} sheets a second, "
        f"{1000 * cpu / sheets:.2f} ms of CPU a sheet (n = {sheets:,})"
    )
