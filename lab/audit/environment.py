"""R14: surroundings that are poor or broken, each in a new process as a shell would start it."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from lab.audit.case import ROOT, Row, Tally, quoted, remove
from lab.audit.judge import Ran, entries, faults_of
from lab.audit.material import FEW, Material

SPLIT = ("split", "sheet.png", "-o", "o")
PALETTE = ("palette", "sheet.png", "-o", "o")
CALIBRATE = ("calibrate", "sheet.png", "--mesh", "m.obj", "-o", "o")
TRAIN = ("train", "bundle", *FEW[:1], "5", *FEW[2:], "-o", "o")
RENDER = ("render", "run", "--turntable", "1", "--size", "24", "-o", "o")
WORK = (PALETTE, CALIBRATE, TRAIN, RENDER)
EXPORT = ("export", "bundle", "--to", "colmap", "-o", "o")
NOT_UTF8 = os.fsdecode(b"n\xff")
LIMITS = (
    ("12 file descriptors", resource.RLIMIT_NOFILE, 12),
    ("files of 8 kB", resource.RLIMIT_FSIZE, 8 * 1024),
    ("400 MB of address space", resource.RLIMIT_AS, 400 * 2**20),
)
CLOSED_PIPE = 1  # exit code, as Unix tools have it, where nobody reads on


@dataclass(frozen=True)
class Surroundings:
    """How a command is started.

    Attributes:
        name: what is poor about it.
        line: of the command.
        shell: what is written behind it in a shell, as `>/dev/full`.
        environment: variables that are set; None takes one away.
        limit: sets limits in the new process.
        cwd: in which folder, relative to the one with the inputs.
        before: shell words before it.
        codes: exit codes that are right besides 0, 2 and 3.
    """

    name: str
    line: tuple[str, ...] = SPLIT
    shell: str = ""
    environment: Mapping[str, str | None] = field(default_factory=dict)
    limit: Callable[[], object] = lambda: None
    cwd: str = "."
    before: str = ""
    codes: tuple[int, ...] = ()


def surroundings() -> Iterator[Surroundings]:
    """Yield all of them."""
    for line in (SPLIT, *WORK):
        yield Surroundings("no HOME", line, environment={"HOME": None, "TOONSET_CACHE": None})
        yield Surroundings("LC_ALL=C", line, environment={"LC_ALL": "C", "LANG": None})
        yield Surroundings("a folder that is not UTF-8", line, cwd=NOT_UTF8)
    for line in (PALETTE, CALIBRATE):
        home = {"HOME": "/proc", "TOONSET_CACHE": None}
        yield Surroundings("read-only HOME", line, environment=home)
        yield Surroundings("no TMPDIR", line, environment={"TMPDIR": "/nowhere"})
        yield Surroundings("full TMPDIR", line, environment={"TMPDIR": "/dev/full"})
    ascii_only = {"PYTHONIOENCODING": "ascii:strict"}
    strict = {"PYTHONIOENCODING": "utf-8:strict"}
    for line in (SPLIT, PALETTE):
        yield Surroundings("ASCII streams", line, environment=ascii_only)
        for redirected in (">/dev/full", "2>/dev/full", ">&-", "2>&-", "<&-", ">&- 2>&- <&-"):
            unheard = (2,) if "2>" in redirected else ()  # nobody reads what to do
            yield Surroundings(redirected, line, redirected, codes=unheard)
        odd = (*line[:-1], NOT_UTF8)
        yield Surroundings("an output that is not UTF-8", odd, environment=strict)
        for name, what, most in LIMITS:
            limit = partial(resource.setrlimit, what, (most, most))
            yield Surroundings(name, line, limit=limit)
    for line in (("info", "bundle"), ("info", "bundle", "--json"), ("--help",)):
        yield Surroundings("a pipe that is closed", line, "| true", codes=(CLOSED_PIPE,))
    for line in (("info",), ("--help",)):
        yield Surroundings("a deleted folder", line, before="mkdir x && cd x && rmdir ../x &&")
    yield Surroundings("no PATH", EXPORT, environment={"PATH": None})
    yield Surroundings("no display, no EGL", RENDER, environment={"PYOPENGL_PLATFORM": "x"})


def row(material: Material) -> Row:
    """Start every command in its surroundings."""
    tally = Tally(material.work / "wrong")
    for one in surroundings():
        folder = material.work / "poor"
        inputs = folder / one.cwd
        inputs.mkdir(parents=True)
        material.copy_all(inputs, "sheet.png", "m.obj", "bundle", "run")
        before = entries(folder)
        ran = start(one, inputs)
        faults = [] if ran.code in one.codes else faults_of(ran, one.line[0])
        new = entries(folder) - before
        faults += [f"left {name!r}" for name in new if Path(name).name.startswith(".")]
        remove(folder)
        name = f"{one.name}: {one.line[0]}"
        tally.add(name, ran, faults, lambda one=one: f"{settings(one)}{command(one, ('toonset',))}")
    return tally.row()


def start(one: Surroundings, folder: Path) -> Ran:
    """Run the command in a new process; streams that the shell does not redirect are caught."""
    environment = {name: os.environ[name] for name in ("PATH", "TOONSET_CACHE")}
    environment |= {"PYTHONPATH": str(ROOT), "HOME": str(folder)}
    for name, value in one.environment.items():
        environment.pop(name, None)
        environment |= {} if value is None else {name: value}
    program = (sys.executable, "-P", "-m", "toonset")
    with subprocess.Popen(
        [shutil.which("bash") or "bash", "-c", f"set -o pipefail; {command(one, program)}"],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=one.limit,
    ) as process:
        out, err = process.communicate(timeout=300)
    code = process.returncode
    return Ran(code - 256 if code > 128 else code, out, err)


def settings(one: Surroundings) -> str:
    """Return a case's variables as a shell has them."""
    parts = [
        f"-u {name}" if value is None else f"{name}={value}"
        for name, value in one.environment.items()
    ]
    return f"env {' '.join(parts)} " * bool(parts)


def command(one: Surroundings, program: tuple[str, ...]) -> str:
    """Return the command as a shell reads it."""
    return f"{one.before} {' '.join(map(quoted, (*program, *one.line)))} {one.shell}".strip()
