"""`python -m bench paper`: the plain method's table and figure, what palettes change, the default.

Trainings are kept and continued as those of `bench train`. Pictures of each are kept in strips/,
of which the figure is put together.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.commands.charts import file_name
from bench.commands.chosen import Chosen
from bench.commands.train import WRITTEN, cases_of, run_into, some
from toonset.cli.common.output import Printer

if TYPE_CHECKING:
    from bench.cases.cases import TrainCase
    from bench.train.plan import Job
    from bench.train.run import Look, RunResult
    from toonset.nerf.fields.trained_field import TrainedField
    from toonset.nerf.score.evaluate import ScoredView

STRIPS, TABLE, FIGURE, DIFFERENCES = "strips", "table1", "figure4", "differences"
WRITTEN_HERE = (*WRITTEN, STRIPS, f"{TABLE}.*", f"{FIGURE}-*.png", f"{DIFFERENCES}*.*")


def paper_into(
    folder: Path, chosen: Chosen, printer: Printer, *, force: bool
) -> tuple[str, dict[str, Any]]:
    """Return the paper's Table 1, what palettes change in it, and how soon the default outdoes it.

    Its Figure 4 is drawn for every case.

    Raises:
        ToonsetError: as `train_into`.
    """
    from bench.paper.difference import as_table, claim, differences_of
    from bench.paper.table import as_text, outdone_text
    from toonset.nerf.score.metrics_view import load_judges

    jobs = _jobs_of(chosen)

    def write(runs: list[RunResult]) -> None:
        _write(folder, jobs, runs, chosen.seed)

    look = _strips_into(folder, chosen.seed)
    runs = run_into(folder, jobs, chosen, printer, WRITTEN_HERE, look, write, force=force)
    found, differences = _found(runs), differences_of(runs)
    compared = ["", as_table(differences), claim(differences), ""] if differences else []
    passed = map(outdone_text, found["outdone"])
    reasons = [f"no {name}: {reason}" for name, reason in load_judges().absent.items()]
    return "\n".join([as_text(found["rows"]), *compared, *passed, *reasons]), found


def _found(runs: list[RunResult]) -> dict[str, Any]:
    from bench.paper.difference import as_rows, differences_of
    from bench.paper.table import outdone, paper_rows
    from toonset.nerf.score.metrics_view import load_judges

    return {
        "rows": paper_rows(runs),
        "differences": as_rows(differences_of(runs)),
        "outdone": outdone(runs),
        "absent": load_judges().absent,
    }


def _write(folder: Path, jobs: list[Job], runs: list[RunResult], seed: int) -> None:
    """Write the table, what palettes change, and the figure of every case."""
    from bench.charts.figure import FORMS
    from bench.paper.chart import draw_differences
    from bench.paper.difference import as_csv as differences_csv
    from bench.paper.difference import differences_of
    from bench.paper.table import as_csv
    from bench.records.record import machine
    from toonset.write import write_bytes, write_json

    found, differences = _found(runs), differences_of(runs)
    write_json(folder / f"{TABLE}.json", found | {"seed": seed, "machine": machine()})
    if found["rows"]:
        write_bytes(folder / f"{TABLE}.csv", as_csv(found["rows"]).encode())
    if differences:
        write_bytes(folder / f"{DIFFERENCES}.csv", differences_csv(differences).encode())
    for group in dict.fromkeys(d.group for d in differences):
        own = [d for d in differences if d.group == group]
        for form in FORMS:
            drawing = draw_differences(own, f"{group}; {machine()}.", form)
            write_bytes(folder / f"{DIFFERENCES}-{file_name(group)}.{form}", drawing)
    for case in dict.fromkeys(job.case for job in jobs):
        _draw(folder, case, [job for job in jobs if job.case is case])


def _jobs_of(chosen: Chosen) -> list[Job]:
    from bench.paper.plan import CASES, QUICK_CASES, paper_plan

    cases = cases_of(chosen, QUICK_CASES if chosen.quick else CASES)
    return some(paper_plan(cases, chosen.seed, chosen.only, quick=chosen.quick), chosen)


def _strips_into(folder: Path, seed: int) -> Look:
    """Return what keeps pictures of a result of this seed, if it has a palette."""

    def look(job: Job, case: TrainCase, trained: TrainedField, _: Sequence[ScoredView]) -> None:
        from bench.paper.picture import strip_of
        from toonset.dataset.images.picture import encode_png
        from toonset.write import write_bytes

        if trained.palette is not None and job.seed == seed:
            write_bytes(folder / _strip(job), encode_png(strip_of(trained, case)))

    return look


def _strip(job: Job) -> str:
    return f"{STRIPS}/{file_name(job.name)}.png"


def _draw(folder: Path, case: TrainCase, jobs: list[Job]) -> None:
    """Draw the figure of a case from the strips that are there, the default's last."""
    from bench.charts.chart import DEFAULT
    from bench.paper.picture import drawn_strip, figure_of
    from bench.train.plan import side_px
    from toonset.dataset.images.picture import encode_png, load_rgba
    from toonset.write import write_bytes

    ordered = sorted(jobs, key=lambda job: job.method == DEFAULT)
    files = {job.method: folder / _strip(job) for job in ordered}
    strips = {name: load_rgba(file)[..., :3] for name, file in files.items() if file.is_file()}
    if strips:
        name = f"{FIGURE}-{file_name(case.name)}-{side_px(case)}px.png"
        write_bytes(folder / name, encode_png(figure_of(drawn_strip(case), strips)))
