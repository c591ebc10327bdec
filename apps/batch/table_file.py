"""One SQLite file that processes share: made, opened, written in short transactions.

Every write is one short transaction in write-ahead mode, so that several runners and readers share
the table. SQLite needs a file system with locks: across machines, give each its own table (--shard)
or let one machine do the writing (--ray).
"""

from __future__ import annotations

import contextlib
import os
import re
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from toonset.errors import OutputError, ToonsetError

SCHEMA = 1  # in the table's user_version
TABLE, SHARDS = "batch.sqlite", "batch-*of*.sqlite"  # of a batch; of its parts
PATIENCE_S = 60.0  # for another process's transaction; each takes milliseconds

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


def tables_in(out: Path) -> list[str]:
    """Return the names of the tables in a batch's folder: its own first, then those of parts."""
    names = sorted(path.name for path in out.glob(SHARDS)) if out.is_dir() else []
    parts = [name for name in names if re.fullmatch(r"batch-\d+of\d+\.sqlite", name)]
    return [TABLE] * (out / TABLE).is_file() + parts


class TableFile:
    """An open file. One connection: of one process, used by one thread."""

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
