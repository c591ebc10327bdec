"""Let every call of a verb fail, or be its last.

A verb runs once to count its calls. Then a process runs it once more and becomes a server at its
first call and after every computation: for the calls up to the next one, and every kind of fault,
it forks a child that goes on from there, and puts the place back. So a fault costs milliseconds,
no training.
"""

from __future__ import annotations

import json
import os

from lab.faults.calls import FAILURES, Calls, fault
from lab.faults.child import call_main, errors_into, leaving
from lab.faults.place import Place, Row


def every_call(place: Place, *, quick: bool) -> Row:
    """Let every call of a verb fail in every way and be its last; `quick`: in one way, in turn."""
    place.restore(place.first)
    if (server := os.fork()) == 0:
        calls: list[Calls] = []

        def serve(number: int) -> None:
            if number in place.stops:
                after = (stop for stop in place.stops if stop > number)
                _serve(place, calls[0], number, next(after, place.calls + 1), quick=quick)

        with leaving(place.root / "err"):
            calls.append(Calls(place.out, serve))
            call_main(place.arguments)
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
                errors_into(place.root / "err-child")
                calls.hook, calls.count = fault(kind, at), begin
                calls.hook(begin)
                return
            row += place.judge(f"{kind}, call {at}", place.wait(child, "-child"))
    begin_again()
    (place.root / f"served-{begin}").write_text(json.dumps([row.tried, row.wrong]))
    calls.hook, calls.count = on, begin
