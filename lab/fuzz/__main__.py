"""Give mutated files to every reader, and see that nothing but `ToonsetError` comes out.

    python -m lab.fuzz [TARGET ...] [--seconds 30] [--seed N]

Inputs are the files of lab/fuzz/corpus/TARGET with changes that follow from the seed and a
number. They are taken by a fork of this process that may use 5 s of CPU and 1.5 GB. Exit code 1 if
anything was found; what was printed belongs into the corpus once it is mended:

    base64 -d > lab/fuzz/corpus/TARGET/NAME
"""

from __future__ import annotations

import argparse
import base64
import mmap
import os
import random
import resource
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from lab.fuzz.mutate import mutated
from lab.fuzz.targets import TARGETS, Target

ROOT = Path(__file__).resolve().parents[2]
CORPUS = ROOT / "lab/fuzz/corpus"
MOST_FINDINGS = 10  # of a target, each of another kind
MOST_WAIT_S = 120  # in which nothing need happen: other programs have the cores, too
SAID = 400  # bytes of how an input ended


@dataclass(frozen=True)
class Bars:
    """What one input may cost at most: seconds of CPU, MB of memory beside the readers' 150."""

    cpu_s: float = 5
    memory_mb: int = 1350


@dataclass(frozen=True)
class Finding:
    """An input that ended badly, and how."""

    data: bytes
    how: str


@dataclass(frozen=True)
class Tried:
    """How many inputs a target took, and what was found."""

    executions: int
    findings: tuple[Finding, ...]


class Shared:
    """Memory that a fork writes and its parent reads: the input's number, and how it ended."""

    def __init__(self) -> None:
        self.memory = mmap.mmap(-1, 8 + SAID)

    @property
    def number(self) -> int:
        """Return the number of the input that is taken."""
        return int(struct.unpack_from("<q", self.memory)[0])

    @number.setter
    def number(self, number: int) -> None:
        self.memory[:] = struct.pack("<q", number) + bytes(SAID)

    @property
    def said(self) -> str:
        """Return how it ended, "" if it did not say."""
        return self.memory[8:].rstrip(b"\0").decode("utf-8", "replace")

    @said.setter
    def said(self, text: str) -> None:
        self.memory[8:] = text.encode("utf-8", "replace")[:SAID].ljust(SAID, b"\0")


def corpus(name: str) -> tuple[bytes, ...]:
    """Return the files of a target's corpus, in the order of their names."""
    return tuple(file.read_bytes() for file in sorted((CORPUS / name).iterdir()))


def inputs_of(name: str, seed: int) -> Callable[[int], bytes]:
    """Return a target's input of a number: the corpus as it is, then what is changed by lot."""
    files = corpus(name)

    def make(number: int) -> bytes:
        if number < len(files):
            return files[number]
        return mutated(files, random.Random(f"{name} {seed} {number}"))

    return make


def fuzz(
    take: Target,
    make: Callable[[int], bytes],
    seconds: float,
    bars: Bars | None = None,
    most: int = sys.maxsize,
) -> Tried:
    """Give a target the inputs 0, 1, 2, ... until time is over, or there were so many.

    Args:
        take: the target.
        make: the input of a number.
        seconds: how long.
        bars: what an input may cost.
        most: the number of inputs.
    """
    until, shared = time.monotonic() + seconds, Shared()

    def goes_on() -> bool:
        return shared.number < most and time.monotonic() < until

    found: dict[str, Finding] = {}
    while goes_on() and len(found) < MOST_FINDINGS:
        with tempfile.TemporaryDirectory() as folder:
            child = os.fork()
            if child == 0:
                _take_all(take, make, goes_on, shared, bars or Bars(), Path(folder))
            _, status = os.waitpid(child, 0)
        if code := os.waitstatus_to_exitcode(status):
            how = shared.said or f"died of {signal.Signals(-code).name}"
            found.setdefault(how.partition(": ")[0], Finding(make(shared.number), how))
            shared.number += 1
    return Tried(shared.number, tuple(found.values()))


def _take_all(
    take: Target,
    make: Callable[[int], bytes],
    goes_on: Callable[[], bool],
    shared: Shared,
    bars: Bars,
    folder: Path,
) -> NoReturn:
    """Take inputs in the child while it goes on, or until one ends badly."""
    code = 1
    try:
        _limit(bars)
        _forget_peak()
        before_mb = _peak_mb()
        while goes_on():
            data = make(shared.number)
            with _watched(bars):
                take(data, folder)
            if _peak_mb() > before_mb + bars.memory_mb:
                raise MemoryError(f"over {bars.memory_mb} MB")
            shared.number += 1
        code = 0
    except BaseException as error:
        shared.said = f"{type(error).__name__} at {_place(error)}: {error}"
    finally:
        os._exit(code)


def _forget_peak() -> None:
    """Let the peak of memory begin at what is held now: the parent may have held more."""
    Path("/proc/self/clear_refs").write_text("5")


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _place(error: BaseException) -> str:
    """Return the last lines of toonset and of all that an error went through."""
    places = [(place.filename, place.lineno) for place in traceback.extract_tb(error.__traceback__)]
    ours = [place for place in places if Path(place[0]).is_relative_to(ROOT)]
    return " < ".join(f"{Path(file).name}:{line}" for file, line in (places[-1], ours[-1]))


def _limit(bars: Bars) -> None:
    """Let nothing be printed, no core be dumped, and twice the memory be asked for at most."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + 2 * bars.memory_mb * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


@contextmanager
def _watched(bars: Bars) -> Iterator[None]:
    """Let the system kill this process when an input takes too long: SIGPROF, or SIGALRM asleep."""
    signal.setitimer(signal.ITIMER_PROF, bars.cpu_s)
    signal.alarm(MOST_WAIT_S)
    yield
    signal.setitimer(signal.ITIMER_PROF, 0)
    signal.alarm(0)


def main() -> None:
    """Fuzz the targets, print a line for each, and every finding."""
    parser = argparse.ArgumentParser(prog="python -m lab.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(TARGETS)}")
    parser.add_argument("--seconds", type=float, default=30, help="for each target")
    parser.add_argument("--seed", type=int, default=random.randrange(10**6))
    given = parser.parse_args()
    if unknown := [name for name in given.targets if name not in TARGETS]:
        parser.error(f"no target {unknown[0]}; choose of {', '.join(TARGETS)}")
    found = 0
    for name in given.targets or TARGETS:
        began = time.monotonic()
        tried = fuzz(TARGETS[name], inputs_of(name, given.seed), given.seconds)
        rate = tried.executions / (time.monotonic() - began)
        print(
            f"{name:18} seed {given.seed}  {tried.executions:8} inputs {rate:7.0f} per s  "
            f"{len(tried.findings)} findings",
            *[f"  {name}, seed {given.seed}: {one.how}\n  {base64.b64encode(one.data).decode()}"
              for one in tried.findings],
            sep="\n",
            flush=True,
        )  # fmt: skip
        found += len(tried.findings)
    sys.exit(int(found > 0))


if __name__ == "__main__":
    main()
