"""Let every system call that touches a verb's outputs fail, or the process be killed there.

    python -m tests.faults [CASE ...] [--quick] [--kills N] [--rounds N] [--signals N]

Whatever happens, the outputs are the old ones or the new ones, whole, once the next run has looked
at the place; nothing hidden stays; the exit code and the line on stderr fit. A verb runs once to
count its calls (`Calls`). Then a process runs it once more and becomes a server at its first call
and after every computation: for the calls up to the next one, and every kind of fault, it forks a
child that goes on from there, and puts the place back. So a fault costs milliseconds, no training.

Linux only. Exit code 1 and one line for everything that is wrong.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import itertools
import json
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

Contents = dict[str, str]
Hook = Callable[[int], None]

ERRORS = {"EIO": errno.EIO, "ENOSPC": errno.ENOSPC, "EACCES": errno.EACCES}
FAILURES = tuple(f"{name}{way}" for name in ERRORS for way in (" once", " from there"))
PATCHED = ("open", "fsync", "rename", "replace", "link", "unlink", "rmdir", "mkdir", "chmod")
VOLATILE = ("metrics.json", "history.csv", "manifest.json")  # of a run: they hold seconds
FINE = (0, 3)
COMPUTATION_S = 0.05  # between two calls
SOON_S = 2.0  # from a signal to the end


@dataclass(frozen=True)
class Case:
    """A verb and its outputs: `{i}` stands for the folder of inputs, `{o}` for that of outputs.

    Attributes:
        name: of the case.
        new: arguments.
        old: arguments whose output is there before, replaced with --force; () where `before` is.
        before: an input that is copied to be written into.
    """

    name: str
    new: str
    old: str = ""
    before: str = ""

    @property
    def starts(self) -> dict[str, str]:
        """Return the arguments by what is there before: nothing, an old output."""
        return {"new": self.new} | ({"old": f"{self.new} --force"} if self.old else {})


CASES = (
    Case("split", "split {i}/sheet.png -o {o}/a", "split {i}/single.png -o {o}/a"),
    Case(
        "calibrate",
        "calibrate {i}/sheet.png --mesh {i}/mannequin.obj -o {o}/a",
        "calibrate {i}/sheet.png --mesh {i}/mannequin.obj --drop 1 -o {o}/a",
    ),
    Case("palette", "palette {i}/bundle -o {o}/a", "palette {i}/other -o {o}/a"),
    Case("palette-in", "palette {o}/bare", before="bare"),
    Case("palette-again", "palette {o}/bundle --max-colors 2", before="bundle"),
    Case(
        "recolor",
        "recolor {i}/bundle --recolor red=#010203 -o {o}/a",
        "recolor {i}/bundle --recolor red=#040506 -o {o}/a",
    ),
    Case(
        "train",
        "train {i}/bundle --steps 2 --threads 1 -o {o}/a",
        "train {i}/bundle --steps 1 --threads 1 -o {o}/a",
    ),
    Case(
        "render",
        "render {i}/run --turntable 2 --size 32 -o {o}/a",
        "render {i}/run --turntable 1 --size 32 -o {o}/a",
    ),
    Case("view", "view {i}/run -o {o}/a.html", "view {i}/bundle -o {o}/a.html"),
    Case(
        "evaluate",
        "evaluate {i}/run --bundle {i}/bundle --test {i}/bundle -o {o}/a",
        "evaluate {i}/run --bundle {i}/bundle --test {i}/other -o {o}/a",
    ),
    Case("consistency", "consistency {i}/bundle -o {o}/a", "consistency {i}/other -o {o}/a"),
    Case("mesh", "mesh {i}/run -o {o}/a.obj", "mesh {i}/run --faces 200 -o {o}/a.obj"),
    *(
        Case(
            f"export-{to}", *(f"export {{i}}/{b} --to {to} -o {{o}}/a" for b in ("bundle", "other"))
        )
        for to in ("colmap", "nerfstudio", "blender-synthetic", "blender", "gltf")
    ),
    Case("import", "import {i}/colmap -o {o}/a", "import {i}/colmap2 -o {o}/a"),
    Case("mannequin", "mannequin -o {o}/a.obj", "mannequin --heads 4 -o {o}/a.obj"),
    Case(
        "synth",
        "synth {i}/mannequin.obj --views 2 --cell 64 -o {o}/a",
        "synth {i}/mannequin.obj --views 3 --cell 64 -o {o}/a",
    ),
)


@dataclass(frozen=True)
class Ended:
    """How a child ended: exit code, negative by a signal; its stderr; how long it took."""

    code: int
    err: str
    seconds: float = 0.0


@dataclass(frozen=True)
class Row:
    """What was tried, and a line for each that went wrong."""

    tried: int
    wrong: tuple[str, ...] = ()

    def __add__(self, other: Row) -> Row:
        """Return both together."""
        return Row(self.tried + other.tried, self.wrong + other.wrong)


class Calls:
    """Calls of the operating system that touch files below a folder; each asks `hook` first."""

    def __init__(self, root: Path, hook: Hook) -> None:
        """Count from now on in this process."""
        self.root, self.hook, self.count = str(root), hook, 0
        for name in PATCHED:
            setattr(os, name, self._counted(getattr(os, name)))
        real = os.fdopen
        os.fdopen = lambda fd, mode="r", *rest: (  # type: ignore[assignment]
            _Written(self, fd) if mode == "wb" else real(fd, mode, *rest)
        )
        from toonset import write

        exchanged = write._exchanged
        write._exchanged = lambda new, path: self._exchange(exchanged, new, path)

    def reached(self) -> None:
        """Count a call."""
        self.count += 1
        self.hook(self.count)

    def _exchange(self, real: Callable[[Path, Path], bool], new: Path, path: Path) -> bool:
        try:
            self.reached()
        except OSError:
            return False  # as a file system says that cannot
        return real(new, path)

    def _counted(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            if any(map(self._is_ours, (*arguments[:2], named.get("dir_fd")))):
                self.reached()
            return real(*arguments, **named)

        return call

    def _is_ours(self, argument: Any) -> bool:
        if isinstance(argument, int) and not isinstance(argument, bool) and argument > 2:
            try:
                argument = os.readlink(f"/proc/self/fd/{argument}")
            except OSError:
                return False
        return isinstance(argument, str | Path) and str(argument).startswith(self.root)


class _Written:
    """A new file: half of what is to be written is there when a call fails."""

    def __init__(self, calls: Calls, descriptor: int) -> None:
        self._calls, self._file = calls, open(descriptor, "wb", buffering=0)
        self.flush, self.fileno = self._file.flush, self._file.fileno

    def __enter__(self) -> _Written:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, data: bytes) -> None:
        """Write half, count, write the rest."""
        self._file.write(data[: len(data) // 2])
        self._calls.reached()
        self._file.write(data[len(data) // 2 :])


def fault(kind: str, at: int) -> Hook:
    """Return what happens at the call of a number, or from it on."""

    def hook(number: int) -> None:
        if number < at or (number > at and not kind.endswith("from there")):
            return
        if kind == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        code = ERRORS[kind.split()[0]]
        raise OSError(code, os.strerror(code), "a file")

    return hook


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
            with _leaving(self.root / f"err{name}"):
                if hook is not None:
                    Calls(self.out, hook)
                _main(arguments or self.arguments)
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


def every_call(place: Place, *, quick: bool) -> Row:
    """Let every call of a verb fail in every way and be its last; `quick`: in one way, in turn."""
    place.restore(place.first)
    if (server := os.fork()) == 0:
        calls: list[Calls] = []

        def serve(number: int) -> None:
            if number in place.stops:
                after = (stop for stop in place.stops if stop > number)
                _serve(place, calls[0], number, next(after, place.calls + 1), quick=quick)

        with _leaving(place.root / "err"):
            calls.append(Calls(place.out, serve))
            _main(place.arguments)
    os.waitpid(server, 0)
    rows = [json.loads(file.read_text()) for file in place.root.glob("served-*")]
    assert len(rows) == len(place.stops), (place.root / "err").read_text()
    return Row(sum(row[0] for row in rows), tuple(line for row in rows for line in row[1]))


def _serve(place: Place, calls: Calls, begin: int, end: int, *, quick: bool) -> None:
    """Return in children, each with a fault ahead, and when all have ended in the server, too."""
    on, calls.hook = calls.hook, lambda number: None
    now, row = place.keep(f"call-{begin}"), Row(0)
    held = {file: place.root / f"held-{begin}-{file.name}" for file in place.out.rglob(".*.lock")}
    for file, aside in held.items():
        os.link(file, aside)

    def begin_again() -> None:
        place.restore(now)
        for file, aside in held.items():  # no copy: the one that this process has locked
            file.unlink()
            os.link(aside, file)

    for at in range(begin, end):
        for kind in ("kill", *((FAILURES[at % len(FAILURES)],) if quick else FAILURES)):
            begin_again()
            if (child := os.fork()) == 0:
                _errors_into(place.root / "err-child")
                calls.hook, calls.count = fault(kind, at), begin
                calls.hook(begin)
                return
            row += place.judge(f"{kind}, call {at}", place.wait(child, "-child"))
    begin_again()
    (place.root / f"served-{begin}").write_text(json.dumps([row.tried, row.wrong]))
    calls.hook, calls.count = on, begin


def kills(place: Place, count: int, draw: random.Random) -> Row:
    """Kill a verb at random moments."""
    row = Row(0)
    for _ in range(count):
        place.restore(place.first)
        moment = draw.uniform(0, place.seconds)
        child = place.begin()
        time.sleep(moment)
        os.kill(child, signal.SIGKILL)
        row += place.judge(f"kill after {moment:.2f} s", place.wait(child))
    return row


def signals(place: Place, count: int, draw: random.Random) -> Row:
    """End a verb by signals at random moments: with the right code, soon, and nothing left."""
    row = Row(0)
    for i in range(count):
        place.restore(place.first)
        number = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[i % 3]
        moment = draw.uniform(0, place.seconds)
        child = place.begin()
        time.sleep(moment)
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, number)
        ended = place.wait(child)
        what = f"{number.name} after {moment:.2f} s"
        row += place.judge(what, ended)
        if ended.code not in (*FINE, 128 + number):
            row += Row(0, (f"{place.name}, {what}: exit code {ended.code}; {ended.err[-300:]!r}",))
        if ended.seconds > SOON_S and ended.code not in FINE:
            row += Row(0, (f"{place.name}, {what}: {ended.seconds:.1f} s to the end",))
    return row


def pairs(place: Place, rounds: int) -> Row:
    """Let two processes write to one place at the same time: one does, one is refused.

    A round in which one had ended before the other began to write is none.
    """
    row, names = Row(0), ("-0", "-1")
    while row.tried < rounds:
        place.restore(place.first)
        children = [place.begin(hook=place.noting(f"times{n}"), name=n) for n in names]
        ended = [place.wait(child, n) for child, n in zip(children, names, strict=True)]
        done = [end for end in ended if end.code in FINE]
        if len(done) == 2:
            one, other = (place.noted(f"times{n}") for n in names)
            if one[-1] < other[0] or other[-1] < one[0]:
                continue
        what = f"round {row.tried}"
        row += place.judge(what, done[0] if done else ended[0])
        if len(done) != 1:
            row += Row(0, (f"{place.name}, {what}: exit codes {[e.code for e in ended]}",))
    return row


def contents(folder: Path) -> Contents:
    """Return what is below a folder: hashes by path, but for files that hold seconds."""
    found = {}
    for path in sorted(folder.rglob("*")):
        held = path.is_file() and path.name not in VOLATILE
        data = re.sub(rb'"seconds": \{[^}]*\}', b"", path.read_bytes()) if held else b""
        found[str(path.relative_to(folder))] = sha256(data).hexdigest()
    return found


CALIBRATE = "calibrate sheet.png --mesh mannequin.obj -o"
INPUTS = {  # what verbs read: what it is made of, and how
    "bare": ("sheet.png", [f"{CALIBRATE} bare"]),
    "bundle": ("sheet.png", [f"{CALIBRATE} bundle", "palette bundle"]),
    "other": ("sheet.png", [f"{CALIBRATE} other --drop 1", "palette other"]),
    "run": ("bundle", ["train bundle --steps 2 --threads 1 -o run"]),
    "colmap": ("bundle", ["export bundle --to colmap -o colmap"]),
    "colmap2": ("other", ["export other --to colmap -o colmap2"]),
}


def draw_sheet(folder: Path) -> None:
    """Draw a sheet, the first drawing of it, and the mannequin."""
    from bench.cases.bodies import random_body
    from toonset.dataset.images.picture import encode_png
    from toonset.dataset.mesh.load import save_obj
    from toonset.dataset.synthetic.options import SynthOptions
    from toonset.dataset.synthetic.turnaround import make_turnaround

    drawn = make_turnaround(random_body(11), SynthOptions(views=4, cell_px=96, elevation_deg=8), 11)
    (folder / "sheet.png").write_bytes(encode_png(drawn.sheet))
    (folder / "single.png").write_bytes(encode_png(drawn.sheet[:, :96].copy()))
    (folder / "mannequin.obj").write_bytes(save_obj(drawn.mesh))


def make_input(folder: Path, name: str) -> None:
    """Make what a verb reads, if it is not there."""
    if name in INPUTS and not (folder / name).exists():
        source, lines = INPUTS[name]
        make_input(folder, source)
        with contextlib.chdir(folder):
            for line in lines:
                _in_child(line)


def _in_child(line: str) -> None:
    if (child := os.fork()) == 0:
        with _leaving(Path("err")):
            _main(line.split())
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code in FINE, (line, code, Path("err").read_text())


@contextlib.contextmanager
def _leaving(err: Path) -> Iterator[None]:
    """Run a block as a child's whole life, its stderr in a file."""
    _errors_into(err)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    code: object = 0
    try:
        yield
    except SystemExit as leaving:
        code = leaving.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    finally:
        with contextlib.suppress(OSError):
            sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 1)


