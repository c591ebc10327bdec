"""Run many sheets from one table; say where a batch stands, put its parts together.

A batch's folder has the table, a page of all sheets, and a folder for every sheet.
"""

from __future__ import annotations

import json
import os
import re
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from toonset.apps.batch.progress import Progress, Result, Status, Teller, count_stages
from toonset.errors import OutputError, ToonsetError, UsageError, counted

if TYPE_CHECKING:
    from toonset.apps.batch.dispatch import Limits, Workers
    from toonset.apps.batch.stages import Entry, Verbs
    from toonset.apps.batch.table import Plan, Table

PAGE_S, PAUSE = 30.0, 50  # between pages: at least; times what the last one took
AUTO = "auto"
PLANNED_AT_ONCE = 500  # sheets of one transaction


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


def run(asked: Request, verbs: Verbs, tell: Teller) -> Result:
    """Run what is due of a batch.

    Args:
        asked: the sheets, and how they are run.
        verbs: that the stages are.
        tell: is told how it goes.

    Raises:
        ToonsetError: something that is asked for cannot be, or the folder cannot be written.
    """
    from toonset.apps.batch.dispatch import Limits
    from toonset.apps.batch.sheets import choose
    from toonset.apps.batch.stages import check_options, in_order

    out = asked.out
    chosen = in_order([name.strip() for name in asked.stages.split(",") if name.strip()])
    if asked.gpus and asked.ray is None:
        raise UsageError("--gpus belongs to --ray")
    entries = _listed(asked, verbs, tell.say)
    check_options(entries, chosen, verbs)
    part, table_name = _shard(asked.shard, out)
    names = choose(entries, asked.only, part)
    count = _count(asked.workers, asked.memory_mb)
    share = 0 if asked.ray else _share(count)
    limits = Limits(asked.seconds, asked.memory_mb or share)
    wanted = Wanted(
        Path(os.path.abspath(out)),  # workers may have another current folder
        chosen,
        entries,
        names,
        asked.retry,
        limits,
        asked.store,
        table_name,
        [*asked.given],
        verbs,
    )
    start = partial(_local_workers, count)
    if asked.ray:
        start = partial(_ray_workers, asked.ray, asked.gpus, limits)
    return _result(wanted, _run(wanted, start, tell))


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
        from toonset.apps.batch.table import TABLE

        return self.table != TABLE


def _listed(asked: Request, verbs: Verbs, say: Callable[[str], None]) -> list[Entry]:
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


def _shard(text: str, out: Path) -> tuple[tuple[int, int], str]:
    """Return which part of how many, from 0, and the name of its table."""
    from toonset.apps.batch.table import TABLE, tables_in

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


def _count(workers: str, memory_mb: int) -> int:
    """Return how many sheets run at once on this machine."""
    from toonset.apps.batch.local import usual_workers

    if workers == AUTO:
        return usual_workers(memory_mb)
    if not re.fullmatch("[1-9][0-9]{0,3}", workers):
        raise UsageError(f"--workers {workers!r}: is neither a number from 1 nor {AUTO}")
    return int(workers)


def _share(count: int) -> int:
    """Return a sheet's share of the memory that is free, MB; 0: it may take what it likes."""
    from toonset.apps.batch.local import WORKER_MB, free_memory_mb

    free = free_memory_mb()
    return 0 if free is None else max(int(free / count), WORKER_MB)


def _local_workers(count: int, wanted: Wanted) -> Workers:
    """Start processes here, when all is imported."""
    from toonset.apps.batch.job import run_sheet
    from toonset.apps.batch.local import LocalWorkers

    wanted.verbs.load(wanted.stages)
    run_one = partial(run_sheet, verbs=wanted.verbs)
    return LocalWorkers(min(count, len(wanted.names)), run_one)


def _ray_workers(address: str, gpus: float, limits: Limits, wanted: Wanted) -> Workers:
    from toonset.apps.batch.on_ray import RayWorkers

    return RayWorkers(address, wanted.verbs, gpus, limits.memory_mb)


def _run(
    wanted: Wanted, start: Callable[[Wanted], Workers], tell: Teller
) -> Mapping[str, Counter[str]]:
    """Run what is due; return how many sheets are in which state, for every stage."""
    from toonset.apps.batch.dispatch import Runner, alive, release_dead
    from toonset.apps.batch.table import Table

    _check_out(wanted.out)
    with ExitStack() as stack:
        runner = Runner(wanted.out, wanted.limits, wanted.stages, wanted.store)
        stack.enter_context(alive(wanted.out, runner.ident, wanted.does))
        path = wanted.out / wanted.table
        table = stack.enter_context(closing(Table(path, make=True, alone=wanted.is_shard)))
        release_dead(table, wanted.out, runner.ident)
        _plan(table, wanted, tell)

        def states() -> dict[str, Counter[str]]:
            mine = (row for row in table.rows() if row.name in wanted.names)
            return count_stages(mine, wanted.stages)

        progress = Progress(tell, states())
        if table.is_due():
            workers = stack.enter_context(closing(start(wanted)))
            page = _Page(wanted, table)

            def tick() -> None:
                progress.tick()
                page.tick()

            try:
                runner.run(table, workers, progress.take, tick)
            except (KeyboardInterrupt, SystemExit, ToonsetError) as error:
                workers.close()
                with suppress(ToonsetError):  # the page must not say that sheets run
                    progress.close(states())
                    _write_page(wanted, table)
                if not isinstance(error, ToonsetError):
                    tell.say("the same command continues")
                raise
        progress.close(states())
        _write_page(wanted, table)
        return progress.counts


