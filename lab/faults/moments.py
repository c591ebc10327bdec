"""Kill verbs, send them signals and run them beside each other, at random moments."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import time

from lab.faults.child import FINE
from lab.faults.place import Place, Row

SOON_S = 2.0  # from a signal to the end


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
        if ended.code not in (*FINE, 128 + number, -number):  # to a shell the last two are one
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
