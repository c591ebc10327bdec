"""`python -m lab.bench --check`: a quick bench of every stage against the committed figures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from lab.bench.commands.chosen import Chosen, Subject
from toonset.cli.common.output import Printer
from toonset.errors import BundleError

if TYPE_CHECKING:
    from lab.bench.records.gate import Guard
    from lab.bench.records.record import Record

COMMITTED = Path(__file__).parents[1] / "committed.json"
SUBJECTS = {  # synthetic cases of each: what fits five minutes
    Subject.calib: 1,
    Subject.palette: None,
    Subject.labels: None,
    Subject.splitting: 1,
    Subject.train: 1,
    Subject.look: 1,
}
LOOK_METRICS = ("FLIP", "dirt", "ink F1")  # of looks: the others follow from these
WORSE = 3


def check(seed: int, printer: Printer, *, renew: bool) -> None:
    """Print what has got worse, exit code 3 if anything has; or renew the committed figures.

    Raises:
        ToonsetError: the committed figures cannot be read, or written.
    """
    from lab.bench.records.gate import as_plain, as_text, compared, from_plain
    from toonset.json_file import read_json
    from toonset.write import write_json

    committed = [] if renew else from_plain(read_json(COMMITTED), str(COMMITTED))
    if known := {guard.seed for guard in committed} - {seed}:
        raise BundleError(
            f"{COMMITTED}: figures of seed {known.pop()}, not {seed}; pass that --seed"
        )
    now = measured(seed, printer)
    if renew:
        write_json(COMMITTED, as_plain(now))
        printer.result({"figures": len(now)}, f"{len(now)} figures written to {COMMITTED}")
        return
    rows = compared(committed, now)
    worse = [row for row in rows if row.fails]
    plain = [{"key": row.committed.key, "lost": row.lost, "now": row.now} for row in worse]
    printer.result({"figures": len(rows), "worse": plain}, as_text(rows))
    if worse:
        raise typer.Exit(WORSE)


def measured(seed: int, printer: Printer) -> list[Guard]:
    """Return the figures of all subjects, as they are now."""
    from lab.bench.records.gate import guards_of, yardstick_s

    guards = []
    for subject, count in SUBJECTS.items():
        printer.say(f"{subject.value} ...")
        yard_s = yardstick_s()
        chosen = Chosen(subject, count=count, quick=True, seed=seed)
        guards += guards_of(subject.value, _records(chosen, printer), yard_s)
    return guards


def _records(chosen: Chosen, printer: Printer) -> list[Record]:
    from lab.bench.records.record import DEFAULT

    if chosen.subject is Subject.train:
        from lab.bench.commands.train import jobs_of
        from lab.bench.train.measure import records_of, run_jobs

        jobs = [job for job in jobs_of(chosen) if job.method == DEFAULT]
        return records_of([found for _, found in run_jobs(jobs, printer.progress)], chosen.seed)
    if chosen.subject is Subject.look:
        from lab.bench.look.cases import look_cases
        from lab.bench.look.measure import bench_look
        from lab.bench.look.measure import records_of as records_of_looks

        cases = look_cases(None, chosen.seed, chosen.count or 1, quick=True)
        results = bench_look(cases, chosen.seed, (DEFAULT,), printer.progress)
        return [r for r in records_of_looks(results, chosen.seed) if r.metric in LOOK_METRICS]
    from lab.bench.commands.measure import measure

    return measure(chosen, printer).records
