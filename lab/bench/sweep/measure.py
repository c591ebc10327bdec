"""Measure every named number: run what reaches it with half and double of it.

Every value is tried in a process of its own, forked from one in which nothing has run yet: no cache
that it fills and no crash reaches another. A case counts only where a line that loads the number is
run in it; in the others nothing can change.
"""

from __future__ import annotations

import importlib
import multiprocessing
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from types import CodeType, FrameType
from typing import Any

import cv2

from lab.bench.sweep.cases import Case
from lab.bench.sweep.numbers import Named, Place, Source, uses_of
from lab.bench.sweep.outcomes import Difference, Outcome, difference
from lab.bench.sweep.patches import EXTREMES, WAYS, FixedError, Way, described, patch

FORK = multiprocessing.get_context("fork")
PATIENCE, LEAST_S = 20, 20  # times the usual seconds of a case, and at least
LONGEST_S = 3600.0  # of one process
MEMORY = 6 << 30  # bytes
LOST_ENOUGH, MOVED_ENOUGH = 2, 4  # cases: the others need not be run
MODULES = ("toonset.palette", "toonset.dataset")


@dataclass(frozen=True, eq=False)
class Baseline:
    """What the cases come to as the numbers are.

    Attributes:
        cases: the quickest first.
        outcomes: of each.
        reached: lines that each runs, of those that load a number.
        seconds: of each, while its lines are noted.
    """

    cases: list[Case]
    outcomes: list[Outcome]
    reached: list[frozenset[Place]]
    seconds: list[float]


@dataclass(frozen=True)
class Measured:
    """What half or double of a number changes.

    Attributes:
        number: its module and name.
        value: as it is.
        way: what was tried.
        new: the value tried; "" where it cannot be changed.
        fixed: why it cannot be changed, or lines that keep the old value.
        reached: cases that run a line that loads it.
        ran: of these, until enough were lost.
        moved: names of cases, and how their outcomes differ.
    """

    number: tuple[str, str]
    value: str
    way: Way
    new: str
    fixed: str
    reached: int
    ran: int
    moved: dict[str, Difference]

    @property
    def lost(self) -> list[str]:
        """Return the cases that are lost."""
        return [name for name, own in self.moved.items() if "lost" in own]


def load(sources: dict[str, Source]) -> None:
    """Import all modules whose numbers cases can reach."""
    cv2.setNumThreads(1)
    for name in sources:
        if name.startswith(MODULES):
            try:
                importlib.import_module(name)
            except ImportError:  # of an extra
                continue


def baseline(cases: Sequence[Case], places: frozenset[Place]) -> Baseline:
    """Run all cases, each in a process of its own, and note which lines it runs."""
    files = {path for path, _ in places}
    run = [in_fork(partial(_noted, case, places, files), LONGEST_S) for case in cases]
    for case, result in zip(cases, run, strict=True):
        if isinstance(result, str):
            raise RuntimeError(f"{case.name}: {result}")
    order = sorted(range(len(cases)), key=lambda n: run[n][2])
    return Baseline(
        [cases[n] for n in order],
        [run[n][0] for n in order],
        [run[n][1] for n in order],
        [run[n][2] for n in order],
    )


def measure(
    number: Named, sources: dict[str, Source], usual: Baseline, *, extremes: bool = False
) -> Iterator[Measured]:
    """Yield what half and double of a number change, or 0 and very much of it.

    Args:
        number: in a loaded module.
        sources: of all modules.
        usual: without changes.
        extremes: 0 and very much, each until a case changes.
    """
    uses = uses_of(number, sources)
    places = frozenset().union(*(use.places for use in uses))
    reached = [n for n, own in enumerate(usual.reached) if own & places]
    value = vars(sys.modules[number.module]).get(number.name)
    lines = [f"{use.module}:{line}" for use in uses for line in use.fixed]
    for way in EXTREMES if extremes else WAYS:

        def tried(way: Way = way) -> tuple[str, int, dict[str, Difference]]:
            new = described(patch(number, uses, way))
            moved: dict[str, Difference] = {}
            ran = 0
            for n in reached:
                case, ran = usual.cases[n], ran + 1
                limit_s = max(LEAST_S, PATIENCE * usual.seconds[n])
                signal.setitimer(signal.ITIMER_PROF, limit_s)  # of processor time
                differs: Difference
                try:
                    differs = difference(usual.outcomes[n], case.run())
                except Exception as error:
                    differs = {"lost": f"crash: {type(error).__name__}"}
                if differs:
                    moved[case.name] = differs
                lost = sum("lost" in own for own in moved.values())
                enough = 1 if extremes else MOVED_ENOUGH
                if lost >= LOST_ENOUGH or len(moved) >= enough:
                    break
            return new, ran, moved

        found = in_fork(tried, LONGEST_S)
        if isinstance(found, str):
            fixed = found.removeprefix("FixedError: ")
            moved: dict[str, Difference] = {}
            if fixed == found:  # it ended without a word
                ended: Difference = {"lost": found}
                moved, fixed = {"a case": ended}, ""
            new, ran = "", len(reached)
        else:
            (new, ran, moved), fixed = found, ", ".join(lines)
        yield Measured(
            (number.module, number.name),
            described(value),
            *(way, new, fixed, len(reached), ran, moved),
        )


def in_fork(run: Callable[[], Any], limit_s: float) -> Any:
    """Return what a function returns in a fork of this process; a text where it ends otherwise."""
    ours, theirs = FORK.Pipe(duplex=False)
    worker = FORK.Process(target=_answer, args=(run, theirs))
    worker.start()
    theirs.close()
    try:
        return ours.recv() if ours.poll(limit_s) else "no answer"
    except EOFError:
        return "the process ended"
    finally:
        worker.kill()
        worker.join()
        ours.close()


def _answer(run: Callable[[], Any], into: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    try:
        into.send(run())
    except FixedError as error:
        into.send(f"FixedError: {error}")


def _noted(
    case: Case, places: frozenset[Place], files: set[str]
) -> tuple[Outcome, frozenset[Place], float]:
    """Return the outcome of a case, the places that it runs, and its seconds."""
    found: set[Place] = set()
    known: dict[CodeType, bool] = {}

    def lines(frame: FrameType, event: str, _: object) -> Any:
        place = frame.f_code.co_filename, frame.f_lineno
        if place in places:
            found.add(place)
        return lines

    def calls(frame: FrameType, event: str, _: object) -> Any:
        code = frame.f_code
        if code.co_filename not in files:
            return None
        if code not in known:
            own = {line for *_, line in code.co_lines() if line}
            known[code] = any((code.co_filename, line) in places for line in own)
        return lines(frame, event, _) if known[code] else None

    start = time.process_time()
    sys.settrace(calls)
    try:
        outcome = case.run()
    finally:
        sys.settrace(None)
    return outcome, frozenset(found), time.process_time() - start
