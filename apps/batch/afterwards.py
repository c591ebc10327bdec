"""A batch that was run: where it stands, its parts put together, sheets taken out of it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TYPE_CHECKING

from toonset.apps.batch.progress import Result, Status, Teller
from toonset.errors import UsageError, counted

if TYPE_CHECKING:
    from toonset.apps.batch.table import Table


def status_of(out: Path) -> Result:
    """Return where a batch stands, its parts together."""
    from toonset.apps.batch.table import Table

    status = Status()
    with ExitStack() as stack:
        tables = _opened(out, stack)
        whole = tables[0]
        if len(tables) > 1:  # a sheet may be in several
            whole = stack.enter_context(closing(Table(Path(":memory:"), make=True)))
            for table in tables:
                whole.take_in(table)
        status.add(whole.rows())
    return Result({"out": out, **status.values()}, "\n".join(status.lines()))


def merge_shards(out: Path, tell: Teller) -> Result:
    """Put the parts' tables into the batch's own, and write the page.

    Raises:
        UsageError: the batch has no parts.
    """
    from toonset.apps.batch.page import write_page
    from toonset.apps.batch.table import Table
    from toonset.apps.batch.table_file import SHARDS, TABLE, tables_in

    if not (shards := [name for name in tables_in(out) if name != TABLE]):
        raise UsageError(f"{out}: has no {SHARDS}; run toonset batch --shard first")
    with closing(Table(out / TABLE, make=True)) as table:
        for name in shards:
            with closing(Table(out / name)) as part:
                table.take_in(part)
                table.store = part.store
        write_page(out, table.rows(), out.resolve().name, store=table.store)
        count = len(table.names())
    parts = int(shards[0].partition("of")[2].removesuffix(".sqlite"))
    if len(shards) < parts:
        tell.say(f"{parts - len(shards)} of {parts} parts are missing")
    text = (
        f"{out}: {counted(count, 'sheet')} from {len(shards)} parts; look at {out / 'index.html'}"
    )
    return Result({"out": out, "sheets": count, "parts": len(shards)}, text)


def forget_sheets(out: Path, patterns: Sequence[str]) -> Result:
    """Take sheets out of the table and its parts, and write the page.

    Raises:
        UsageError: none is called so.
    """
    from toonset.apps.batch.dispatch import PICTURES, THUMBS
    from toonset.apps.batch.page import write_page
    from toonset.apps.batch.sheets import named
    from toonset.apps.batch.table_file import TABLE

    with ExitStack() as stack:
        tables = _opened(out, stack)
        every = {name for table in tables for name in table.names()}
        gone = named(every, patterns, "--forget")
        for table in tables:
            table.forget(gone)
        if tables[0].path.name == TABLE:
            write_page(out, tables[0].rows(), out.resolve().name, store=tables[0].store)
    for name in gone:
        for end in PICTURES:
            (out / THUMBS / f"{name}{end}").unlink(missing_ok=True)
    text = f"{out}: forgot {', '.join(sorted(gone))}; delete their folders in sheets/ if you like"
    return Result({"out": out, "forgot": sorted(gone)}, text)


def _opened(out: Path, stack: ExitStack) -> list[Table]:
    """Return the open tables of a batch's folder."""
    from toonset.apps.batch.table import Table
    from toonset.apps.batch.table_file import TABLE, tables_in

    return [stack.enter_context(closing(Table(out / name))) for name in tables_in(out) or [TABLE]]
