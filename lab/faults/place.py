"""A verb's inputs and outputs, and what is right about them after a fault."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from lab.faults.calls import Calls, Hook
from lab.faults.cases import Case
from lab.faults.child import FINE, Ended, call_main, leaving

Contents = dict[str, str]

VOLATILE = ("metrics.json", "history.csv", "manifest.json")  # of a run: they hold seconds
COMPUTATION_S = 0.05  # between two calls


@dataclass(frozen=True)
class Row:
    """What was tried, and a line for each that went wrong."""

    tried: int
    wrong: tuple[str, ...] = ()

    def __add__(self, other: Row) -> Row:
        """Return both together."""
        return Row(self.tried + other.tried, self.wrong + other.wrong)


class Place:
    """Folder of a case: inputs to read, outputs as they are before, and what may come of them."""

    def __init__(self, inputs: Path, case: Case, start: str) -> None:
        """Prepare the outputs and run the verb once, undisturbed."""
        self.root = Path(tempfile.mkdtemp(prefix="toonset-faults-"))
        self.name, self.out = f"{case.name} ({start})", self.root / "o"
        self.out.mkdir()
        words = {"i": inputs, "o": self.out}
        self.arguments = case.starts[start].format(**words).split()
        if case.before:
            shutil.copytree(inputs / case.before, self.out / case.before)
        elif start == "old":
            ended = self.run(case.old.format(**words).split())
            assert ended.code in FINE, ended
        self.first = self.keep("first")
        self.before = contents(self.out)
        ended = self.run(hook=self.noting("times"))
        assert ended.code in FINE, ended
        times = self.noted("times")
        self.seconds, self.after = ended.seconds, contents(self.out)
        assert self.after != self.before, self.name
        gaps = [after - before for before, after in itertools.pairwise(times)]
        self.calls = len(times)
        self.stops = [1, *(i for i, gap in enumerate(gaps, start=2) if gap > COMPUTATION_S)]

    def noting(self, name: str) -> Hook:
        """Return what writes down when a child makes its calls."""
        times: list[float] = []

        def note(_: int) -> None:
            times.append(time.monotonic())
            (self.root / name).write_text(json.dumps(times))

        return note

    def noted(self, name: str) -> list[float]:
        """Return when a child made its calls."""
        return list(json.loads((self.root / name).read_text()))

    def keep(self, name: str) -> Path:
        """Keep the outputs as they are, under a name."""
        return Path(shutil.copytree(self.out, self.root / name, symlinks=True))

    def restore(self, kept: Path) -> None:
        """Put the outputs back."""
        for entry in self.out.iterdir():
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        shutil.copytree(kept, self.out, symlinks=True, dirs_exist_ok=True)

    def run(self, arguments: Sequence[str] = (), hook: Hook | None = None) -> Ended:
        """Run the verb in a child."""
        return self.wait(self.begin(arguments, hook))

    def begin(self, arguments: Sequence[str] = (), hook: Hook | None = None, name: str = "") -> int:
        """Begin the verb in a child; return its process."""
        if (child := os.fork()) == 0:
            with leaving(self.root / f"err{name}"):
                if hook is not None:
                    Calls(self.out, hook)
                call_main(arguments or self.arguments)
        return child

    def wait(self, child: int, name: str = "") -> Ended:
        """Wait for a child."""
        begun = time.monotonic()
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        err = (self.root / f"err{name}").read_text("utf-8", "replace")
        return Ended(code, err, time.monotonic() - begun)

    def judge(self, what: str, ended: Ended) -> Row:
        """Let the next run look at the place; say what is wrong."""
        _look_again(self.out)
        found, wrong = contents(self.out), list(_said_wrongly(ended))
        if ended.code in FINE and found != self.after:
            wrong.append("said to be done and is not")
        if found not in (self.before, self.after):
            wrong.append(f"neither the old nor the new output: {_differing(found, self.after)}")
        lines = (f"{self.name}, {what}: {text}; {ended.err.strip()[-200:]!r}" for text in wrong)
        return Row(1, tuple(lines))


def contents(folder: Path) -> Contents:
    """Return what is below a folder: hashes by path, but for files that hold seconds."""
    found = {}
    for path in sorted(folder.rglob("*")):
        held = path.is_file() and path.name not in VOLATILE
        data = re.sub(rb'"seconds": \{[^}]*\}', b"", path.read_bytes()) if held else b""
        found[str(path.relative_to(folder))] = sha256(data).hexdigest()
    return found


def _look_again(out: Path) -> None:
    """Do what the next run does before it writes or reads."""
    from toonset import lock

    for file in out.rglob(".*.lock"):  # the server has it still, the system had let it go
        file.unlink()
        file.touch()
    own = lock._HELD, lock._GUARD  # a server's, perhaps taken
    lock._HELD, lock._GUARD = {}, threading.Lock()
    in_bundles = [folder / "palette.json" for folder in out.iterdir() if folder.is_dir()]
    for path in (out / "a", out / "a.obj", out / "a.html", *in_bundles):
        for place in {path, lock.set_of(path)}:
            with lock.hold(place):
                pass
    lock._HELD, lock._GUARD = own


def _said_wrongly(ended: Ended) -> Iterator[str]:
    lines = [line for line in ended.err.splitlines() if line.startswith("toonset: ")]
    if "Traceback" in ended.err or ended.code == 1:
        yield "a traceback"
    if ended.code == 2 and (len(lines) != 1 or not ended.err.endswith(f"{lines[0]}\n")):
        yield "not one line of a reason"


def _differing(found: Contents, other: Contents) -> list[str]:
    names = sorted(found.keys() | other.keys())
    return [name for name in names if found.get(name) != other.get(name)][:6]
