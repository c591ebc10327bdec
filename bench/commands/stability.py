"""`python -m bench stability`: an atlas of failures in a folder that a later run continues.

steps.json in the output folder is rewritten after every step, with a picture of the step's worst
case in pictures/. A run with the same seed, counts and version takes finished steps from it; tables
and pictures show all steps of the folder. Who has changed the code in between starts afresh with
--force.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bench.commands.charts import REPORT, file_name
from toonset import __version__
from toonset.errors import BundleError
from toonset.write import check_output

if TYPE_CHECKING:
    from bench.atlas.figures import TriedPage
    from bench.atlas.run import Result
    from bench.stability.files import RunKey
    from bench.stability.table import Row

STEPS, PICTURES, SUMMARY = "steps.json", "pictures", "pages.csv"
WRITTEN = (STEPS, PICTURES, SUMMARY, "stability.csv", "stability.png", "records.json", REPORT)
SHEETS, QUICK_SHEETS = 8, 2  # per step of calibration
BODIES, QUICK_BODIES = 3, 1  # per step of training and palettes


def sweep_into(
    folder: Path,
    only: str,
    seed: int,
    count: int | None,
    *,
    quick: bool,
    force: bool,
    progress: Callable[[str], None],
) -> tuple[list[Row], list[TriedPage]]:
    """Return a row per step of calibration and all pages, after running the steps that lack.

    Raises:
        ToonsetError: no page of that name, or a folder that may not be written or continued.
    """
    from bench.atlas.run import Counts, all_pages, run_steps
    from bench.cases.workers import usable_workers
    from bench.stability.files import RunKey, name_of
    from bench.stability.page import chosen
    from toonset.write import write_bytes

    pages = all_pages()
    plan = chosen(only, pages, quick=quick)
    if not plan:
        names = ", ".join(page.name for page in pages)
        raise BundleError(f"no page's name contains {only!r}; --only takes one of {names}")
    usual = Counts(QUICK_SHEETS, QUICK_BODIES) if quick else Counts(SHEETS, BODIES)
    key = RunKey(__version__, seed, usual if count is None else Counts(count, count))
    done = _finished_steps(folder, key, force=force)
    known = {name_of(step) for step in done}
    missing = [(page, step) for page, step in plan if (page.name, str(step)) not in known]
    found = run_steps(missing, seed, key.counts, workers=usable_workers(), progress=progress)
    for result, picture in found:
        if picture:
            write_bytes(_picture_of(folder, *name_of(result)), picture)
        done.append(result)
        _keep_steps(folder, key, done)
    return _write_results(folder, done, key)


def _finished_steps(folder: Path, key: RunKey, *, force: bool) -> list[Result]:
    """Return the steps of an earlier run in `folder`; none if it is new or to be replaced."""
    from bench.stability.files import from_plain
    from toonset.json_file import read_json

    kept = folder / STEPS
    if kept.is_file() and not force:
        return from_plain(read_json(kept), key, str(kept))
    check_output(folder, [], WRITTEN, force=force)
    _keep_steps(folder, key, [])
    return []


def _keep_steps(folder: Path, key: RunKey, steps: Sequence[Result]) -> None:
    from bench.stability.files import as_plain
    from toonset.write import write_json

    write_json(folder / STEPS, as_plain(key, steps))


def _picture_of(folder: Path, page: str, step: str) -> Path:
    return folder / PICTURES / f"{file_name(f'{page} {step}')}.png"


def _write_results(
    folder: Path, steps: Sequence[Result], key: RunKey
) -> tuple[list[Row], list[TriedPage]]:
    from bench.atlas.figures import summary_csv
    from bench.atlas.report import atlas_html
    from bench.atlas.results import tried_pages
    from bench.records.record import as_dicts, machine
    from bench.stability.chart import draw_stability
    from bench.stability.files import in_table_order, name_of
    from bench.stability.steps import StepResult
    from bench.stability.table import as_csv, as_records, row
    from toonset.write import write_bytes, write_json

    ordered = in_table_order(steps)
    pages = tried_pages(ordered)
    sheets = [step for step in ordered if isinstance(step, StepResult)]
    rows = [row(step) for step in sheets]
    counts = f"{key.counts.sheets} sheets, {key.counts.bodies} trainings or palettes per step"
    about = f"first seed {key.seed}; {counts}; {machine()}"
    places = {name_of(step): _picture_of(folder, *name_of(step)) for step in ordered}
    pictures = {name: path.read_bytes() for name, path in places.items() if path.is_file()}
    command = shlex.join(["python", "-m", "bench", *sys.argv[1:]])
    page = atlas_html(command, __version__, about, pages, pictures)
    write_bytes(folder / REPORT, page.encode())
    write_bytes(folder / SUMMARY, summary_csv(pages))
    write_bytes(folder / "stability.csv", as_csv(rows, key.seed))
    write_json(folder / "records.json", as_dicts(as_records(sheets, key.seed)))
    if rows:
        seeds = f"seeds {key.seed} to {key.seed + key.counts.sheets - 1}"
        caption = f"n = {key.counts.sheets} sheets per step, {seeds}, {machine()}"
        write_bytes(folder / "stability.png", draw_stability(rows, caption))
    return rows, pages
