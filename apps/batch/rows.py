"""What a batch's table says of a sheet and its stages, as records."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal

from toonset.apps.batch.stages import Entry

State = Literal["waiting", "running", "done", "failed", "quarantined"]


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


def sheet_of(rows: Sequence[sqlite3.Row]) -> SheetRow:
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
