"""`toonset bench stability`: sweeps in a folder that a later run continues.

steps.json in the output folder is rewritten after every step. A run with the same seed, count and
version takes finished steps from it; table, records and picture show all steps of the folder. Who
has changed the code in between starts afresh with --force.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from toonset import __version__
from toonset.cli.output import check_output
from toonset.errors import BundleError

if TYPE_CHECKING:
    from toonset.bench.stability import StepResult
    from toonset.bench.stability_files import RunKey
    from toonset.bench.stability_table import Row

STEPS = "steps.json"
WRITTEN = (STEPS, "stability.csv", "stability.png", "records.json")
SHEETS, QUICK_SHEETS = 8, 2  # per step


def sweep_into(
    folder: Path,
    only: str,
    seed: int,
    count: int | None,
    *,
    quick: bool,
    force: bool,
    progress: Callable[[str], None],
) -> list[Row]:
    """Return one row per step in the folder, after running the steps that it lacks.

    Raises:
        ToonsetError: no sweep of that name, or a folder that may not be written or continued.
    """
    from toonset.bench.stability import run_steps
    from toonset.bench.stability_files import RunKey
    from toonset.bench.stability_sweeps import SWEEPS, chosen
    from toonset.bench.workers import usable_workers

    plan = chosen(only, quick=quick)
    if not plan:
        names = ", ".join(sweep.name for sweep in SWEEPS)
        raise BundleError(f"no sweep's name contains {only!r}; --only takes one of {names}")
    key = RunKey(__version__, seed, count or (QUICK_SHEETS if quick else SHEETS))
    done = _finished_steps(folder, key, force=force)
    known = {(step.sweep, step.step) for step in done}
    missing = [(sweep, step) for sweep, step in plan if (sweep.name, str(step)) not in known]
    results = run_steps(missing, seed, key.count, workers=usable_workers(), progress=progress)
    for result in results:
        done.append(result)
        _keep_steps(folder, key, done)
    return _write_results(folder, done, key)


def _finished_steps(folder: Path, key: RunKey, *, force: bool) -> list[StepResult]:
    """Return the steps of an earlier run in `folder`; none if it is new or to be replaced."""
    from toonset.bench.stability_files import from_plain
    from toonset.dataset.json_file import read_json

    kept = folder / STEPS
    if kept.is_file() and not force:
        return from_plain(read_json(kept), key, str(kept))
    check_output(folder, [], WRITTEN, force=force)
    _keep_steps(folder, key, [])
    return []


def _keep_steps(folder: Path, key: RunKey, steps: list[StepResult]) -> None:
    from toonset.bench.stability_files import as_plain
    from toonset.files import write_json

    write_json(folder / STEPS, as_plain(key, steps))


def _write_results(folder: Path, steps: list[StepResult], key: RunKey) -> list[Row]:
    from toonset.bench.record import as_dicts, machine
    from toonset.bench.stability_chart import draw_stability
    from toonset.bench.stability_files import in_table_order
    from toonset.bench.stability_table import as_csv, as_records, row
    from toonset.files import write_bytes, write_json

    ordered = in_table_order(steps)
    rows = [row(step) for step in ordered]
    caption = f"n = {key.count} sheets per step, seed {key.seed}, {machine()}"
    write_bytes(folder / "stability.csv", as_csv(rows, key.seed))
    write_json(folder / "records.json", as_dicts(as_records(ordered, key.seed)))
    write_bytes(folder / "stability.png", draw_stability(rows, caption))
    return rows
