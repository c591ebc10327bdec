"""`toonset batch`: run many sheets, from one table."""

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
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.common.output import OUTPUT_PANEL, Printer, counted
from toonset.errors import OutputError, ToonsetError, UsageError

if TYPE_CHECKING:
    from toonset.cli.batch.dispatch import Limits, Workers
    from toonset.cli.batch.stages import Entry
    from toonset.cli.batch.table import Plan, Table

USUAL = "calibrate,palette,train,render"
WORKERS_PANEL, CHOICE_PANEL = "Workers", "Which sheets"
TIME_LIMIT_S = 1800.0
PAGE_S, PAUSE = 30.0, 50  # between pages: at least; times what the last one took
LOOK_AT = 3  # exit code: sheets have failed
AUTO = "auto"
PLANNED_AT_ONCE = 500  # sheets of one transaction


def _like(incomplete: str) -> list[str]:
    """Return what a list of stages that is being typed may become."""
    from toonset.cli.batch.stages import STAGES

    before, comma, last = incomplete.rpartition(",")
    others = [name for name in STAGES if name not in before.split(",")]
    return [f"{before}{comma}{name}" for name in others if name.startswith(last)]


def batch(
    sheets: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SHEET",
            help="Sheets: pictures, folders of them, 'patterns*', URLs; or manifests: .csv, "
            ".jsonl with sheet, name, mesh, views, STAGE_options, character, license, source.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="Folder of the batch.", rich_help_panel=OUTPUT_PANEL),
    ] = None,
    stages: Annotated[
        str,
        typer.Option(
            "--stages",
            help="Of calibrate, palette, train, render, view, mesh, export.",
            autocompletion=_like,
        ),
    ] = USUAL,
    given: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="'STAGE OPTIONS'",
            help="Options of a stage, as typed after its verb: 'train --steps 300'; repeatable.",
        ),
    ] = None,
    root: Annotated[
        Path | None,
        typer.Option("--root", help="Folder of a manifest's paths (default: the manifest's)."),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="NAME",
            help="These sheets of them, by name or 'pattern*'; repeatable.",
            rich_help_panel=CHOICE_PANEL,
        ),
    ] = None,
    retry_failed: Annotated[
        bool,
        typer.Option(
            "--retry-failed",
            help="Run what failed or crashed once more, too.",
            rich_help_panel=CHOICE_PANEL,
        ),
    ] = False,
    shard: Annotated[
        str,
        typer.Option(
            "--shard",
            metavar="I/N",
            help="The I-th of N parts, with a table of its own: for job arrays.",
            rich_help_panel=CHOICE_PANEL,
        ),
    ] = "",
    workers: Annotated[
        str,
        typer.Option(
            "--workers",
            metavar="N",
            help="Sheets at once (auto: as cores and memory allow).",
            rich_help_panel=WORKERS_PANEL,
        ),
    ] = AUTO,
    time_limit: Annotated[
        float,
        typer.Option(
            "--time-limit",
            metavar="SECONDS",
            min=0.1,
            help="Of one sheet.",
            rich_help_panel=WORKERS_PANEL,
        ),
    ] = TIME_LIMIT_S,
    memory_limit: Annotated[
        int | None,
        typer.Option(
            "--memory-limit",
            metavar="MB",
            min=1,
            help="Of one sheet (default: its share of what is free).",
            rich_help_panel=WORKERS_PANEL,
        ),
    ] = None,
    ray: Annotated[
        str | None,
        typer.Option(
            "--ray",
            metavar="ADDRESS",
            help="Run on a Ray cluster; local: start one here.",
            rich_help_panel=WORKERS_PANEL,
        ),
    ] = None,
    gpus: Annotated[
        float,
        typer.Option(
            "--gpus", min=0, help="Of one sheet, with --ray.", rich_help_panel=WORKERS_PANEL
        ),
    ] = 0.0,
    store: Annotated[
        str,
        typer.Option(
            "--store",
            metavar="URL",
            help="Put results there, not in OUT/sheets: s3://, gs://, file://.",
            rich_help_panel=OUTPUT_PANEL,
        ),
    ] = "",
    status: Annotated[
        Path | None, typer.Option("--status", metavar="OUT", help="Say where a batch stands.")
    ] = None,
    merge: Annotated[
        Path | None, typer.Option("--merge", metavar="OUT", help="Put the shards' tables together.")
    ] = None,
    forget: Annotated[
        list[str] | None,
        typer.Option(
            "--forget",
            metavar="NAME",
            help="Take a sheet of -o OUT out of table, page and data set: name or 'pattern*'.",
        ),
    ] = None,
    *,
    printer: Printer,
) -> None:
    """Run many sheets: calibrate, palette, train, render, each sheet into a folder of its own.

    The same command continues where it was ended, and does again only what other inputs, options or
    versions touch. OUT/index.html shows all sheets, OUT/batch.sqlite is the table of what is done.
    Exit code 3 when sheets have failed; the others are done then.
    """
    from toonset.cli.batch import whole
    from toonset.cli.batch.dispatch import Limits
    from toonset.cli.batch.sheets import choose
    from toonset.cli.batch.stages import check_options, in_order

    os.environ["OMP_NUM_THREADS"] = "1"  # a sheet has one core; must precede torch
    if (status is not None) + (merge is not None) + bool(sheets or out or forget) > 1:
        raise UsageError("--status and --merge take the batch's folder, and nothing beside it")
    if status is not None:
        whole.say_status(status, printer)
        return
    if merge is not None:
        whole.merge(merge, printer)
        return
    if forget and out is not None and not sheets:
        whole.forget(out, forget, printer)
        return
    if forget:
        raise UsageError("--forget takes -o OUT, and no sheets beside it")
    if not sheets or out is None:
        raise UsageError("name sheets, and the folder of the batch with -o")
    chosen = in_order([name.strip() for name in stages.split(",") if name.strip()])
    if gpus and ray is None:
        raise UsageError("--gpus belongs to --ray")
    entries = _listed(sheets, given or [], root, out, printer.say)
    check_options(entries, chosen)
    part, table_name = _shard(shard, out)
    names = choose(entries, only or [], part)
    count = _count(workers, memory_limit or 0)
    share = 0 if ray else _share(count)
    limits = Limits(time_limit, memory_limit or share)
    wanted = Wanted(
        Path(os.path.abspath(out)),  # workers may have another current folder
        chosen,
        entries,
        names,
        retry_failed,
        limits,
        store,
        table_name,
        given or [],
    )
    start = partial(_ray_workers, ray, gpus, limits) if ray else partial(_local_workers, count)
    _report(wanted, _run(wanted, start, printer), printer)


