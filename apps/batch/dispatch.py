"""Hand the sheets of a table to workers, and put into the table how they end.

One loop for every kind of worker. What workers have is what the table says is running: nothing
waits anywhere else.
"""

from __future__ import annotations

import base64
import contextlib
import os
import re
import secrets
import socket
import time
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from toonset.apps.batch.job import Job, Outcome, tidy
from toonset.apps.batch.rows import SheetRow, StageRow, State
from toonset.apps.batch.stages import dependents
from toonset.apps.batch.stamps import read_stamp
from toonset.apps.batch.table import BAD, Table
from toonset.errors import OutputError, ToonsetError

try:
    import fcntl
except ImportError:  # Windows: leases end by time alone
    fcntl = None  # type: ignore[assignment]

LEASE_S = 120.0  # until others may take a claim of a runner that does not renew it
RENEW_S = 20.0
LOOK_S = 1.0  # between looks at sheets that another runner has
MOST_CRASHES = 3  # of a sheet's worker: then it is left alone
MOST_KILLS = 20  # of it, from outside: by then it is no accident
HOLDERS = ".runners"  # folder of locked files, one for each runner
THUMBS, PICTURES = "thumbs", (".webp", ".turn.webp")
Ended = Callable[[str, Sequence[StageRow], Container[str]], object]


class Workers(Protocol):
    """What runs sheets."""

    @property
    def capacity(self) -> int:
        """Return how many sheets may run at once, now."""
        ...

    def submit(self, job: Job) -> None:
        """Run a sheet; fewer than `capacity` are running."""

    def wait(self, timeout_s: float) -> list[Outcome]:
        """Return what has ended; wait until something has, or the time is over."""
        ...

    def close(self) -> None:
        """End them all; what they were writing is cleared away."""


@dataclass(frozen=True)
class Limits:
    """What a sheet may take.

    Attributes:
        seconds: of wall time.
        memory_mb: of its process; 0: no limit.
    """

    seconds: float
    memory_mb: int = 0


@dataclass
class Runner:
    """One `toonset batch`: the sheets that it has claimed.

    Attributes:
        out: folder of the batch.
        limits: of a sheet.
        stages: that it runs.
        store: URL for results; "": the folder.
        ident: of this runner, in the table.
    """

    out: Path
    limits: Limits
    stages: tuple[str, ...]
    store: str = ""
    ident: str = field(default_factory=lambda: _ident())
    _table: Table = field(init=False)
    _due: dict[str, set[str]] = field(default_factory=dict)  # of sheets that run: stages to do

    def run(self, table: Table, workers: Workers, ended: Ended, tick: Callable[[], object]) -> None:
        """Run all chosen sheets that are due, and wait for those that other runners have.

        Args:
            table: of the batch.
            workers: that run them.
            ended: is told of every sheet that ended, the stages that did, and those that were due.
            tick: is called a few times a second.

        Raises:
            ToonsetError: the place for results cannot be written.
        """
        renewed, self._table = time.monotonic(), table
        try:
            while True:
                idle = not self._fill(workers) and not self._due
                if idle and not self._table.others_running(self.ident):
                    return
                for outcome in workers.wait(LOOK_S) if self._due else _nap():
                    self._take(outcome, ended)
                if time.monotonic() - renewed > RENEW_S:
                    self._table.renew(self.ident, LEASE_S)
                    renewed = time.monotonic()
                if idle:
                    release_dead(self._table, self.out, self.ident)
                tick()
        finally:
            with contextlib.suppress(OutputError):  # its leases end by themselves
                self._table.release(self.ident)

    def _fill(self, workers: Workers) -> bool:
        """Give sheets to free workers; return whether there were any."""
        found = False
        while len(self._due) < workers.capacity:
            row = self._table.claim(self.ident, LEASE_S)
            if row is None:
                break
            job = self._job(row)
            left = {one.stage for one in row.stages if one.state != "done"}
            self._due[row.name] = left & {*job.keys}
            workers.submit(job)
            found = True
        return found

    def _job(self, row: SheetRow) -> Job:
        bad = {one.stage for one in row.stages if one.state in BAD}
        cut = bad.union(*map(dependents, bad))
        mine = [one for one in row.stages if one.stage in self.stages and one.stage not in cut]
        keys = {one.stage: one.key for one in mine}
        home = str(home_of(self.out, row.name))
        entry = row.entry
        return Job(
            *(entry.name, entry.sheets, entry.words, keys, home),
            store=self.store,
            seconds=self.limits.seconds,
            memory_mb=self.limits.memory_mb,
        )

    def _take(self, outcome: Outcome, ended: Ended) -> None:
        """Put into the table how a sheet ended."""
        name = outcome.name
        due = self._due.pop(name)
        if outcome.kind == "place":
            raise OutputError(f"{outcome.line}; then run the same command again")
        state, line = self._state(outcome)
        if state == "waiting":
            self._table.release(self.ident, name)
            if outcome.kind == "busy":
                time.sleep(LOOK_S)  # another process is at it
            return
        rows = outcome.rows
        if state != "done" and not any(row.state == state for row in rows):
            rows = self._with_failure(replace(outcome, line=line), state)
        self._keep_pictures(outcome, rows)
        if self._table.record(self.ident, name, rows):
            ended(name, [row for row in rows if row.stage in due], due)

    def _state(self, outcome: Outcome) -> tuple[State, str]:
        """Return the state that a sheet goes into, waiting: once more; and why."""
        if outcome.kind in ("done", "failed"):
            return ("done" if outcome.kind == "done" else "failed"), outcome.line
        outside = outcome.from_outside or outcome.kind == "busy"
        count = self._table.count_crash(outcome.name, from_outside=outside)
        most = MOST_KILLS if outside else MOST_CRASHES
        how = " from outside" if outcome.from_outside else ""
        return (
            "quarantined" if count >= most else "waiting"
        ), f"{outcome.line}{how}, {count} times"

    def _with_failure(self, outcome: Outcome, state: State) -> tuple[StageRow, ...]:
        """Return rows of what a worker had done when it died or gave up, and of what it was at."""
        sheet, rows = self._table.row(outcome.name), [*outcome.rows]
        assert sheet is not None
        mine = [row for row in sheet.stages if row.stage in self.stages]
        home = home_of(self.out, outcome.name)
        if not rows:
            tidy(home)
        if not rows and not self.store:
            found = (read_stamp(home, row.stage, row.key) for row in mine)
            rows = [row for row in found if row is not None]
        done = {row.stage for row in (*rows, *mine) if row.state == "done"}
        left = [row for row in mine if row.stage not in done and row.state not in BAD]
        if not left:
            return tuple(rows)
        at, line = left[0], outcome.line
        begun = {row.stage: row for row in left}
        if outcome.stage in begun and not self.store:
            at = begun[outcome.stage]
        elif outcome.stage not in ("", at.stage):  # what was done before it is in no store
            line = f"{outcome.stage}: {line}"
        at = replace(at, state=state, attempts=max(sheet.crashes, 1), ended=time.time())
        return (*rows, replace(at, error=line, log=outcome.log))

    def _keep_pictures(self, outcome: Outcome, rows: Sequence[StageRow]) -> None:
        from toonset.write import write_bytes

        is_known = outcome.rows or (rows and rows[0].state in BAD)  # else its process died
        for end in PICTURES:
            file = self.out / THUMBS / f"{outcome.name}{end}"
            if end in outcome.pictures:
                write_bytes(file, base64.b64decode(outcome.pictures[end]), lasting=False)
            elif is_known:
                file.unlink(missing_ok=True)  # of an older result


