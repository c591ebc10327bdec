"""Run one command of the audit in a process of its own, and judge how it ended.

A case is a folder, what is put into it, and a command line. The process is a fork of this one,
which has imported everything beforehand: the command line's own `main` runs there, so that exit
codes, signals, memory and CPU time are real ones. What a person would call right is in `faults_of`.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import pkgutil
import re
import resource
import shlex
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
MOST_MB, MOST_CPU_S, KILLED_AFTER_S = 1500.0, 20.0, 70
MOST_ADDRESSES = 10 * 2**30  # bytes; 4 GB of them are torch's libraries
FINE, REFUSED, LOOK = 0, 2, 3  # exit codes
# A refusal says what to do: its last part begins with one of these, or has it after a comma.
DO = (
    "add build calibrate check choose clean close convert correct crop cut draw drop export fix "
    "free give install join keep leave limit look lower make merge move name open pass put raise "
    "read rebuild reduce remove rename repair repeat rescale run save say scale see set "
    "show shrink simplify split start take train turn undistort unpack update use wait write"
).replace(" ", "|")
WHAT_TO_DO = re.compile(
    rf"(?:[;,:(?]|\bor) (?:first )?(?:{DO}|did you mean)\b[^;]*$|(?:`toonset | must )[^;]*$"
)
RAW = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
NOT_FINITE = re.compile(rb"(?<![\w.-])-?(?:nan|inf|infinity)(?![\w.-])", re.IGNORECASE)
TEXTS = (".json", ".csv", ".obj", ".txt")


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
class Ran:
    """How a process ended: exit code (negative: signal), what it printed, what it took."""

    code: int
    out: bytes
    err: bytes
    peak_mb: float = 0.0
    cpu_s: float = 0.0


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
    faults = [*faults_of(ran, case.arguments[0]), *left_behind(folder, before, case, ran)]
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


def faults_of(ran: Ran, verb: str) -> list[str]:
    """Return what is wrong with how a command ended, whatever it was."""
    lines = ran.err.decode(errors="replace").splitlines()
    said = [line for line in lines if line.startswith("toonset: ")]
    last = lines[-1][:200] if lines else ""
    faults = []
    if ran.code < 0:
        faults.append(f"died of {signal.Signals(-ran.code).name}")
    elif ran.code not in (FINE, REFUSED, LOOK) or b"Traceback" in ran.err:
        faults.append(f"exit {ran.code}: {last}")
    elif ran.code == REFUSED and not (verb == "check" and ran.out and not said):
        if len(said) != 1 or lines[-1] != said[0]:
            faults.append(f"{len(said)} lines instead of one: {last}")
        elif WHAT_TO_DO.search(said[0]) is None:
            faults.append(f"does not say what to do: {last}")
    elif ran.code != REFUSED and said:
        faults.append(f"exit {ran.code}, but: {said[0]}")
    if "Warning: " in ran.err.decode(errors="replace"):
        faults.append(f"a library's warning: {next(x for x in lines if 'Warning: ' in x)[-160:]}")
    if RAW.search((ran.out + ran.err).decode(errors="replace")):
        faults.append("prints raw control characters")
    if ran.peak_mb > MOST_MB:
        faults.append(f"{ran.peak_mb:.0f} MB, at most {MOST_MB:.0f}")
    if ran.cpu_s > MOST_CPU_S:
        faults.append(f"{ran.cpu_s:.0f} CPU s, at most {MOST_CPU_S:.0f}")
    return faults


def entries(folder: Path) -> set[str]:
    """Return the names of everything below a folder."""
    return {os.path.relpath(os.path.join(at, name), folder) for at, *kinds in os.walk(folder)
            for names in kinds for name in names}  # fmt: skip


def left_behind(folder: Path, before: set[str], case: Case, ran: Ran) -> list[str]:
    """Return what a command has left that it should not, and numbers in it that are none."""
    if ran.code < 0:  # killed: what stays is swept by the next run
        return []
    new = sorted(entries(folder) - before)
    faults = [f"left {name!r}" for name in new if Path(name).name.startswith(".")]
    inside = [name for name in new if Path(name).parts[0] not in case.outputs]
    faults += [f"wrote {name!r} outside of the output" for name in inside[:1]]
    if ran.code == REFUSED:
        faults += [f"refused, but wrote {name!r}" for name in new[:1]]
    faults += [f"{name} holds a number that is none" for name in new if not finite(folder / name)]
    return faults


def finite(file: Path) -> bool:
    """Return whether a written file holds finite numbers only, as far as it holds numbers."""
    if file.suffix == ".safetensors" and file.is_file():
        from safetensors.numpy import load

        values = load(file.read_bytes()).values()
        return all(v.dtype.kind != "f" or bool((abs(v) < math.inf).all()) for v in values)
    if file.suffix not in TEXTS or not file.is_file():
        return True
    if file.suffix == ".json":
        odd: list[Any] = []
        json.loads(file.read_bytes(), parse_constant=odd.append)
        return not odd
    return NOT_FINITE.search(file.read_bytes()) is None
