"""Soak: one process that works on and on must not grow."""

from __future__ import annotations

import os
import resource
from collections.abc import Callable, Sequence
from pathlib import Path

from lab.audit.case import Row, Tally, call_main
from lab.audit.judge import Ran, faults_of
from lab.audit.material import FEW, Material

GROWTH, SETTLED, LAST = 1.05, 8, 5  # the last five rounds against those from the ninth on


def row(material: Material) -> Row:
    """Train and render 20 times, calibrate and list colours 15 times."""
    tally = Tally(material.work / "wrong")
    bundle, run, sheet, body = map(material.path, ("bundle", "run", "sheet.png", "m.obj"))
    again = ("--force", "-q", "-o")
    turn = ("render", run, "--turntable", "2", "--size", "32", *again, "t")
    train = ("train", bundle, *FEW, *again, "o")
    calibrate = ("calibrate", sheet, "--mesh", body, *again, "b")
    notes = [
        soaked(20, (train, turn, turn), tally, material),
        soaked(15, (calibrate, ("palette", "b", "-q")), tally, material),
    ]
    return tally.row("; ".join(notes))


def soaked(rounds: int, lines: Sequence[Sequence[str]], tally: Tally, material: Material) -> str:
    """Run the lines in one child process round after round; return its memory in words."""
    folder = material.work / f"soak-{lines[0][0]}"
    folder.mkdir()

    def work() -> None:
        for _ in range(rounds):
            codes = [call_main(line) for line in lines]
            with Path("rss.txt").open("a") as log:
                log.write(f"{rss_mb():.0f} {max(codes)}\n")

    ran = in_child(work, folder)
    found = [line.split() for line in (folder / "rss.txt").read_text().splitlines()]
    memory = [int(mb) for mb, _ in found]
    faults = [f"round {i}: exit {code}" for i, (_, code) in enumerate(found) if code not in "03"]
    faults += faults_of(Ran(ran.code, b"", ran.err, ran.peak_mb), lines[0][0])
    if len(memory) == rounds and max(memory) > GROWTH * max(memory[SETTLED:-LAST]):
        faults.append(f"grows from {memory[SETTLED]} to {memory[-1]} MB")
    if len(memory) < rounds:
        faults.append(f"ended after {len(memory)} of {rounds} rounds")
    name = " + ".join(line[0] for line in lines)
    tally.add(name, ran, faults, lambda: "python -m lab.audit soak")
    return f"{name}: {', '.join(map(str, memory))} MB"


def in_child(work: Callable[[], None], folder: Path) -> Ran:
    """Call a function in a fork of this process; CPU time is its mean over a round."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.chdir(folder)
            for number in (1, 2):
                os.dup2(os.open(f"out{number}", os.O_WRONLY | os.O_CREAT), number)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            work()
            code = 0
        finally:
            os._exit(code)
    _, status, used = os.wait4(child, 0)
    err = (folder / "out2").read_bytes()
    return Ran(os.waitstatus_to_exitcode(status), b"", err, used.ru_maxrss / 1024)


def rss_mb() -> float:
    """Return how much memory this process has in use."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20
