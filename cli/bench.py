"""`toonset bench`: speed against accuracy, as a table, a chart and records."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.output import ForceFlag, JsonFlag, Printer, QuietFlag, SeedOption, check_output

if TYPE_CHECKING:
    from toonset.bench.record import Record

WRITTEN = ("records.json", "chart-*.png")


class Subject(StrEnum):
    """What is measured."""

    calib = "calib"
    train = "train"
    stability = "stability"


class Baseline(StrEnum):
    """What calibration is compared with, besides the nominal angles."""

    colmap = "colmap"


def bench(
    subject: Annotated[Subject, typer.Argument(help="What to measure.")],
    cases: Annotated[
        Path | None,
        typer.Option("--cases", help="Folders with ground truth (default: synthetic sheets)."),
    ] = None,
    only: Annotated[
        str, typer.Option("--only", help="Cases (or sweeps) whose name contains this, e.g. exact.")
    ] = "",
    count: Annotated[
        int | None,
        typer.Option(
            "--count",
            min=1,
            help="Synthetic cases per condition (without --cases); default 4. "
            "Stability: sheets per step; default 8, with --quick 2.",
        ),
    ] = None,
    half: Annotated[
        bool, typer.Option("--half", help="Train on the cases' pictures at half size.")
    ] = False,
    baseline: Annotated[
        Baseline | None,
        typer.Option("--baseline", help="Calib: also run COLMAP, structure from motion; slow."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer settings.")] = False,
    out: Annotated[Path, typer.Option("-o", "--out", help="Output folder.")] = Path(
        "bench-results"
    ),
    force: ForceFlag = False,
    seed: SeedOption = 0,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Measure calibration or training: seconds against accuracy, per setting.

    Prints a table and writes records.json and a chart per condition. `stability` sweeps errors of a
    sheet instead, to where calibration fails; the same command again continues a stopped run.
    """
    from toonset.bench.record import as_dicts, machine, table
    from toonset.files import new_folder, write_bytes, write_json

    printer = Printer(as_json, quiet)
    if half and (subject is not Subject.train or cases is None):
        raise typer.BadParameter("--half belongs to `train --cases`")
    if baseline is not None and subject is not Subject.calib:
        raise typer.BadParameter("--baseline belongs to `calib`")
    if subject is Subject.stability:
        if cases is not None:
            raise typer.BadParameter("--cases belongs to `calib` and `train`")
        _stability(out, only, seed, count, quick, force, printer)
        return
    check_output(out, [cases], WRITTEN, force=force)
    records = _measure(subject, cases, only, count or 4, half, quick, seed, printer, baseline)
    with new_folder(out, force=force) as folder:
        write_json(folder / "records.json", as_dicts(records))
        for name, picture in _charts(subject, records, seed).items():
            write_bytes(folder / name, picture)
    printer.say(f"machine: {machine()}, seed {seed}")
    printer.say(f"charts in {out}")
    printer.result({"records": as_dicts(records)}, table(records))


def _stability(
    out: Path, only: str, seed: int, count: int | None, quick: bool, force: bool, printer: Printer
) -> None:
    from dataclasses import asdict

    from toonset.bench.stability_table import as_text
    from toonset.cli.bench_stability import sweep_into

    progress = printer.progress
    rows = sweep_into(out, only, seed, count, quick=quick, force=force, progress=progress)
    printer.say(f"seed {seed}; picture in {out / 'stability.png'}")
    printer.result({"folder": out, "rows": [asdict(row) for row in rows]}, as_text(rows))


def _measure(
    subject: Subject,
    cases: Path | None,
    only: str,
    count: int,
    half: bool,
    quick: bool,
    seed: int,
    printer: Printer,
    baseline: Baseline | None,
) -> list[Record]:
    from toonset.bench.cases import calib_cases, train_cases
    from toonset.errors import BundleError

    if subject is Subject.calib:
        from toonset.bench.calib import bench_calibration, bench_colmap

        sheets = [case for case in calib_cases(cases, seed, count) if only in case.name]
        if not sheets:
            raise BundleError(f"no case's name contains {only!r}; correct --only")
        records = bench_calibration(sheets, seed, quick=quick, progress=printer.progress)
        if baseline is Baseline.colmap:
            records += bench_colmap(sheets, seed, quick=quick, progress=printer.progress)
        return records
    from toonset.bench.train import bench_training

    scenes = [c for c in train_cases(cases, seed, count, half=half) if only in c.name]
    if not scenes:
        raise BundleError(f"no case's name contains {only!r}; correct --only")
    return bench_training(scenes, seed, quick=quick, progress=printer.progress)


def _charts(subject: Subject, records: list[Record], seed: int) -> dict[str, bytes]:
    from toonset.bench.chart import Point, draw_chart
    from toonset.bench.record import machine

    metric = "rotation error modulo twin" if subject is Subject.calib else "held-out PSNR"
    unit = "deg" if subject is Subject.calib else "dB"
    charts = {}
    for group in sorted({record.group for record in records}):
        own = [record for record in records if record.group == group]
        seconds = {r.method: r.median for r in own if r.metric == "seconds"}
        merits = [r for r in own if r.metric == metric]
        points = [Point(r.method, max(seconds[r.method], 1e-3), r.median, r.p95) for r in merits]
        charts[f"chart-{group}.png"] = draw_chart(
            points,
            title=f"toonset bench {subject.value}, {group}: median, whisker to p95",
            cost_label="seconds per sheet" if subject is Subject.calib else "seconds of training",
            merit_label=f"{metric} ({unit})",
            caption=f"n = {merits[0].n}, seed {seed}, {machine()}",
            lower_is_better=subject is Subject.calib,
        )
    return charts
