"""`toonset bench`: speed against accuracy, as a table, a chart and records."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    SeedOption,
    check_output,
)
from toonset.errors import BundleError

if TYPE_CHECKING:
    from toonset.bench.record import Record

WRITTEN = ("records.json", "chart-*.png")
CHARTED = ("rotation error modulo twin", "yaw error", "held-out PSNR")


class Subject(StrEnum):
    """What is measured."""

    calib = "calib"
    train = "train"
    stability = "stability"


class Baseline(StrEnum):
    """What calibration is compared with, besides the nominal angles."""

    colmap = "colmap"


@dataclass(frozen=True)
class Chosen:
    """What the command line asks for."""

    subject: Subject
    cases: Path | None
    sprites: Path | None
    only: str
    count: int
    half: bool
    baseline: Baseline | None
    quick: bool
    seed: int

    def check(self) -> None:
        """Refuse options of another subject.

        Raises:
            BadParameter: one of them is given.
        """
        if self.half and (self.subject is not Subject.train or self.cases is None):
            raise typer.BadParameter("--half belongs to `train --cases`")
        if self.baseline is not None and self.subject is not Subject.calib:
            raise typer.BadParameter("--baseline belongs to `calib`")
        if self.sprites is not None and self.subject is not Subject.calib:
            raise typer.BadParameter("--sprites belongs to `calib`")
        if self.sprites is not None and (self.cases is not None or self.baseline is not None):
            raise typer.BadParameter("--sprites goes without --cases and --baseline")
        if self.cases is not None and self.subject is Subject.stability:
            raise typer.BadParameter("--cases belongs to `calib` and `train`")


def bench(
    subject: Annotated[Subject, typer.Argument(help="What to measure.")],
    cases: Annotated[
        Path | None,
        typer.Option("--cases", help="Folders with ground truth (default: synthetic sheets)."),
    ] = None,
    sprites: Annotated[
        Path | None,
        typer.Option("--sprites", help="Calib: folders of game sprites with their yaws, instead."),
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
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Output folder.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("bench-results"),
    force: ForceFlag = False,
    seed: SeedOption = 0,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Measure calibration or training: seconds against accuracy, per setting.

    Prints a table and writes records.json and a chart per condition. `stability` sweeps errors of a
    sheet instead, to where calibration fails; the same command again continues a stopped run.
    """
    from toonset.bench.record import as_dicts, machine
    from toonset.files import new_folder, write_bytes, write_json

    printer = Printer(as_json, quiet)
    chosen = Chosen(subject, cases, sprites, only, count or 4, half, baseline, quick, seed)
    chosen.check()
    if subject is Subject.stability:
        _stability(out, only, seed, count, quick, force, printer)
        return
    check_output(out, [cases, sprites], WRITTEN, force=force)
    records, text = _measure(chosen, printer)
    with new_folder(out, force=force) as folder:
        write_json(folder / "records.json", as_dicts(records))
        for name, picture in _charts(subject, records, seed).items():
            write_bytes(folder / name, picture)
    printer.say(f"machine: {machine()}, seed {seed}")
    printer.say(f"charts in {out}")
    printer.result({"records": as_dicts(records)}, text)


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


def _measure(chosen: Chosen, printer: Printer) -> tuple[list[Record], str]:
    """Return the records and their table."""
    if chosen.subject is Subject.train:
        return _measure_training(chosen, printer)
    if chosen.sprites is not None:
        from toonset.bench.calib_table import sprites_table
        from toonset.bench.sprites import bench_sprites, sprite_cases

        characters = sprite_cases(chosen.sprites, chosen.only)
        records = bench_sprites(characters, chosen.seed, printer.progress)
        return records, sprites_table(records)
    return _measure_calibration(chosen, printer)


def _measure_calibration(chosen: Chosen, printer: Printer) -> tuple[list[Record], str]:
    from toonset.bench.calib import bench_calibration, bench_colmap
    from toonset.bench.calib_table import sheets_table
    from toonset.bench.cases import calib_cases

    sheets = list(calib_cases(chosen.cases, chosen.seed, chosen.count, chosen.only))
    if not sheets:
        raise BundleError(f"no case's name contains {chosen.only!r}; correct --only")
    quick, progress = chosen.quick, printer.progress
    records = bench_calibration(sheets, chosen.seed, quick=quick, progress=progress)
    if chosen.baseline is Baseline.colmap:
        records += bench_colmap(sheets, chosen.seed, quick=quick, progress=progress)
    return records, sheets_table(records)


def _measure_training(chosen: Chosen, printer: Printer) -> tuple[list[Record], str]:
    from toonset.bench.cases import train_cases
    from toonset.bench.record import table
    from toonset.bench.train import bench_training

    found = train_cases(chosen.cases, chosen.seed, chosen.count, half=chosen.half)
    scenes = [case for case in found if chosen.only in case.name]
    if not scenes:
        raise BundleError(f"no case's name contains {chosen.only!r}; correct --only")
    records = bench_training(scenes, chosen.seed, quick=chosen.quick, progress=printer.progress)
    return records, table(records)


def _charts(subject: Subject, records: list[Record], seed: int) -> dict[str, bytes]:
    from toonset.bench.chart import Point, draw_chart
    from toonset.bench.record import machine

    charts = {}
    for group in dict.fromkeys(record.group for record in records):
        own = [record for record in records if record.group == group]
        seconds = {r.method: r.median for r in own if r.metric == "seconds"}
        merits = [r for r in own if r.metric in CHARTED]
        if not merits:
            continue
        points = [Point(r.method, max(seconds[r.method], 1e-3), r.median, r.p95) for r in merits]
        charts[f"chart-{group.replace(' ', '-').replace(',', '')}.png"] = draw_chart(
            points,
            title=f"toonset bench {subject.value}, {group}: median, whisker to p95",
            cost_label="seconds per sheet" if subject is Subject.calib else "seconds of training",
            merit_label=f"{merits[0].metric} ({merits[0].unit})",
            caption=f"n = {merits[0].n}, seed {seed}, {machine()}",
            lower_is_better=merits[0].direction == "lower",
        )
    return charts