@dataclass(frozen=True)
class Wanted:
    """What the command line asks for.

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

    @property
    def does(self) -> str:
        """Return what all who work on the batch at once must do alike."""
        return json.dumps([self.stages, self.store, self.given])

    @property
    def is_shard(self) -> bool:
        """Return whether others have a part of it."""
        from toonset.cli.batch.table import TABLE

        return self.table != TABLE


def _listed(
    sheets: list[str], given: list[str], root: Path | None, out: Path, say: Callable[[str], None]
) -> list[Entry]:
    """Return all sheets that are named, with their options."""
    from toonset.cli.batch.sheets import list_sheets
    from toonset.cli.batch.stages import STAGES, as_words

    words: dict[str, tuple[str, ...]] = {}
    for text in given:
        stage, *said = as_words(text, "--with") or ("",)
        if stage not in STAGES:
            raise UsageError(f"--with {text!r}: begins with none of {', '.join(STAGES)}")
        words[stage] = (*words.get(stage, ()), *said)
    return list_sheets(sheets, words, root, out, say)


def _shard(text: str, out: Path) -> tuple[tuple[int, int], str]:
    """Return which part of how many, from 0, and the name of its table."""
    from toonset.cli.batch.table import TABLE, tables_in

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
    from toonset.cli.batch.local import usual_workers

    if workers == AUTO:
        return usual_workers(memory_mb)
    if not re.fullmatch("[1-9][0-9]{0,3}", workers):
        raise UsageError(f"--workers {workers!r}: is neither a number from 1 nor {AUTO}")
    return int(workers)


def _share(count: int) -> int:
    """Return a sheet's share of the memory that is free, MB; 0: it may take what it likes."""
    from toonset.cli.batch.local import WORKER_MB, free_memory_mb

    free = free_memory_mb()
    return 0 if free is None else max(int(free / count), WORKER_MB)


def _local_workers(count: int, wanted: Wanted) -> Workers:
    """Start processes here, when all is imported."""
    from toonset.cli.batch.local import LocalWorkers
    from toonset.cli.batch.stages import import_parts

    import_parts(wanted.stages)
    return LocalWorkers(min(count, len(wanted.names)))


