"""Run one command of the audit in a process of its own, and judge how it ended.

A case is a folder, what is put into it, and a command line. The process is a fork of this one,
which has imported everything beforehand: the command line's own `main` runs there, so that exit
codes, signals, memory and CPU time are real ones.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import resource
import shlex
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lab.audit.judge import Ran, entries, faults_of, left_behind

ROOT = Path(__file__).resolve().parents[2]
KILLED_AFTER_S = 70  # of CPU time
MOST_ADDRESSES = 10 * 2**30  # bytes; 4 GB of them are torch's libraries


@dataclass(frozen=True)
class Case:
    """A command to try.

    Attributes:
        name: of the case, unique in its row.
        arguments: of the command line, in the case's folder.
        make: puts the inputs into the folder.
        within: changes the process before the command runs.
        outputs: names in the folder that the command may write.
        judge: further faults, of the folder after the command ran.
    """

    name: str
    arguments: Sequence[str]
    make: Callable[[Path], object] = lambda folder: None
    within: Callable[[], object] = lambda: None
    outputs: tuple[str, ...] = ("o",)
    judge: Callable[[Path, Ran], Iterable[str]] = lambda folder, ran: ()


@dataclass(frozen=True)
class Row:
    """A row of the audit's table: how many were tried, what was wrong, the largest, the slowest."""

    tried: int
    wrong: tuple[str, ...]
    peak_mb: float = 0.0
    cpu_s: float = 0.0
    slowest: str = ""
    note: str = ""


@dataclass
class Tally:
    """Count of a row while it is filled; wrong cases are made once more under `kept`."""

    kept: Path
    tried: int = 0
    wrong: list[str] = field(default_factory=list)
    peak_mb: float = 0.0
    cpu_s: float = 0.0
    slowest: str = ""

    def add(self, name: str, ran: Ran, faults: Iterable[str], again: Callable[[], str]) -> None:
        """Count one command; `again` returns the line that shows what was wrong with it."""
        self.tried += 1
        self.peak_mb = max(self.peak_mb, ran.peak_mb)
        if ran.cpu_s > self.cpu_s:
            self.cpu_s, self.slowest = ran.cpu_s, name
        if found := [*faults]:
            said = f"{name}: {'; '.join(found)}"
            self.wrong.append("".join(c if c.isprintable() else "?" for c in said))
            self.wrong[-1] += f"\n        {again()}"
            print(f"  wrong: {self.wrong[-1]}", file=sys.stderr, flush=True)

    def row(self, note: str = "") -> Row:
        """Return the row as it stands."""
        return Row(self.tried, tuple(self.wrong), self.peak_mb, self.cpu_s, self.slowest, note)


def import_everything() -> None:
    """Import all that the verbs would import, and let no library start threads."""
    os.environ |= {
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "OMP_WAIT_POLICY": "PASSIVE",
    }
    torch = importlib.import_module("torch")
    torch.set_num_threads(1)
    toonset = importlib.import_module("toonset")
    for module in pkgutil.walk_packages(toonset.__path__, "toonset."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for name in ("OpenGL.GL", "PIL.Image", "trimesh.exchange.load", "skimage.measure"):
        importlib.import_module(name)
    importlib.import_module("PIL.Image").init()


def run_cases(cases: Iterable[Case], work: Path) -> Row:
    """Run every case in a fresh folder and return the row."""
    tally = Tally(work / "wrong")
    for case in cases:
        try_case(case, work, tally)
    return tally.row()


def try_case(case: Case, work: Path, tally: Tally) -> Ran:
    """Run one case in a fresh folder and count it."""
    folder = work / "case"
    folder.mkdir()
    case.make(folder)
    before = entries(folder)
    ran = run_forked(case, folder)
    faults = [*faults_of(ran, case.arguments[0]), *left_behind(folder, before, case.outputs, ran)]
    faults += case.judge(folder, ran)
    remove(folder)
    tally.add(case.name, ran, faults, lambda: remade(case, tally))
    return ran


def remade(case: Case, tally: Tally) -> str:
    """Make a case's folder again for a person to look at; return how to run it."""
    tally.kept.mkdir(exist_ok=True)
    folder = Path(tempfile.mkdtemp(dir=tally.kept))
    case.make(folder)
    return f"cd {folder} && toonset {' '.join(map(quoted, case.arguments))}"


def quoted(word: str) -> str:
    """Return a word as bash reads it, on one printable line."""
    if word.isprintable() and word.isascii():
        return shlex.quote(word)
    return "$'" + "".join(f"\\x{byte:02x}" for byte in os.fsencode(word)) + "'"


def remove(folder: Path) -> None:
    """Remove a folder, also one that was made unreadable."""
    for parent, _, _ in os.walk(folder):
        os.chmod(parent, 0o700)
    shutil.rmtree(folder)


def run_forked(case: Case, folder: Path) -> Ran:
    """Run a case's command in a fork of this process."""
    out, err = folder.parent / "out", folder.parent / "err"
    child = os.fork()
    if child == 0:
        code = 1
        try:
            code = _command(case, folder, (out, err))
        finally:
            os._exit(code)
    _, status, used = os.wait4(child, 0)
    spent = used.ru_utime + used.ru_stime
    code = os.waitstatus_to_exitcode(status)
    return Ran(code, out.read_bytes(), err.read_bytes(), used.ru_maxrss / 1024, spent)


def _command(case: Case, folder: Path, streams: tuple[Path, Path]) -> int:
    """Run the command in the child; return the code that Python would leave with."""
    os.chdir(folder)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number, file in enumerate(streams, 1):
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)
    resource.setrlimit(resource.RLIMIT_CPU, (KILLED_AFTER_S, KILLED_AFTER_S + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (MOST_ADDRESSES, MOST_ADDRESSES))
    case.within()
    code = call_main(case.arguments)
    sys.stdout.flush()
    sys.stderr.flush()
    return code


def call_main(arguments: Sequence[str]) -> int:
    """Call the command line in this process; return its exit code, 1 after a traceback."""
    from toonset.cli.main import main

    sys.argv = ["toonset", *arguments]
    try:
        main()
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0
