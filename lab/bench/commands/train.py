"""`bench train`: trainings in a folder that a later run continues.

runs.json in the output folder is rewritten after every training. A run of the same version takes
finished trainings from it: the same case, views, method, options and seed; table, records and
pictures show those that were asked for. Who has changed the code in between starts afresh with
--force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lab.bench.commands.chosen import DEFAULT_COUNT, Chosen
from lab.bench.commands.results import WRITTEN as RESULTS
from lab.bench.commands.results import file_name, result_files
from lab.bench.records.kept import keep_rows, kept_rows
from toonset import __version__
from toonset.cli.common.output import Printer
from toonset.errors import BundleError
from toonset.write import write_bytes

if TYPE_CHECKING:
    from lab.bench.cases.cases import TrainCase
    from lab.bench.train.plan import Job
    from lab.bench.train.run import Look, RunResult
    from toonset.nerf.fields.trained_field import TrainedField
    from toonset.nerf.score.evaluate import ScoredView

    Done = list[tuple[dict[str, Any], RunResult]]  # with the jobs' identities

RUNS, VIEWS = "runs.json", "views"
WRITTEN = (RUNS, *RESULTS, VIEWS)


def train_into(
    folder: Path, chosen: Chosen, printer: Printer, *, force: bool
) -> tuple[str, dict[str, Any]]:
    """Return table and records of the chosen trainings, after those that the folder lacks.

    The default's held-out views lie beside the drawings' in a picture per case.

    Raises:
        ToonsetError: no training of that name, or a folder that may not be written or continued.
    """
    from lab.bench.records.record import as_dicts
    from lab.bench.train.measure import records_of, run_jobs, table_of

    jobs = jobs_of(chosen)
    kept, key = folder / RUNS, {"version": __version__}
    done = kept_rows(kept, key, _read, WRITTEN, force=force)
    known = [identity for identity, _ in done]
    lacking = [job for job in jobs if job.identity not in known]
    printer.say(f"{len(lacking)} trainings, {len(jobs) - len(lacking)} are there already")
    try:
        for job, found in run_jobs(lacking, printer.progress, _views_into(folder)):
            done.append((job.identity, found))
            keep_rows(kept, key, _plain(done))
    finally:  # what a stopped run has found so far is worth a look, too
        runs = _of_jobs(done, jobs)
        _write(folder, runs, chosen)
    return table_of(runs), {"records": as_dicts(records_of(runs, chosen.seed))}


def jobs_of(chosen: Chosen) -> list[Job]:
    """Return what the command line asks for.

    Raises:
        BundleError: there is no training of that name.
    """
    from lab.bench.train.plan import SCOPES, plan

    jobs = plan(_cases_of(chosen), chosen.seed, chosen.only, SCOPES[chosen.quick])
    if not jobs:
        raise BundleError(
            f"no training's name contains {chosen.only!r}; names are like "
            "'knight-exact 150 px 8 views default': correct --only"
        )
    return jobs


def _views_into(folder: Path) -> Look:
    """Return what draws a default training's held-out views beside the truth."""

    def look(job: Job, _: TrainedField, views: Sequence[ScoredView]) -> None:
        from lab.bench.records.record import DEFAULT
        from toonset.dataset.images.picture import encode_png
        from toonset.nerf.score.evaluation_picture import contact_sheet

        if job.method == DEFAULT:
            heading = f"{job.name}, seed {job.seed}, held-out views"
            errors_are = "mean difference" if views[0].figures["rgb"]["flip"] is None else "FLIP"
            picture = encode_png(contact_sheet([(heading, views)], errors_are))
            write_bytes(folder / VIEWS / file_name(f"{job.name} {job.seed}.png"), picture)

    return look


def _cases_of(chosen: Chosen) -> list[TrainCase]:
    """Return the cases; a folder's in half size, then whole, unless half is asked for."""
    from lab.bench.cases.cases import train_cases

    count = chosen.count or (1 if chosen.quick else DEFAULT_COUNT)
    if chosen.cases is None:
        return list(train_cases(None, chosen.seed, count))
    sizes = (True,) if chosen.half or chosen.quick else (True, False)
    return [
        case for half in sizes for case in train_cases(chosen.cases, chosen.seed, count, half=half)
    ]


def _of_jobs(done: Done, jobs: list[Job]) -> list[RunResult]:
    """Return the results of the chosen jobs, in the jobs' order."""
    found = []
    for job in jobs:
        found += [result for identity, result in done if identity == job.identity][:1]
    return found


def _plain(done: Done) -> list[dict[str, Any]]:
    return [{"job": identity, "found": asdict(found)} for identity, found in done]


def _read(row: Any) -> tuple[dict[str, Any], RunResult]:
    from lab.bench.train.run import RunResult

    return dict(row["job"]), RunResult(**row["found"])


def _write(folder: Path, runs: list[RunResult], chosen: Chosen) -> None:
    """Write all that is made of the runs: records, charts, the page of them."""
    from lab.bench.train.measure import records_of

    numbers = sorted({run.seed for run in runs})
    seeds = f"seed{'s' * (len(numbers) != 1)} {', '.join(map(str, numbers))}"
    files = result_files(chosen.subject.value, records_of(runs, chosen.seed), seeds)
    for name, content in files.items():
        write_bytes(folder / name, content)
