"""Sheets per hour: one worker, two, and one command per sheet; what a batch costs beside stages."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from lab.bench.batch.cluster import make_cluster
from lab.bench.batch.sheets import MANIFEST
from toonset.apps.batch.table import Table
from toonset.apps.batch.table_file import TABLE

CHOSEN = ("--stages", "calibrate,palette")
LOOK_S = 0.5  # between looks at the parent's memory


@dataclass(frozen=True)
class Run:
    """One run of a batch.

    Attributes:
        workers: how many.
        wall_s: from the command to its end.
        first_s: from the command until the first sheet was begun.
        stages_s: wall time of all stages of all sheets.
        cpu_s: of all stages.
        sheets: that were done.
        memory_mb: of the parent's own, at a quarter of the time and at the end.
    """

    workers: int
    wall_s: float
    first_s: float
    stages_s: float
    cpu_s: float
    sheets: int
    memory_mb: tuple[float, float]

    @property
    def overhead_ms(self) -> float:
        """Return what a sheet costs beside its stages, the start left out."""
        working_s = (self.wall_s - self.first_s) * self.workers
        return 1000 * (working_s - self.stages_s) / self.sheets


def run_batch(library: Path, out: Path, workers: int, more: Sequence[str] = ()) -> Run:
    """Run a batch of the sheets of `bench.batch.sheets`."""
    command = [sys.executable, "-P", "-m", "toonset", "batch", str(library / MANIFEST), "-q"]
    command += ["-o", str(out), *CHOSEN, "--workers", str(workers), *more]
    began, clock = time.monotonic(), time.time()
    seen: list[float] = []
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:  # noqa: S603
        while process.poll() is None:
            seen += own_memory_mb(process.pid)
            time.sleep(LOOK_S)
    wall = time.monotonic() - began
    assert process.returncode == 0, process.returncode
    with closing(Table(out / TABLE)) as table:
        rows = [row for sheet in table.rows() for row in sheet.stages]
    first = min(row.ended - row.wall_s for row in rows) - clock
    sheets = sum(row.stage == "calibrate" for row in rows)
    spent, cpu = sum(row.wall_s for row in rows), sum(row.cpu_s for row in rows)
    return Run(workers, wall, first, spent, cpu, sheets, (seen[len(seen) // 4], seen[-1]))


def own_memory_mb(pid: int) -> list[float]:
    """Return the memory of a process that it shares with no file, if it is there still."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
        return [int(status.split("RssAnon:")[1].split()[0]) / 1024]
    except (OSError, IndexError):
        return []


def run_commands(library: Path, work: Path, count: int) -> float:
    """Return the seconds per sheet of one `calibrate` and one `palette` command for each."""
    lines = (library / MANIFEST).read_text().splitlines()[1:][:count]
    began = time.monotonic()
    for number, line in enumerate(lines):
        sheet, mesh = line.split(",")[:2]
        bundle = str(work / f"bundle{number}")
        given = [str(library / sheet), "--mesh", str(library / mesh), "-o", bundle]
        for words in (["calibrate", *given, "-q"], ["palette", bundle, "-q"]):
            command = [sys.executable, "-P", "-m", "toonset", *words]
            done = subprocess.run(command, capture_output=True)  # noqa: S603
            assert done.returncode in (0, 3), done.stderr
    return (time.monotonic() - began) / len(lines)


def report(library: Path, work: Path, alone: int, say: Callable[[str], None]) -> None:
    """Print a line for every way to run the sheets."""
    each = run_commands(library, work, alone)
    say(f"one command each: {each:.2f} s a sheet (n = {alone})")
    runs = [_told(library, work, workers, say) for workers in (1, 2)]
    say(f"2 workers : 1 worker = {runs[0].wall_s / runs[1].wall_s:.3f} times as fast")
    warm = runs[0].wall_s / runs[0].sheets
    say(f"1 warm worker : one command each = {each / warm:.2f} times as fast")


def report_ray(library: Path, work: Path, say: Callable[[str], None]) -> None:
    """Print what two nodes of Ray take for the sheets, of one core each, beside two workers."""
    cluster = make_cluster()
    try:
        here = _told(library, work, 2, say)
        there = _told(library, work, 2, say, "--ray", cluster.address)
    finally:
        cluster.shutdown()
    say(f"two nodes of Ray : 2 workers = {here.wall_s / there.wall_s:.3f} times as fast")


def _told(library: Path, work: Path, workers: int, say: Callable[[str], None], *more: str) -> Run:
    """Run the sheets, and print what it took."""
    out = work / "-".join(("out", str(workers), *more[:1]))
    one = run_batch(library, out, workers, more)
    shutil.rmtree(out / "sheets")
    say(
        f"{workers} workers{' of Ray' * bool(more)}: {one.sheets} sheets in {one.wall_s:.1f} s, "
        f"{3600 * one.sheets / one.wall_s:,.0f} an hour; {one.first_s:.1f} s to start"
    )
    say(
        f"  a sheet: stages {one.stages_s / one.sheets:.3f} s (CPU "
        f"{one.cpu_s / one.sheets:.3f}), {one.overhead_ms:.1f} ms beside them"
    )
    quarter, end = one.memory_mb
    say(f"  parent's memory: {quarter:.1f} MB at a quarter, {end:.1f} MB at the end")
    return one
