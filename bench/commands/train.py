"""`bench train`: trainings in a folder that a later run continues; `paper` runs them, too.

runs.json in the output folder is rewritten after every training. A run of the same version takes
finished trainings from it: the same case, views, method, options and seed; table, records and
pictures show those that were asked for. Who has changed the code in between starts afresh with
--force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.commands.charts import WRITTEN as RESULTS
from bench.commands.charts import file_name, result_files
from bench.commands.chosen import DEFAULT_COUNT, Chosen
from toonset import __version__
from toonset.cli.common.output import Printer
from toonset.errors import BundleError
from toonset.write import check_output

if TYPE_CHECKING:
    from bench.cases.cases import TrainCase
    from bench.train.plan import Job
    from bench.train.run import Look, RunResult
    from toonset.nerf.fields.trained_field import TrainedField
    from toonset.nerf.score.evaluate import ScoredView

RUNS, CURVES, VIEWS = "runs.json", "train", "views"
WRITTEN = (RUNS, *RESULTS, f"{CURVES}.png", f"{CURVES}.svg", VIEWS)
QUICK_COUNT = 1


def train_into(
    folder: Path, chosen: Chosen, printer: Printer, *, force: bool
) -> tuple[str, dict[str, Any]]:
    """Return table and records of the chosen trainings, after those that the folder lacks.

    The default's held-out views lie beside the drawings' in a picture per case.

    Raises:
        ToonsetError: no training of that name, or a folder that may not be written or continued.
    """
    from bench.records.record import as_dicts
    from bench.train.choice import choices_of, choices_text
    from bench.train.measure import records_of, table_of

    jobs = jobs_of(chosen)
    runs = run_into(folder, jobs, chosen, printer, WRITTEN, _views_into(folder), force=force)
    choices = choices_of(runs)
    parts = [table_of(runs), choices_text(choices)]
    return "\n\n".join(part for part in parts if part), {
        "records": as_dicts(records_of(runs, chosen.seed)),
        "planes": [asdict(choice) for choice in choices],
    }


def jobs_of(chosen: Chosen) -> list[Job]:
    """Return what the command line asks for.

    Raises:
        BundleError: there is no training of that name.
    """
    from bench.train.peers import parse_peers
    from bench.train.plan import SCOPES, plan

    peers = parse_peers(chosen.peers)  # refused before anything is drawn
    count = QUICK_COUNT if chosen.quick else DEFAULT_COUNT
    scope = SCOPES[chosen.subject.value, chosen.quick]
    return some(plan(cases_of(chosen, count), chosen.seed, chosen.only, scope, peers), chosen)


def some(jobs: list[Job], chosen: Chosen) -> list[Job]:
    """Return the jobs.

    Raises:
        BundleError: there is none.
    """
    if not jobs:
        raise BundleError(
            f"no training's name contains {chosen.only!r}; names are like "
            "'knight-exact 150 px 8 views default': correct --only"
        )
    return jobs


def run_into(
    folder: Path,
    jobs: list[Job],
    chosen: Chosen,
    printer: Printer,
    written: tuple[str, ...],
    look: Look = lambda *_: None,
    write: Callable[[list[RunResult]], None] = lambda runs: None,
    *,
    force: bool,
) -> list[RunResult]:
    """Return the jobs' results, after running those that the folder lacks.

    Args:
        folder: of earlier results and these.
        jobs: what is asked for.
        chosen: the command line.
        printer: told what is run.
        written: what the folder may hold.
        look: is shown the fields and their held-out views.
        write: writes further files of the results, those of a stopped run too.
        force: start afresh.
    """
    from bench.train.files import missing
    from bench.train.measure import run_jobs

    done = _finished(folder, chosen, written, force=force)
    lacking = missing(jobs, done)
    earlier = [found for _, found in done]
    printer.say(f"{len(lacking)} trainings, {len(jobs) - len(lacking)} are there already")
    try:
        for job, found in run_jobs(lacking, printer.progress, look, earlier):
            done.append((job.identity, found))
            _keep(folder, done)
    finally:  # what a stopped run has found so far is worth a look, too
        runs = _of_jobs(done, jobs)
        _write(folder, runs, chosen)
        write(runs)
    return runs


def _views_into(folder: Path) -> Look:
    """Return what draws a default training's held-out views beside the truth."""

    def look(job: Job, _: TrainCase, trained: TrainedField, views: Sequence[ScoredView]) -> None:
        from bench.charts.chart import DEFAULT
        from toonset.dataset.images.picture import encode_png
        from toonset.nerf.score.evaluation_picture import contact_sheet
        from toonset.write import write_bytes

        if job.method == DEFAULT:
            heading = f"{job.name}, seed {job.seed}, held-out views"
            errors_are = "mean difference" if views[0].figures["rgb"]["flip"] is None else "FLIP"
            picture = encode_png(contact_sheet([(heading, views)], errors_are))
            write_bytes(folder / VIEWS / file_name(f"{job.name} {job.seed}.png"), picture)

    return look


