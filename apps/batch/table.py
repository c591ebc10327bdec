"""Keep a batch in one SQLite table: what is to be done, who does it, how it ended.

A sheet is claimed as a whole, by one UPDATE, under a lease that its runner renews; a runner is one
`toonset batch` with its workers. Who dies loses its leases, not its results: those are folders that
appear by a rename, each with a stamp beside it (`stamps`), and whoever claims the sheet next finds
them. How the file is opened and shared: `table_file`.
"""

from __future__ import annotations

import itertools
import json
import sqlite3
import time
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import replace

from toonset.apps.batch.rows import Plan, SheetRow, StageRow, sheet_of
from toonset.apps.batch.stages import RANKS, dependents
from toonset.apps.batch.table_file import TableFile
from toonset.errors import ToonsetError

AT_ONCE = 500  # sheets of one transaction
BAD = ("quarantined", "failed")  # the worse first


class Table(TableFile):
    """An open table: what is read of it, and what may change in it."""

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
                    yield sheet_of(of_sheet)
                    of_sheet = []
                of_sheet.append(row)
            if of_sheet:
                yield sheet_of(of_sheet)

    def row(self, name: str) -> SheetRow | None:
        """Return one sheet; None if there is none of that name."""
        with self._errors():
            found = self._db.execute(
                "SELECT s.name, s.position, s.entry, s.state AS sheet_state, s.worker AS runner, "
                "s.crashes, s.planned, t.* FROM sheets s LEFT JOIN stages t ON t.sheet = s.name "
                "WHERE s.name = ? ORDER BY t.rank",
                (name,),
            ).fetchall()
        return sheet_of(found) if found else None

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
