"""`toonset batch`: run many sheets, from one table; `toonset pack`: make them a data set."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer
from toonset.errors import UsageError

USUAL = "calibrate,palette,train,render"
WORKERS_PANEL, CHOICE_PANEL = "Workers", "Which sheets"
TIME_LIMIT_S = 1800.0
LOOK_AT = 3  # exit code: sheets have failed
USUAL_MB = 256
MB = 10**6
Kind = Literal["webdataset", "parquet", "folder"]


class Verdict(StrEnum):
    """A verdict on a sheet's cameras."""

    ok = "ok"
    weak = "weak"
    ambiguous = "ambiguous"
    failed = "failed"


def _like(incomplete: str) -> list[str]:
    """Return what a list of stages that is being typed may become."""
    from toonset.apps.batch.stages import STAGES

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
    ] = "auto",
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
    from toonset.apps.batch.afterwards import forget_sheets, merge_shards, status_of
    from toonset.apps.batch.batch import run
    from toonset.apps.batch.request import Request
    from toonset.cli.common.verb_stages import VERBS

    os.environ["OMP_NUM_THREADS"] = "1"  # a sheet has one core; must precede torch
    if (status is not None) + (merge is not None) + bool(sheets or out or forget) > 1:
        raise UsageError("--status and --merge take the batch's folder, and nothing beside it")
    if status is not None:
        found = status_of(status)
    elif merge is not None:
        found = merge_shards(merge, printer)
    elif forget and out is not None and not sheets:
        found = forget_sheets(out, forget)
    elif forget:
        raise UsageError("--forget takes -o OUT, and no sheets beside it")
    elif not sheets or out is None:
        raise UsageError("name sheets, and the folder of the batch with -o")
    else:
        wanted = Request(
            sheets=tuple(sheets),
            out=out,
            stages=stages,
            given=tuple(given or ()),
            root=root,
            only=tuple(only or ()),
            retry=retry_failed,
            shard=shard,
            workers=workers,
            seconds=time_limit,
            memory_mb=memory_limit or 0,
            ray=ray,
            gpus=gpus,
            store=store,
        )
        found = run(wanted, VERBS, printer)
    printer.result(found.values, found.text)
    if found.failed:
        raise typer.Exit(LOOK_AT)


def pack(
    batch: Annotated[Path, typer.Argument(metavar="OUT", help="Folder of a batch.")],
    to: Annotated[Kind, typer.Option("--to", help="Format.")],
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder to write.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("dataset"),
    verdict: Annotated[
        list[Verdict] | None,
        typer.Option("--verdict", help="Sheets of this verdict only; repeatable."),
    ] = None,
    split: Annotated[
        str,
        typer.Option(
            "--split",
            metavar="TRAIN,VAL,TEST",
            help="Shares, as 80,10,10; a character's sheets stay together.",
        ),
    ] = "100,0,0",
    shard_size: Annotated[
        int,
        typer.Option(
            "--shard-size",
            metavar="MB",
            min=1,
            help="Most of a shard of webdataset or parquet.",
            rich_help_panel=OUTPUT_PANEL,
        ),
    ] = USUAL_MB,
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Write the sheets of a batch that are done as one data set: pictures, cameras, palettes.

    README.md and card.json say what is in it and how it is loaded. The same sheets give the same
    bytes, and a character stays in its split when sheets are added.
    """
    from toonset.apps.batch.pack import Packing, pack_batch

    wanted = Packing(
        kind=to,
        verdicts=tuple(one.value for one in verdict or Verdict),
        split=split,
        shard_bytes=shard_size * MB,
    )
    found = pack_batch(batch, out, wanted, force=force, tell=printer)
    printer.result(found.values, found.text)