def _errors_into(file: Path) -> None:
    os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)


def _main(arguments: Sequence[str]) -> None:
    from toonset.cli.main import main

    sys.argv = ["toonset", *arguments]
    main()


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


def main() -> None:
    """Print a table, and what is wrong."""
    one_thread = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
    os.environ |= dict.fromkeys(one_thread, "1")  # a fork loses the others
    parser = argparse.ArgumentParser(prog="tests.faults")
    parser.add_argument("cases", nargs="*", help=", ".join(case.name for case in CASES))
    parser.add_argument("--quick", action="store_true", help="one kind of error a call, in turn")
    parser.add_argument("--kills", type=int, default=0, help="at random moments, of each case")
    parser.add_argument("--rounds", type=int, default=0, help="of two processes, of each case")
    parser.add_argument("--signals", type=int, default=0, help="of each case")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    draw, total = random.Random(asked.seed), Row(0)
    with tempfile.TemporaryDirectory(prefix="toonset-faults-") as folder:
        inputs = Path(folder)
        if (child := os.fork()) == 0:
            with _leaving(inputs / "err"):
                draw_sheet(inputs)
        os.waitpid(child, 0)
        for case in CASES:
            for start in case.starts if not asked.cases or case.name in asked.cases else ():
                for name in re.findall(r"{i}/(\S+)", f"{case.new} {case.old} {{i}}/{case.before}"):
                    make_input(inputs, name)
                place = Place(inputs, case, start)
                rows = {
                    "faults": every_call(place, quick=asked.quick),
                    "kills": kills(place, asked.kills, draw),
                    "signals": signals(place, asked.signals, draw),
                    "pairs": pairs(place, asked.rounds),
                }
                shutil.rmtree(place.root)
                counts = ", ".join(f"{r.tried} {name}" for name, r in rows.items() if r.tried)
                row = sum(rows.values(), Row(0))
                total += row
                print(f"{place.name}: {place.calls} calls; {counts}; {len(row.wrong)} wrong")
                print(*(f"  {line}" for line in row.wrong), sep="\n", end="\n" * bool(row.wrong))
                sys.stdout.flush()
    print(f"all: {total.tried} tried, {len(total.wrong)} wrong (seed {asked.seed})")
    sys.exit(bool(total.wrong))


if __name__ == "__main__":
    main()
