"""What a person asks of a batch, and what that means once it is read and checked."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toonset.errors import UsageError

if TYPE_CHECKING:
    from toonset.apps.batch.dispatch import Limits
    from toonset.apps.batch.stages import Entry, Verbs

AUTO = "auto"


@dataclass(frozen=True)
class Request:
    """What a person asks of a batch.

    Attributes:
        sheets: pictures, folders of them, patterns, URLs, manifests.
        out: folder of the batch.
        stages: their names, with commas between.
        given: options of stages, each as typed: "train --steps 300".
        root: of a manifest's paths; None: its own folder.
        only: names or patterns of the sheets that are to run; none: all.
        retry: what failed, too.
        shard: "I/N", the part that is to run; "": all.
        workers: how many sheets at once, or "auto".
        seconds: that a sheet may take.
        memory_mb: that it may take; 0: its share of what is free.
        ray: address of a Ray cluster; None: processes of this machine.
        gpus: of one sheet, on Ray.
        store: URL that results are put to; "": the folder.
    """

    sheets: tuple[str, ...]
    out: Path
    stages: str
    given: tuple[str, ...] = ()
    root: Path | None = None
    only: tuple[str, ...] = ()
    retry: bool = False
    shard: str = ""
    workers: str = AUTO
    seconds: float = 0.0
    memory_mb: int = 0
    ray: str | None = None
    gpus: float = 0.0
    store: str = ""


@dataclass(frozen=True)
class Wanted:
    """A request, read and checked.

    Attributes:
        out: folder of the batch.
        stages: in order.
        entries: all sheets that are named.
        names: of those that are to run.
        retry: what failed, too.
        limits: of a sheet.
        store: URL of results, or "".
        table: file name of the table.
        given: options of stages, for all sheets.
        verbs: that the stages are.
    """

    out: Path
    stages: tuple[str, ...]
    entries: Sequence[Entry]
    names: frozenset[str]
    retry: bool
    limits: Limits
    store: str
    table: str
    given: Sequence[str]
    verbs: Verbs

    @property
    def does(self) -> str:
        """Return what all who work on the batch at once must do alike."""
        return json.dumps([self.stages, self.store, self.given])

    @property
    def is_shard(self) -> bool:
        """Return whether others have a part of it."""
        from toonset.apps.batch.table_file import TABLE

        return self.table != TABLE


def listed_sheets(asked: Request, verbs: Verbs, say: Callable[[str], None]) -> list[Entry]:
    """Return all sheets that are named, with their options."""
    from toonset.apps.batch.sheets import list_sheets
    from toonset.apps.batch.stages import STAGES, as_words

    words: dict[str, tuple[str, ...]] = {}
    for text in asked.given:
        stage, *said = as_words(text, "--with") or ("",)
        if stage not in STAGES:
            raise UsageError(f"--with {text!r}: begins with none of {', '.join(STAGES)}")
        words[stage] = (*words.get(stage, ()), *said)
    return list_sheets(asked.sheets, words, verbs, asked.root, asked.out, say)


def shard_of(text: str, out: Path) -> tuple[tuple[int, int], str]:
    """Return which part of how many, from 0, and the name of its table."""
    from toonset.apps.batch.table_file import TABLE, tables_in

    if not text:
        return (0, 1), TABLE
    found = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
    part, parts = (int(found[1]), int(found[2])) if found else (0, 0)
    if not 1 <= part <= parts:
        raise UsageError(f"--shard {text!r}: is not I/N with I from 1 to N, as 3/8")
    for name in tables_in(out):
        if name != TABLE and not name.endswith(f"of{parts}.sqlite"):
            raise UsageError(f"--shard {text}: {out} has parts of another number, as {name}")
    return (part - 1, parts), f"batch-{part}of{parts}.sqlite"


def worker_count(workers: str, memory_mb: int) -> int:
    """Return how many sheets run at once on this machine."""
    from toonset.apps.batch.local import usual_workers

    if workers == AUTO:
        return usual_workers(memory_mb)
    if not re.fullmatch("[1-9][0-9]{0,3}", workers):
        raise UsageError(f"--workers {workers!r}: is neither a number from 1 nor {AUTO}")
    return int(workers)


def memory_share(count: int) -> int:
    """Return a sheet's share of the memory that is free, MB; 0: it may take what it likes."""
    from toonset.apps.batch.local import WORKER_MB, free_memory_mb

    free = free_memory_mb()
    return 0 if free is None else max(int(free / count), WORKER_MB)
