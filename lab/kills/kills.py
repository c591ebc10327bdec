"""Kill workers and batches at random moments, and see whether anything is lost or done twice."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from lab.bench.batch.sheets import MANIFEST, write_sheets
from lab.contents import contents
from toonset.apps.batch.rows import SheetRow
from toonset.apps.batch.table import Table
from toonset.apps.batch.table_file import TABLE

STAGES = ("--stages", "calibrate,palette")
TIME_LIMIT_S = 30  # hanging sheets end so
BAD, ODD = 0.02, 0.01  # of the sheets: damaged; crash or hang their worker


@dataclass(frozen=True)
class Pace:
    """Seconds between kills: of a worker, of the batch; each a range."""

    workers: tuple[float, float]
    batches: tuple[float, float]


LOCAL, RAY = Pace((1, 4), (4, 20)), Pace((4, 10), (15, 50))  # Ray's take seconds to start
LINES = {  # how bad sheets end: a hanging one may be killed too often to be late
    "torn": {"failed": "the PNG file is damaged or cut off"},
    "crash": {"quarantined": "3 times"},
    "hang": {
        "failed": f"took longer than {TIME_LIMIT_S} s",
        "quarantined": "from outside, 20 times",
    },
}


@dataclass
class Told:
    """What was done to a batch, and what was wrong afterwards."""

    killed: Counter[str]
    wrong: list[str]
    seconds: float


def make_library(folder: Path, count: int, seed: int) -> Path:
    """Write sheets, some damaged, some that crash or hang; return the manifest."""
    manifest = write_sheets(folder, count, seed)
    head, *rows = manifest.read_text().splitlines()
    data = (folder / rows[0].split(",")[0]).read_bytes()
    odd = {
        "torn": max(1, round(BAD * count)),
        "crash": max(1, round(ODD * count / 2)),
        "hang": max(1, round(ODD * count / 2)),
    }
    for kind, number in odd.items():
        for index in range(number):
            name = f"{kind}{index}.png"
            (folder / name).write_bytes(data[: len(data) // 2] if kind == "torn" else data)
            rows.append(f"{name},body0.obj,{kind},,")
    random.Random(seed).shuffle(rows)
    manifest.write_text("\n".join([head, *rows]) + "\n")
    return manifest


def command(library: Path, out: Path, *more: str) -> list[str]:
    """Return the batch's command line."""
    words = ["batch", str(library / MANIFEST), "-o", str(out), *STAGES, "-q"]
    words += ["--time-limit", str(TIME_LIMIT_S), *more]
    return [sys.executable, "-P", "-m", "lab.kills.child", *words]


def run_undisturbed(library: Path, out: Path, *more: str) -> None:
    """Run a batch to its end."""
    done = subprocess.run(command(library, out, *more), capture_output=True, text=True)
    assert done.returncode == 3, done.stderr[-3000:]


def run_disturbed(
    library: Path, out: Path, parents: int, seed: int, pace: Pace, *more: str
) -> Told:
    """Run a batch; kill workers all the time, and the batch itself so many times."""
    rng, killed, wrong = random.Random(seed), Counter[str](), list[str]()
    began = time.monotonic()
    for start in range(parents + 1):
        until = time.monotonic() + rng.uniform(*pace.batches) if start < parents else float("inf")
        process = subprocess.Popen(
            command(library, out, *more), stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        while process.poll() is None and time.monotonic() < until:
            time.sleep(rng.uniform(*pace.workers))
            victims = [pid for pid in workers_of(process.pid) if pid != process.pid]
            if victims and process.poll() is None and time.monotonic() < until:
                killed["workers"] += _kill(rng.choice(victims))
        if process.poll() is None:
            killed["batches"] += _kill(process.pid)
        _, said = process.communicate()
        if process.returncode not in (-signal.SIGKILL, 3):
            wrong.append(f"ended with {process.returncode}: {said[-2000:]}")
        if "Traceback" in said:
            wrong.append(said[-2000:])
    return Told(killed, wrong, time.monotonic() - began)


def workers_of(pid: int) -> Iterator[int]:
    """Yield the processes below one that run sheets: its forks, or Ray's that run a task."""
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            stat = (folder / "stat").read_text().rsplit(")", 1)[1].split()
            line = (folder / "cmdline").read_bytes()
        except OSError:
            continue
        if int(stat[1]) == pid and b"lab.kills.child" in line:
            yield int(folder.name)
        elif line.startswith(b"ray::run_told"):
            yield int(folder.name)


def _kill(pid: int) -> int:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return 0
    return 1


def faults(undisturbed: Path, out: Path) -> list[str]:
    """Return what is wrong with a batch that was disturbed."""
    wrong = []
    expected, found = results(undisturbed), results(out)
    for name in sorted(expected.keys() | found.keys()):
        if expected.get(name) != found.get(name):
            wrong.append(f"{name}: {'differs' if name in found and name in expected else 'is odd'}")
    with closing(Table(out / TABLE)) as table:
        for row in table.rows():
            wrong += _faults_of(row)
    wrong += [f"{path}: is left" for path in (out / "sheets").rglob(".*")]
    return wrong


def _faults_of(row: SheetRow) -> Iterator[str]:
    kind = row.name.rstrip("0123456789")
    ends = LINES.get(kind, {"done": ""})
    if row.state not in ends or ends[row.state] not in row.error:
        yield f"{row.name}: is {row.state} ({row.error!r}), not {' or '.join(ends)}"


def results(out: Path) -> dict[str, str]:
    """Return the sheets' results, by name: hashes."""
    found = contents(out / "sheets")
    return {name: value for name, value in found.items() if name.count("/") > 1}


def twice(out: Path) -> int:
    """Return how many stages of good sheets were completed more than once."""
    done = Counter((out / "completed").read_text().splitlines())
    return sum(count - 1 for count in done.values())


def try_back_end(
    work: Path, library: Path, parents: int, seed: int, pace: Pace, *more: str
) -> Told:
    """Disturb a batch on one back end; return what was wrong."""
    out = work / "disturbed"
    shutil.rmtree(out, ignore_errors=True)
    told = run_disturbed(library, out, parents, seed, pace, *more)
    told.wrong += faults(work / "undisturbed", out)
    return told
