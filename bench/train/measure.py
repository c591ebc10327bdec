"""Training: seconds against how near held-out views come, per method, beside baselines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from bench.charts.chart import DEFAULT
from bench.records.record import CPU_SECONDS, Direction, Record, aligned, summarise
from bench.train.plan import METHODS, Job
from bench.train.run import Look, RunResult, Seen, reached, run_job
from toonset.nerf.score.metrics_view import load_judges

NEAR_END_DB = 0.5


@dataclass(frozen=True)
class Column:
    """A figure of a run: in the table and among the records.

    Attributes:
        metric: name of the record.
        unit: of it.
        direction: which is better.
        heading: in the table; "" = in the records only.
        form: number format of the table.
        value: of a run; None where it has none.
    """

    metric: str
    unit: str
    direction: Direction
    heading: str
    form: str
    value: Callable[[RunResult], float | None]


def run_jobs(
    jobs: Sequence[Job],
    progress: Callable[[str], None] = lambda text: None,
    look: Look = lambda *_: None,
    done: Sequence[RunResult] = (),
) -> Iterator[tuple[Job, RunResult]]:
    """Yield every job with its result, as soon as it is done; one at a time, for they are timed.

    What leaves out a step that found nothing to do in "default" has that training's result.

    Args:
        jobs: "default" before what is compared with it.
        progress: called with what is about to be run.
        look: is shown the fields and their held-out views.
        done: results of earlier jobs.
    """
    judges = load_judges()
    defaults = {_character(found): found for found in done if found.method == DEFAULT}
    for number, job in enumerate(jobs, 1):
        known = defaults.get((job.group, job.case.name, job.seed))
        if known and not known.note and job.way.leaves_out not in (None, *known.acted):
            yield job, replace(known, method=job.method)
            continue
        progress(f"{number} of {len(jobs)}: {job.name}, seed {job.seed}")
        found = run_job(job, judges, look)
        if job.method == DEFAULT:
            defaults[_character(found)] = found
        yield job, found


def _character(run: RunResult) -> tuple[str, str, int]:
    return run.group, run.case, run.seed


def records_of(runs: Sequence[RunResult], seed: int) -> list[Record]:
    """Return the records of all groups and methods, in the order of `in_order`."""
    records = []
    for (group, method), found in _grouped(runs):
        for column in COLUMNS:
            figures = [(run.case, column.value(run)) for run in found]
            values = [value for _, value in figures if value is not None]
            if values:
                records.append(
                    summarise(
                        values,
                        by_case=_means(figures),
                        method=method,
                        metric=column.metric,
                        unit=column.unit,
                        direction=column.direction,
                        seed=seed,
                        group=group,
                    )
                )
    return records


def _means(figures: Sequence[tuple[str, float | None]]) -> dict[str, float]:
    """Return the mean over the seeds of every case that has the figure."""
    seen: dict[str, list[float]] = {}
    for case, value in figures:
        if value is not None:
            seen.setdefault(case, []).append(value)
    return {case: float(np.mean(values)) for case, values in seen.items()}


def table_of(runs: Sequence[RunResult]) -> str:
    """Return means over cases and seeds, medians of seconds, as a text per group and method."""
    lines: list[str] = []
    for group, listed in groupby(_grouped(runs), key=lambda entry: entry[0][0]):
        shown = [column for column in COLUMNS if column.heading]
        rows = [("method", "n", *(column.heading for column in shown))]
        for (_, method), found in listed:
            cells = [_cell(column, found) for column in shown]
            rows.append((method, str(len(found)), *cells))
        lines += ["", group, *aligned(rows, words=1)]
    failed = [f"{r.case}, {r.group}, {r.method}, seed {r.seed}: {r.note}" for r in runs if r.note]
    return "\n".join([*lines[1:], *(["", "failed", *failed] if failed else [])])


def in_order(runs: Sequence[RunResult]) -> list[RunResult]:
    """Return the runs that succeeded, group by group as they came, methods as they are listed."""
    runs = [run for run in runs if not run.note]
    groups = list(dict.fromkeys(run.group for run in runs))
    methods = list(dict.fromkeys([*METHODS, *(run.method for run in runs)]))  # peers last
    return sorted(runs, key=lambda run: (groups.index(run.group), methods.index(run.method)))


def _grouped(runs: Sequence[RunResult]) -> list[tuple[tuple[str, str], list[RunResult]]]:
    ordered = groupby(in_order(runs), key=lambda run: (run.group, run.method))
    return [(key, list(found)) for key, found in ordered]


def _cell(column: Column, found: Sequence[RunResult]) -> str:
    values = [v for v in map(column.value, found) if v is not None]
    if not values:
        return "-"
    timed = column.unit == "s"
    return column.form.format(np.median(values) if timed else np.mean(values))


def _figure(name: str) -> Callable[[RunResult], float | None]:
    return lambda run: run.figures.get(name)


def _near_end(read: Callable[[Seen], float]) -> Callable[[RunResult], float | None]:
    """Return what reads seconds off the curve; a curve that began so near tells nothing."""

    def value(run: RunResult) -> float | None:
        near = reached(run.curve, run.curve[-1].psnr - NEAR_END_DB)
        return None if near is None or near == run.curve[0] else read(near)

    return value


def _quality(
    metric: str, name: str, heading: str, form: str, unit: str = "1", lower: bool = False
) -> Column:
    direction: Direction = "lower" if lower else "higher"
    return Column(f"held-out {metric}", unit, direction, heading, form, _figure(name))


COLUMNS = (
    Column("seconds", "s", "lower", "s", "{:.1f}", lambda run: run.seconds),
    Column(CPU_SECONDS, "s", "lower", "CPU s", "{:.1f}", lambda run: run.cpu_seconds),
    Column(
        *("seconds to 0.5 dB below the end", "s", "lower", "s to -0.5 dB", "{:.1f}"),
        _near_end(lambda seen: seen.seconds),
    ),
    Column(
        *("CPU seconds to 0.5 dB below the end", "s", "lower", "CPU s to", "{:.1f}"),
        _near_end(lambda seen: seen.cpu_seconds),
    ),
    _quality("PSNR", "psnr", "PSNR", "{:.2f}", "dB"),
    _quality("PSNR in mask", "psnr_mask", "in mask", "{:.2f}", "dB"),
    _quality("PSNR, 2 px tolerated", "psnr_shift", "+-2 px", "{:.2f}", "dB"),
    _quality("SSIM", "ssim", "SSIM", "{:.3f}"),
    _quality("FLIP", "flip", "FLIP", "{:.4f}", lower=True),
    _quality("LPIPS", "lpips", "", "", lower=True),
    _quality("outline IoU", "silhouette_iou", "outline", "{:.3f}"),
    _quality("lines F1", "ink_f1", "lines", "{:.2f}"),
    _quality("label accuracy", "label_accuracy", "labels", "{:.3f}"),
    _quality("label mIoU", "label_miou", "mIoU", "{:.3f}"),
    _quality("palette PSNR", "palette_psnr", "pal. PSNR", "{:.2f}", "dB"),
    _quality("palette PSNR in mask", "palette_psnr_mask", "", "", "dB"),
    _quality("palette FLIP", "palette_flip", "pal. FLIP", "{:.4f}", lower=True),
    Column(
        *("seconds per rendered view", "s", "lower", "s a view", "{:.2f}"),
        lambda run: run.render_seconds,
    ),
    Column(*("parameters", "1", "lower", "", ""), lambda run: run.parameters or None),
    Column(
        *("model size", "kB", "lower", "model kB", "{:.0f}"),
        lambda run: run.model_bytes / 1000 or None,
    ),
)
