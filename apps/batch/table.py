"""Keep a batch in one SQLite table: what is to be done, who does it, how it ended.

A sheet is claimed as a whole, by one UPDATE, under a lease that its runner renews; a runner is one
`toonset batch` with its workers. Who dies loses its leases, not its results: those are folders that
appear by a rename, each with a stamp beside it (`toonset.apps.batch.job`), and whoever claims the
sheet next finds them.

Every write is one short transaction in write-ahead mode, so that several runners and readers share
the table. SQLite needs a file system with locks: across machines, give each its own table (--shard)
or let one machine do the writing (--ray).
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import re
import sqlite3
import time
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

from toonset.apps.batch.stages import RANKS, Entry, dependents
from toonset.errors import OutputError, ToonsetError

SCHEMA = 1  # in the table's user_version
TABLE, SHARDS = "batch.sqlite", "batch-*of*.sqlite"  # of a batch; of its parts
AT_ONCE = 500  # sheets of one transaction
PATIENCE_S = 60.0  # for another process's transaction; each takes milliseconds
BAD = ("quarantined", "failed")  # the worse first
State = Literal["waiting", "running", "done", "failed", "quarantined"]

TABLES = """
CREATE TABLE sheets (
    name TEXT PRIMARY KEY,
    position INTEGER NOT NULL,
    entry TEXT NOT NULL,              -- JSON of an Entry
    state TEXT NOT NULL,
    worker TEXT NOT NULL DEFAULT '',  -- runner that has claimed it
    lease REAL NOT NULL DEFAULT 0,    -- until then, seconds since 1970
    crashes INTEGER NOT NULL DEFAULT 0,
    kills INTEGER NOT NULL DEFAULT 0, -- of its worker, from outside
    planned REAL NOT NULL DEFAULT 0   -- when its inputs or options changed last
);
CREATE INDEX by_turn ON sheets (state, crashes + kills, position);
CREATE TABLE stages (
    sheet TEXT NOT NULL,
    stage TEXT NOT NULL,
    rank INTEGER NOT NULL,            -- order of the stages
    key TEXT NOT NULL,                -- hash of inputs, options, versions and the stage before
    state TEXT NOT NULL,
    attempts INTEGER NOT NULL DEFAULT 0,
    worker TEXT NOT NULL DEFAULT '',
    ended REAL NOT NULL DEFAULT 0,
    wall_s REAL NOT NULL DEFAULT 0,
    cpu_s REAL NOT NULL DEFAULT 0,
    peak_mb REAL NOT NULL DEFAULT 0,
    verdict TEXT NOT NULL DEFAULT '',
    facts TEXT NOT NULL DEFAULT '{}',
    error TEXT NOT NULL DEFAULT '',
    log TEXT NOT NULL DEFAULT '',
    output TEXT NOT NULL DEFAULT '',  -- hash of what it wrote
    PRIMARY KEY (sheet, stage)
) WITHOUT ROWID;
CREATE TABLE files (                  -- hashes of inputs, for as long as they look the same
    path TEXT PRIMARY KEY, looks TEXT NOT NULL, hash TEXT NOT NULL
) WITHOUT ROWID;
CREATE TABLE store (                  -- where results are, if not beside the table
    url TEXT PRIMARY KEY
) WITHOUT ROWID;
"""


@dataclass(frozen=True)
class StageRow:
    """One stage of one sheet.

    Attributes:
        stage: its name, as the verb's.
        key: hash of inputs, options, versions and the stage before.
        state: waiting, done or failed.
        attempts: how often it was begun.
        worker: who ended it, as host:process.
        ended: seconds since 1970; 0 if it has not.
        wall_s: how long it took.
        cpu_s: of all its threads.
        peak_mb: most memory of its process meanwhile.
        verdict: ok, weak, ambiguous or failed, where the stage has one.
        facts: what the page shows besides, small.
        error: the line that says why it failed.
        log: last lines of what it printed, if it failed.
        output: hash of what it wrote.
    """

    stage: str
    key: str
    state: State = "waiting"
    attempts: int = 0
    worker: str = ""
    ended: float = 0.0
    wall_s: float = 0.0
    cpu_s: float = 0.0
    peak_mb: float = 0.0
    verdict: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)
    error: str = ""
    log: str = ""
    output: str = ""


COLUMNS = tuple(one.name for one in fields(StageRow))


@dataclass(frozen=True)
class SheetRow:
    """One sheet with its stages, in order.

    Attributes:
        entry: what the manifest says of it.
        position: among the batch's sheets.
        state: of the sheet as a whole.
        worker: runner that has claimed it.
        crashes: of its worker, caused by the sheet.
        planned: when its inputs or options changed last, seconds since 1970.
        stages: in the order in which they run.
    """

    entry: Entry
    position: int
    state: State
    worker: str
    crashes: int
    planned: float
    stages: tuple[StageRow, ...]

    @property
    def name(self) -> str:
        """Return the sheet's name."""
        return self.entry.name

    @property
    def newest(self) -> float:
        """Return when something of it changed last."""
        return max((self.planned, *(row.ended for row in self.stages)))

    @property
    def verdict(self) -> str:
        """Return the cameras' verdict, "" where there is none yet."""
        return next((row.verdict for row in self.stages if row.stage == "calibrate"), "")

    @property
    def error(self) -> str:
        """Return why it failed, "" where it did not."""
        return next((row.error for row in self.stages if row.error), "")