def _ray_workers(address: str, gpus: float, limits: Limits, wanted: Wanted) -> Workers:
    from toonset.cli.batch.on_ray import RayWorkers

    return RayWorkers(address, gpus, limits.memory_mb)


def _run(
    wanted: Wanted, start: Callable[[Wanted], Workers], printer: Printer
) -> Mapping[str, Counter[str]]:
    """Run what is due; return how many sheets are in which state, for every stage."""
    from toonset.cli.batch.dispatch import Runner, alive, release_dead
    from toonset.cli.batch.progress import Progress, count_stages
    from toonset.cli.batch.table import Table

    _check_out(wanted.out)
    with ExitStack() as stack:
        runner = Runner(wanted.out, wanted.limits, wanted.stages, wanted.store)
        stack.enter_context(alive(wanted.out, runner.ident, wanted.does))
        path = wanted.out / wanted.table
        table = stack.enter_context(closing(Table(path, make=True, alone=wanted.is_shard)))
        release_dead(table, wanted.out, runner.ident)
        _plan(table, wanted, printer)

        def states() -> dict[str, Counter[str]]:
            mine = (row for row in table.rows() if row.name in wanted.names)
            return count_stages(mine, wanted.stages)

        progress = Progress(printer, states())
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
                    printer.say("the same command continues")
                raise
        progress.close(states())
        _write_page(wanted, table)
        return progress.counts


def _check_out(out: Path) -> None:
    """Make the batch's folder; refuse one that is none."""
    from toonset.cli.batch.dispatch import HOLDERS
    from toonset.cli.batch.table import TABLE, tables_in

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


def _plan(table: Table, wanted: Wanted, printer: Printer) -> None:
    """Put into the table what is to be done."""
    from toonset.cli.batch.sheets import some_of
    from toonset.cli.batch.stages import keys_of
    from toonset.cli.batch.table import Plan
    from toonset.cli.common.storage import Hashes

    names = {*table.names()}
    if table.store != wanted.store and names:
        where = f"in {table.store}" if table.store else "in its folder"
        raise UsageError(f"{wanted.out}: has its results {where}; give the same --store")
    table.store = wanted.store
    hashes, plans = Hashes(table), list[Plan]()
    for position, entry in enumerate(wanted.entries):
        if entry.name in wanted.names:
            plans.append(Plan(entry, position, keys_of(entry, wanted.stages, hashes)))
        if len(plans) == PLANNED_AT_ONCE or position == len(wanted.entries) - 1:
            table.plan(plans, _there(wanted, plans).__getitem__)
            plans.clear()
            if len(wanted.entries) > PLANNED_AT_ONCE:
                printer.progress(f"reading sheets {position + 1}/{len(wanted.entries)}")
    hashes.keep()
    if other := sorted(names - {entry.name for entry in wanted.entries}):
        said = (
            f"{counted(len(other), 'sheet')} not named now, kept ({some_of(other)}); see --forget"
        )
        printer.say(said)
    if wanted.retry:
        table.retry(wanted.names, wanted.stages)
    table.choose(wanted.names)


def _there(wanted: Wanted, plans: Sequence[Plan]) -> Mapping[str, set[str]]:
    """Return which stages of sheets are done with the keys that are planned, as stamps say."""
    from toonset.cli.batch.dispatch import home_of
    from toonset.cli.batch.job import read_stamp
    from toonset.cli.common.storage import keys_behind

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
    from toonset.cli.batch.page import write_page

    if not wanted.is_shard:
        write_page(wanted.out, table.rows(), wanted.out.resolve().name, store=wanted.store)


def _report(wanted: Wanted, counts: Mapping[str, Counter[str]], printer: Printer) -> None:
    """Print the result; exit with 3 where sheets failed."""
    found = {stage: {k: n for k, n in count.items() if n} for stage, count in counts.items()}
    bad = sum(count[state] for count in counts.values() for state in ("failed", "quarantined"))
    look = "" if wanted.is_shard else f": look at {wanted.out / 'index.html'}"
    again = "; mend them, or --retry-failed" if bad else ""
    text = f"{wanted.out}: {counted(len(wanted.names), 'sheet')}, {bad} failed{look}{again}"
    values = {"out": wanted.out, "sheets": len(wanted.names), "failed": bad, "stages": found}
    printer.result(values, text)
    if bad:
        raise typer.Exit(LOOK_AT)