def cases_of(chosen: Chosen, count: int) -> list[TrainCase]:
    """Return the cases; a folder's in half size, then whole, unless half is asked for.

    Args:
        chosen: what the command line asks for.
        count: of synthetic cases, unless it says how many.
    """
    from bench.cases.cases import train_cases

    count = chosen.count or count
    if chosen.cases is None:
        return list(train_cases(None, chosen.seed, count))
    sizes = (True,) if chosen.half or chosen.quick else (True, False)
    return [
        case for half in sizes for case in train_cases(chosen.cases, chosen.seed, count, half=half)
    ]


def _of_jobs(done: list[tuple[dict[str, Any], RunResult]], jobs: list[Job]) -> list[RunResult]:
    """Return the results of the chosen jobs, in the jobs' order."""
    found = []
    for job in jobs:
        found += [result for identity, result in done if identity == job.identity][:1]
    return found


def _finished(
    folder: Path, chosen: Chosen, written: tuple[str, ...], *, force: bool
) -> list[tuple[dict[str, Any], RunResult]]:
    """Return the trainings of an earlier run in `folder`; none if it is new or to be replaced."""
    from bench.train.files import from_plain
    from toonset.json_file import read_json

    kept = folder / RUNS
    if kept.is_file() and not force:
        return from_plain(read_json(kept), __version__, str(kept))
    check_output(folder, [chosen.cases], written, force=force)
    _keep(folder, [])
    return []


def _keep(folder: Path, done: list[tuple[dict[str, Any], RunResult]]) -> None:
    from bench.train.files import as_plain
    from toonset.write import write_json

    write_json(folder / RUNS, as_plain(done, __version__))


def _write(folder: Path, runs: list[RunResult], chosen: Chosen) -> None:
    """Write all that is made of the runs: records, charts, curves, the page of them."""
    from bench.charts.figure import FORMS
    from bench.records.record import machine
    from bench.records.report import Picture
    from bench.train.chart import draw_curves
    from bench.train.measure import in_order, records_of
    from toonset.write import write_bytes

    files, pictures = {}, []
    numbers = sorted({run.seed for run in runs})
    seeds = f"seed{'s' * (len(numbers) != 1)} {', '.join(map(str, numbers))}"
    if in_order(runs):
        caption = f"Mean of 4 held-out views; {seeds}; {machine()}."
        files = {f"{CURVES}.{form}": draw_curves(runs, caption, form) for form in FORMS}
        shows = "Held-out PSNR while the training goes on"
        pictures = [Picture(files[f"{CURVES}.svg"], shows)]
    records = records_of(runs, chosen.seed)
    files |= result_files(chosen.subject.value, records, seeds, pictures)
    for name, content in files.items():
        write_bytes(folder / name, content)