@dataclass(frozen=True)
class Plan:
    """What a sheet is to have.

    Attributes:
        entry: the sheet.
        position: among the batch's sheets.
        keys: the key of every stage, in order.
    """

    entry: Entry
    position: int
    keys: Mapping[str, str]


def tables_in(out: Path) -> list[str]:
    """Return the names of the tables in a batch's folder: its own first, then those of parts."""
    names = sorted(path.name for path in out.glob(SHARDS)) if out.is_dir() else []
    parts = [name for name in names if re.fullmatch(r"batch-\d+of\d+\.sqlite", name)]
    return [TABLE] * (out / TABLE).is_file() + parts


class Table:
    """An open table. One connection: of one process, used by one thread."""

    def __init__(self, path: Path, *, make: bool = False, alone: bool = False) -> None:
        """Open a table.

        Args:
            path: the file.
            make: make it if it is not there.
            alone: make it without a write-ahead file, which processes of one machine only share:
                for the parts of a batch on a shared disk.

        Raises:
            OutputError: it cannot be read or written.
            ToonsetError: it is no table of a batch, or of a newer toonset.
        """
        self.path = path
        if not make and not path.is_file():
            raise ToonsetError(f"{path.parent}: has no {path.name}; name the -o of a toonset batch")
        with self._errors():
            wal = path.with_name(f"{path.name}-wal")
            is_whole = not wal.exists() or not wal.stat().st_size
            is_fixed = not make and is_whole and not os.access(path.parent, os.W_OK)
            place = f"{path.absolute().as_uri()}?immutable=1" if is_fixed else path
            self._db = sqlite3.connect(
                place, timeout=PATIENCE_S, isolation_level=None, uri=is_fixed
            )
            self._db.row_factory = sqlite3.Row
            self._open(make=make, alone=alone)

    def _open(self, *, make: bool, alone: bool) -> None:
        version = self._db.execute("PRAGMA user_version").fetchone()[0]
        if version > SCHEMA:
            raise ToonsetError(f"{self.path}: is of a newer toonset; install that one")
        self._db.execute("PRAGMA synchronous = NORMAL")  # a lost commit is a sheet found done
        if version != SCHEMA:
            none = ToonsetError(f"{self.path}: is no table of toonset batch; choose another -o")
            if not make:
                raise none
            with self.transaction():
                if self._db.execute("PRAGMA user_version").fetchone()[0] == 0:  # nobody else has
                    if self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
                        raise none
                    for statement in TABLES.split(";"):
                        self._db.execute(statement)
                    self._db.execute(f"PRAGMA user_version = {SCHEMA}")
        if make and not alone:
            with contextlib.suppress(sqlite3.OperationalError):  # somebody reads: the next time
                self._db.execute("PRAGMA journal_mode = WAL")

    def close(self) -> None:
        """Close the connection; the last one tidies the write-ahead file away."""
        with self._errors():
            self._db.close()

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Turn what SQLite says of the file or its disk into one line."""
        try:
            yield
        except sqlite3.DatabaseError as error:
            raise OutputError(
                f"{self.path}: cannot be used ({error}); make room, make it writable, or choose "
                "another -o"
            ) from error

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Do what is within the block at once, as the only writer, or not at all."""
        with self._errors():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield self._db
            except BaseException:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise
            self._db.execute("COMMIT")

    # ---- reading --------------------------------------------------------------------------------

    def rows(self) -> Iterator[SheetRow]:
        """Yield every sheet in order of position; the memory it takes does not grow with them."""
        with self._errors():
            found = self._db.cursor().execute(
                "SELECT s.name, s.position, s.entry, s.state AS sheet_state, s.worker AS runner, "
                "s.crashes, s.planned, t.* FROM sheets s LEFT JOIN stages t ON t.sheet = s.name "
                "ORDER BY s.position, s.name, t.rank"
            )
            of_sheet: list[sqlite3.Row] = []
            for row in found:
                if of_sheet and row["name"] != of_sheet[0]["name"]:
                    yield _sheet(of_sheet)
                    of_sheet = []
                of_sheet.append(row)
            if of_sheet:
                yield _sheet(of_sheet)

    def row(self, name: str) -> SheetRow | None:
        """Return one sheet; None if there is none of that name."""
        with self._errors():
            found = self._db.execute(
                "SELECT s.name, s.position, s.entry, s.state AS sheet_state, s.worker AS runner, "
                "s.crashes, s.planned, t.* FROM sheets s LEFT JOIN stages t ON t.sheet = s.name "
                "WHERE s.name = ? ORDER BY t.rank",
                (name,),
            ).fetchall()
        return _sheet(found) if found else None

    def names(self) -> list[str]:
        """Return the names of all sheets."""
        with self._errors():
            return [row["name"] for row in self._db.execute("SELECT name FROM sheets")]

    @property
    def store(self) -> str:
        """Return the URL of the results, "" where they lie beside the table."""
        with self._errors():
            found = self._db.execute("SELECT url FROM store").fetchone()
        return "" if found is None else str(found["url"])

    @store.setter
    def store(self, url: str) -> None:
        with self.transaction() as db:
            db.execute("DELETE FROM store")
            if url:
                db.execute("INSERT INTO store VALUES (?)", (url,))

    # ---- what is to be done ---------------------------------------------------------------------

    def hash_of(self, path: str, looks: str) -> str | None:
        """Return the hash of an input that still looks as it did when it was hashed."""
        with self._errors():
            found = self._db.execute(
                "SELECT hash FROM files WHERE path = ? AND looks = ?", (path, looks)
            ).fetchone()
        return None if found is None else str(found["hash"])

    def keep_hashes(self, found: Iterable[tuple[str, str, str]]) -> None:
        """Keep paths, how they look and their hashes."""
        with self.transaction() as db:
            db.executemany("REPLACE INTO files VALUES (?, ?, ?)", found)

    def plan(self, plans: Iterable[Plan], is_there: Callable[[str], Container[str]]) -> None:
        """Put sheets and stages in; what was done with another key, or is gone, is due again.

        Args:
            plans: the sheets with the stages that they are to have.
            is_there: returns which stages' results of a sheet are there, with their keys.

        Raises:
            ToonsetError: another runner works on one of them with other inputs or options.
        """
        with self.transaction() as db:
            for plan in plans:
                self._plan(db, plan, is_there(plan.entry.name))

    def _plan(self, db: sqlite3.Connection, plan: Plan, there: Container[str]) -> None:
        name = plan.entry.name
        rows = db.execute("SELECT stage, key, state FROM stages WHERE sheet = ?", (name,))
        old = {row["stage"]: row for row in rows}
        changed = any(s not in old or old[s]["key"] != key for s, key in plan.keys.items())
        if self._is_running(db, name):
            if changed:
                raise ToonsetError(
                    f"{self.path.parent}: {name!r} is being worked on with other inputs or options "
                    "by another toonset batch; wait for it, or choose another -o"
                )
            return
        states = {stage: row["state"] for stage, row in old.items()}
        due: set[str] = set()  # with what is made of them
        blocked: set[str] = set()  # by what has failed
        for stage, key in plan.keys.items():
            known = stage in old and old[stage]["key"] == key
            is_gone = states.get(stage) == "done" and stage not in there
            if not known:
                _put(db, name, StageRow(stage, key))
            if not known or is_gone or stage in due:
                states[stage] = "waiting"
                db.execute(
                    "UPDATE stages SET state = 'waiting' WHERE sheet = ? AND stage = ?",
                    (name, stage),
                )
            if states[stage] in BAD:
                blocked |= {*dependents(stage)}
            if states[stage] == "waiting" and stage not in blocked:
                due |= {stage, *dependents(stage)}
        state = "waiting" if due else _worst(states.values())
        db.execute(
            "INSERT INTO sheets (name, position, entry, state) VALUES (?, ?, ?, ?) ON CONFLICT "
            "(name) DO UPDATE SET position = excluded.position, entry = excluded.entry, "
            "state = excluded.state",
            (name, plan.position, json.dumps(vars(plan.entry)), state),
        )
        if changed:
            db.execute(
                "UPDATE sheets SET crashes = 0, kills = 0, planned = ? WHERE name = ?",
                (time.time(), name),
            )

    @staticmethod
    def _is_running(db: sqlite3.Connection, name: str) -> bool:
        found = db.execute("SELECT state FROM sheets WHERE name = ?", (name,)).fetchone()
        return found is not None and found["state"] == "running"

    def retry(self, names: Iterable[str], stages: Sequence[str]) -> None:
        """Let stages of sheets that have failed or crashed run again."""
        with self.transaction() as db:
            for name in (name for name in names if not self._is_running(db, name)):
                again = [
                    db.execute(
                        "UPDATE stages SET state = 'waiting', error = '', log = '' WHERE sheet = ? "
                        "AND stage = ? AND state IN ('failed', 'quarantined')",
                        (name, stage),
                    ).rowcount
                    for stage in stages
                ]
                if any(again):
                    db.execute(
                        "UPDATE sheets SET state = 'waiting', crashes = 0, kills = 0 "
                        "WHERE name = ?",
                        (name,),
                    )

    def forget(self, names: Iterable[str]) -> None:
        """Take sheets out.

        Raises:
            ToonsetError: one is being worked on.
        """
        with self.transaction() as db:
            for name in names:
                if self._is_running(db, name):
                    where = self.path.parent
                    raise ToonsetError(f"{where}: {name!r} is being worked on; wait for it")
                db.execute("DELETE FROM sheets WHERE name = ?", (name,))
                db.execute("DELETE FROM stages WHERE sheet = ?", (name,))

    def choose(self, names: Iterable[str]) -> None:
        """Claim only these sheets from now on."""
        with self._errors():
            self._db.execute("CREATE TEMP TABLE chosen (name TEXT PRIMARY KEY)")
            self._db.execute("BEGIN")
            self._db.executemany("INSERT INTO chosen VALUES (?)", ((name,) for name in names))
            self._db.execute("COMMIT")

    # ---- who does it ----------------------------------------------------------------------------

    def claim(self, runner: str, lease_s: float) -> SheetRow | None:
        """Claim the next chosen sheet that waits, or whose runner's lease is over; None if none is.

        What has ended a worker comes last: it must not keep the others waiting.
        """
        now = time.time()
        with self.transaction() as db:
            found = db.execute(
                "UPDATE sheets SET state = 'running', worker = ?, lease = ? WHERE name = ("
                "SELECT name FROM sheets WHERE state = 'waiting' AND name IN chosen "
                "ORDER BY crashes + kills, position LIMIT 1) RETURNING name",
                (runner, now + lease_s),
            ).fetchone()
            if found is None:
                found = db.execute(
                    "UPDATE sheets SET worker = ?, lease = ? WHERE name = ("
                    "SELECT name FROM sheets WHERE state = 'running' AND lease < ? AND worker != ? "
                    "AND name IN chosen ORDER BY position LIMIT 1) RETURNING name",
                    (runner, now + lease_s, now, runner),
                ).fetchone()
        return None if found is None else self.row(found["name"])

    def renew(self, runner: str, lease_s: float) -> None:
        """Prolong a runner's leases."""
        with self.transaction() as db:
            db.execute(
                "UPDATE sheets SET lease = ? WHERE state = 'running' AND worker = ?",
                (time.time() + lease_s, runner),
            )

    def release(self, runner: str, name: str | None = None) -> None:
        """Give a runner's claims back: all of them, or one."""
        with self.transaction() as db:
            db.execute(
                "UPDATE sheets SET state = 'waiting', worker = '', lease = 0 WHERE "
                "state = 'running' AND worker = ? AND (? IS NULL OR name = ?)",
                (runner, name, name),
            )

    def runners(self) -> list[str]:
        """Return who has claims."""
        with self._errors():
            found = self._db.execute("SELECT DISTINCT worker FROM sheets WHERE state = 'running'")
            return [row["worker"] for row in found]

    def is_due(self) -> bool:
        """Return whether a chosen sheet waits, or runs."""
        with self._errors():
            found = self._db.execute(
                "SELECT 1 FROM sheets WHERE state IN ('waiting', 'running') AND name IN chosen "
                "LIMIT 1"
            ).fetchone()
        return found is not None

    def others_running(self, runner: str) -> bool:
        """Return whether another runner has a chosen sheet."""
        with self._errors():
            found = self._db.execute(
                "SELECT 1 FROM sheets WHERE state = 'running' AND worker != ? AND name IN chosen "
                "LIMIT 1",
                (runner,),
            ).fetchone()
        return found is not None

    # ---- how it ended ---------------------------------------------------------------------------

    def record(self, runner: str, name: str, rows: Sequence[StageRow]) -> bool:
        """Put in how a claimed sheet ended; False if it is no longer this runner's."""
        with self.transaction() as db:
            taken = db.execute(
                "UPDATE sheets SET worker = '', lease = 0 WHERE name = ? AND state = 'running' "
                "AND worker = ?",
                (name, runner),
            ).rowcount
            if not taken:
                return False
            for row in rows:
                self._record(db, name, row)
            found = db.execute("SELECT state FROM stages WHERE sheet = ?", (name,))
            whole = _worst(row["state"] for row in found)  # a stage of before may have failed
            db.execute("UPDATE sheets SET state = ? WHERE name = ?", (whole, name))
        return True

    @staticmethod
    def _record(db: sqlite3.Connection, name: str, row: StageRow) -> None:
        """Put in a stage that was run; what was made of its old result is gone."""
        old = db.execute(
            "SELECT key, state, attempts, ended FROM stages WHERE sheet = ? AND stage = ?",
            (name, row.stage),
        ).fetchone()
        before = old if old is not None and old["key"] == row.key else None
        if before and before["state"] == "done" and before["ended"] == row.ended:
            return  # it was there
        for stage in dependents(row.stage):
            db.execute(
                "DELETE FROM stages WHERE sheet = ? AND stage = ? AND state = 'done'", (name, stage)
            )
        tried = row.attempts + (before["attempts"] if before else 0)
        _put(db, name, replace(row, attempts=tried))

    def count_crash(self, name: str, *, from_outside: bool) -> int:
        """Count the death of a sheet's worker; return how many of its kind there were."""
        column = "kills" if from_outside else "crashes"
        with self.transaction() as db:
            found = db.execute(
                f"UPDATE sheets SET {column} = {column} + 1 WHERE name = ? RETURNING {column}",  # noqa: S608
                (name,),
            ).fetchone()
        return int(found[0])

    def take_in(self, other: Table) -> None:
        """Put another table's sheets in, in place of older ones."""
        rows = other.rows()
        while some := [*itertools.islice(rows, AT_ONCE)]:
            with self.transaction() as db:
                for row in some:
                    known = self.row(row.name)
                    if known is None or known.newest <= row.newest:
                        _take_in(db, row)