def _ident() -> str:
    """Return a new name for a runner, which may name a file."""
    host = re.sub(r"[^\w.-]", "_", socket.gethostname())
    return f"{host}-{os.getpid()}-{secrets.token_hex(4)}"


def home_of(out: Path, name: str) -> Path:
    """Return a sheet's folder."""
    return out / "sheets" / name


def _nap() -> list[Outcome]:
    time.sleep(LOOK_S)
    return []


@contextlib.contextmanager
def alive(out: Path, ident: str, does: str = "") -> Iterator[None]:
    """Hold a file within the block; children hold it, too, so that it is free when all are gone.

    Args:
        out: folder of the batch.
        ident: of the runner.
        does: what it does; all who are alive must do the same.

    Raises:
        ToonsetError: another one does something else.
    """
    file = out / HOLDERS / ident
    descriptor = _held(file, does.encode())
    try:
        for other in file.parent.iterdir():
            if other != file and not _is_dead(other) and _said(other) not in (None, does):
                raise ToonsetError(
                    f"{out}: another toonset batch works there with other stages or options; wait "
                    f"for it, or choose another -o; if none does, delete {other}"
                )
        yield
    finally:
        with contextlib.suppress(OSError):
            file.unlink()
            file.parent.rmdir()  # unless another is alive
        os.close(descriptor)


def _said(file: Path) -> str | None:
    try:
        return file.read_text("utf-8")
    except OSError:  # it has just ended
        return None


def _held(file: Path, content: bytes) -> int:
    """Return the descriptor of a new file that is locked; others may take it away until it is."""
    while True:
        file.parent.mkdir(exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
            os.write(descriptor, content)  # before it is locked: who is alive has said what it does
            if fcntl is None:
                return descriptor
            with contextlib.suppress(OSError):  # a file system without locks
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            if os.fstat(descriptor).st_nlink:
                return descriptor
            os.close(descriptor)


def release_dead(table: Table, out: Path, ident: str) -> None:
    """Give back what runners have claimed that are gone, as their files say."""
    for other in table.runners():
        if other != ident and _is_dead(out / HOLDERS / other):
            table.release(other)


def _is_dead(file: Path) -> bool:
    """Return whether nobody holds a runner's file any more; it is removed then."""
    if fcntl is None:
        return False
    try:
        descriptor = os.open(file, os.O_RDWR | os.O_CLOEXEC)
    except FileNotFoundError:
        return True
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        file.unlink(missing_ok=True)
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