def _check_out(out: Path) -> None:
    """Make the batch's folder; refuse one that is none."""
    from toonset.apps.batch.dispatch import HOLDERS
    from toonset.apps.batch.table import TABLE, tables_in

    if os.path.lexists(out) and not out.is_dir():
        raise OutputError(f"{out}: is a file, a folder is needed; choose another -o")
    try:
        out.mkdir(parents=True, exist_ok=True)
        names = {path.name for path in out.iterdir()} - {HOLDERS}  # another may just begin
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(f"{out}: cannot be made ({reason}); choose another -o") from error
    if names and not tables_in(out):
        raise OutputError(f"{out}: holds files, but no {TABLE}; choose another -o")


def _plan(table: Table, wanted: Wanted, tell: Teller) -> None:
    """Put into the table what is to be done."""
    from toonset.apps.batch.sheets import some_of
    from toonset.apps.batch.stages import keys_of
    from toonset.apps.batch.storage import Hashes
    from toonset.apps.batch.table import Plan

    names = {*table.names()}
    if table.store != wanted.store and names:
        where = f"in {table.store}" if table.store else "in its folder"
        raise UsageError(f"{wanted.out}: has its results {where}; give the same --store")
    table.store = wanted.store
    hashes, plans = Hashes(table), list[Plan]()
    for position, entry in enumerate(wanted.entries):
        if entry.name in wanted.names:
            plans.append(Plan(entry, position, keys_of(entry, wanted.stages, hashes, wanted.verbs)))
        if len(plans) == PLANNED_AT_ONCE or position == len(wanted.entries) - 1:
            table.plan(plans, _there(wanted, plans).__getitem__)
            plans.clear()
            if len(wanted.entries) > PLANNED_AT_ONCE:
                tell.progress(f"reading sheets {position + 1}/{len(wanted.entries)}")
    hashes.keep()
    if other := sorted(names - {entry.name for entry in wanted.entries}):
        said = (
            f"{counted(len(other), 'sheet')} not named now, kept ({some_of(other)}); see --forget"
        )
        tell.say(said)
    if wanted.retry:
        table.retry(wanted.names, wanted.stages)
    table.choose(wanted.names)


def _there(wanted: Wanted, plans: Sequence[Plan]) -> Mapping[str, set[str]]:
    """Return which stages of sheets are done with the keys that are planned, as stamps say."""
    from toonset.apps.batch.dispatch import home_of
    from toonset.apps.batch.job import read_stamp
    from toonset.apps.batch.storage import keys_behind

    behind: Mapping[str, str] = {}
    if wanted.store:
        stamps = [f"{plan.entry.name}/{stage}.json" for plan in plans for stage in plan.keys]
        behind = keys_behind(wanted.store, stamps)

    def is_done(name: str, stage: str, key: str) -> bool:
        if wanted.store:
            return behind.get(f"{name}/{stage}.json") == key
        return read_stamp(home_of(wanted.out, name), stage, key) is not None

    return {
        plan.entry.name: {s for s, key in plan.keys.items() if is_done(plan.entry.name, s, key)}
        for plan in plans
    }


@dataclass
class _Page:
    """The page, written now and then while sheets run."""

    wanted: Wanted
    table: Table
    due: float = 0.0

    def tick(self) -> None:
        """Write it, if that is due: a large one takes seconds."""
        if (began := time.monotonic()) > self.due:
            _write_page(self.wanted, self.table)
            self.due = time.monotonic() + max(PAGE_S, PAUSE * (time.monotonic() - began))


def _write_page(wanted: Wanted, table: Table) -> None:
    """Write the page of the whole batch; parts of one leave it to --merge."""
    from toonset.apps.batch.page import write_page

    if not wanted.is_shard:
        write_page(wanted.out, table.rows(), wanted.out.resolve().name, store=wanted.store)


def _result(wanted: Wanted, counts: Mapping[str, Counter[str]]) -> Result:
    """Return what became of the sheets."""
    found = {stage: {k: n for k, n in count.items() if n} for stage, count in counts.items()}
    bad = sum(count[state] for count in counts.values() for state in ("failed", "quarantined"))
    look = "" if wanted.is_shard else f": look at {wanted.out / 'index.html'}"
    again = "; mend them, or --retry-failed" if bad else ""
    text = f"{wanted.out}: {counted(len(wanted.names), 'sheet')}, {bad} failed{look}{again}"
    values = {"out": wanted.out, "sheets": len(wanted.names), "failed": bad, "stages": found}
    return Result(values, text, bad)


# ---- a batch that was run ------------------------------------------------------------------------


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
    from toonset.apps.batch.table import SHARDS, TABLE, Table, tables_in

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
    from toonset.apps.batch.table import TABLE

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
    from toonset.apps.batch.table import TABLE, Table, tables_in

    return [stack.enter_context(closing(Table(out / name))) for name in tables_in(out) or [TABLE]]