def _put(db: sqlite3.Connection, name: str, row: StageRow) -> None:
    values = {**vars(row), "sheet": name, "rank": RANKS[row.stage], "facts": json.dumps(row.facts)}
    columns = ", ".join(values)
    marks = ", ".join(f":{column}" for column in values)
    db.execute(f"REPLACE INTO stages ({columns}) VALUES ({marks})", values)  # noqa: S608


def _take_in(db: sqlite3.Connection, row: SheetRow) -> None:
    state = "waiting" if row.state == "running" else row.state
    db.execute(
        "REPLACE INTO sheets (name, position, entry, state, crashes, planned) "
        "VALUES (?, ?, ?, ?, ?, ?)",
        (row.name, row.position, json.dumps(vars(row.entry)), state, row.crashes, row.planned),
    )
    db.execute("DELETE FROM stages WHERE sheet = ?", (row.name,))
    for one in row.stages:
        _put(db, row.name, one)


def _worst(states: Iterable[str]) -> str:
    """Return the state of a sheet that nothing is to be done for."""
    found = {*states}
    return next((state for state in BAD if state in found), "done")


def _sheet(rows: Sequence[sqlite3.Row]) -> SheetRow:
    """Return a sheet of its rows, one for each stage."""
    first, entry = rows[0], json.loads(rows[0]["entry"])
    entry["sheets"] = tuple(entry["sheets"])
    entry["words"] = {stage: tuple(words) for stage, words in entry["words"].items()}
    return SheetRow(
        Entry(**entry),
        first["position"],
        first["sheet_state"],
        first["runner"],
        first["crashes"],
        first["planned"],
        tuple(_stage(row) for row in rows if row["stage"] is not None),
    )


def _stage(row: sqlite3.Row) -> StageRow:
    return StageRow(**{name: row[name] for name in COLUMNS} | {"facts": json.loads(row["facts"])})
