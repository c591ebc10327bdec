"""`python -m lab.bench`: speed against accuracy, as a table, a chart and records.

`./run bench` runs it in toonset's own environment. It is no part of the installed package: what it
compares toonset with are development dependencies.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from lab.bench.commands.check import check
from lab.bench.commands.chosen import Chosen, Subject
from lab.bench.commands.measure import WRITTEN as PICTURES
from lab.bench.commands.measure import measure
from lab.bench.commands.results import REPORT, result_files
from lab.bench.commands.results import WRITTEN as RESULTS
from toonset.cli.common.flags import command_of
from toonset.cli.common.help import Verb
from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer, SeedOption
from toonset.cli.main import run
from toonset.write import check_output

WRITTEN = (*RESULTS, *PICTURES)

app = typer.Typer(
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.command(cls=Verb)
@command_of
def bench(
    subject: Annotated[Subject | None, typer.Argument(help="What to measure.")] = None,
    cases: Annotated[
        Path | None,
        typer.Option("--cases", help="Folders with ground truth (default: synthetic ones)."),
    ] = None,
    sprites: Annotated[
        Path | None,
        typer.Option(
            "--sprites", help="Calib, split: folders of game sprites with their yaws, boxes."
        ),
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
            "Stability: sheets per step; default 8 (training: 3), with --quick 2 (1). "
            "Split: sheets per difficulty, 15 times as many mixtures; with --quick 1.",
        ),
    ] = None,
    half: Annotated[
        bool, typer.Option("--half", help="Train on the cases' pictures at half size.")
    ] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer settings or cases.")] = False,
    against_committed: Annotated[
        bool,
        typer.Option("--check", help="No subject: is anything worse than the committed figures?"),
    ] = False,
    renew: Annotated[
        bool, typer.Option("--renew", help="No subject: commit to the figures of now.")
    ] = False,
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Output folder.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("bench-results"),
    force: ForceFlag = False,
    seed: SeedOption = 0,
    *,
    printer: Printer,
) -> None:
    """Measure one stage: seconds against accuracy, per setting, beside a baseline.

    Prints a table and writes records.json and report.html, with a chart of seconds against accuracy
    per condition (PNG, SVG, CSV), and what is known of a default that loses. `split` draws the
    wrongly split sheets. `look` says how new views of drawn sheets look, leaving out every part of
    the drawn look in turn. `stability` sweeps what a sheet may have wrong, to where it fails;
    `train` draws held-out PSNR against seconds. Of these two, the same command again continues a
    stopped run, or draws all that is there.
    `--check` runs a quick bench of every stage and ends with 3 where one has got worse.
    """
    from lab.bench.records.record import as_dicts, machine
    from toonset.write import new_folder, write_bytes

    if against_committed or renew:
        others = (subject, cases, sprites, only, count, half, quick, force)
        if any(others) or (against_committed and renew):
            raise typer.BadParameter("--check and --renew stand alone, without a subject")
        check(seed, printer, renew=renew)
        return
    if subject is None:
        raise typer.BadParameter(f"say what to measure: {', '.join(Subject)}; or --check")
    chosen = Chosen(subject, cases, sprites, only, count, half, quick, seed)
    chosen.check()
    if subject in (Subject.stability, Subject.train):
        with resumable(printer):
            into = _stability if subject is Subject.stability else _training
            into(out, chosen, force, printer)
        return
    check_output(out, [cases, sprites], WRITTEN, force=force)
    measured = measure(chosen, printer)
    files = result_files(subject.value, measured.records, f"seed {seed}", measured.shown)
    with new_folder(out, force=force) as folder:
        for name, content in (files | measured.pictures).items():
            write_bytes(folder / name, content)
    printer.say(f"machine: {machine()}, seed {seed}")
    printer.say(f"look at {out / REPORT}")
    printer.result({"records": as_dicts(measured.records)}, measured.text)


@contextmanager
def resumable(printer: Printer) -> Iterator[None]:
    """Say of a bench that is interrupted that it goes on."""
    try:
        yield
    except KeyboardInterrupt:
        printer.doubt("what is done is kept; the same command goes on")
        raise


def _training(out: Path, chosen: Chosen, force: bool, printer: Printer) -> None:
    from lab.bench.commands.train import train_into

    text, found = train_into(out, chosen, printer, force=force)
    printer.say(f"seeds from {chosen.seed}; look at {out / REPORT}")
    printer.result(found, text)


def _stability(out: Path, chosen: Chosen, force: bool, printer: Printer) -> None:
    from lab.bench.stability.run import sweep_into
    from lab.bench.stability.trials import as_plain, summary_text

    pages = sweep_into(out, chosen, force=force, progress=printer.progress)
    printer.say(f"seeds from {chosen.seed}; look at {out / REPORT}")
    printer.result({"folder": out, "pages": as_plain(pages)}, summary_text(pages))


def main() -> None:
    """Run the bench and leave with its exit code."""
    run(app, "bench")


if __name__ == "__main__":
    main()
