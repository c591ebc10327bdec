"""Run many sheets from one table.

A batch's folder has the table, a page of all sheets, and a folder for every sheet.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from toonset.apps.batch.progress import Progress, Result, Teller, count_stages
from toonset.apps.batch.request import (
    Request,
    Wanted,
    listed_sheets,
    memory_share,
    shard_of,
    worker_count,
)
from toonset.errors import OutputError, ToonsetError, UsageError, counted

if TYPE_CHECKING:
    from toonset.apps.batch.dispatch import Limits, Workers
    from toonset.apps.batch.rows import Plan
    from toonset.apps.batch.stages import Verbs
    from toonset.apps.batch.table import Table

PAGE_S, PAUSE = 30.0, 50  # between pages: at least; times what the last one took
PLANNED_AT_ONCE = 500  # sheets of one transaction


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
    entries = listed_sheets(asked, verbs, tell.say)
    check_options(entries, chosen, verbs)
    part, table_name = shard_of(asked.shard, out)
    names = choose(entries, asked.only, part)
    count = worker_count(asked.workers, asked.memory_mb)
    share = 0 if asked.ray else memory_share(count)
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
    from toonset.apps.batch.table_file import TABLE, tables_in

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
    from toonset.apps.batch.rows import Plan
    from toonset.apps.batch.sheets import some_of
    from toonset.apps.batch.stages import keys_of
    from toonset.apps.batch.storage import Hashes

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
    from toonset.apps.batch.stamps import read_stamp
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
