"""Training: seconds against how near held-out views come, per method, beside baselines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby

import numpy as np

from lab.bench.records.record import CPU_SECONDS, Column, Direction, Record, Recorder, methods_table
from lab.bench.train.plan import METHODS, Job
from lab.bench.train.run import Look, RunResult, run_job
from toonset.nerf.score.metrics_view import load_judges


def run_jobs(
    jobs: Sequence[Job],
    progress: Callable[[str], None] = lambda text: None,
    look: Look = lambda *_: None,
) -> Iterator[tuple[Job, RunResult]]:
    """Yield every job with its result, as soon as it is done; one at a time, for they are timed.

    Args:
        jobs: what is asked for.
        progress: called with what is about to be run.
        look: is shown the fields and their held-out views.
    """
    judges = load_judges()
    for number, job in enumerate(jobs, 1):
        progress(f"{number} of {len(jobs)}: {job.name}, seed {job.seed}")
        yield job, run_job(job, judges, look)


def records_of(runs: Sequence[RunResult], seed: int) -> list[Record]:
    """Return the records of all groups and methods, in the order of `in_order`."""
    records = []
    for (group, method), listed in groupby(in_order(runs), key=lambda run: (run.group, run.method)):
        found = list(listed)
        recorder = Recorder(method, group, seed)
        for metric, (unit, direction, read, *_) in METRICS.items():
            by_case: dict[str, list[float]] = {}
            for run in found:
                if (value := read(run)) is not None:
                    by_case.setdefault(run.case, []).append(value)
            if by_case:
                values = [value for own in by_case.values() for value in own]
                means = {case: float(np.mean(own)) for case, own in by_case.items()}
                records.append(recorder.samples(metric, values, unit, direction, means))
    return records


def table_of(runs: Sequence[RunResult]) -> str:
    """Return means over cases and seeds, medians of seconds, as a text per group and method."""
    text = methods_table(records_of(runs, 0), COLUMNS)
    failed = [f"{r.case}, {r.group}, {r.method}, seed {r.seed}: {r.note}" for r in runs if r.note]
    return "\n".join([text, *(["", "failed", *failed] if failed else [])])


def in_order(runs: Sequence[RunResult]) -> list[RunResult]:
    """Return the runs that succeeded, group by group as they came, methods as they are listed."""
    runs = [run for run in runs if not run.note]
    groups = list(dict.fromkeys(run.group for run in runs))
    methods = list(METHODS)
    return sorted(runs, key=lambda run: (groups.index(run.group), methods.index(run.method)))


# unit, which is better, how it is read, heading in the table ("": not there), form of the number
Metric = tuple[str, Direction, Callable[[RunResult], float | None], str, str]


def _quality(
    name: str, heading: str = "", form: str = "{:.3f}", unit: str = "1", *, lower: bool = False
) -> Metric:
    return unit, "lower" if lower else "higher", lambda run: run.figures.get(name), heading, form


METRICS: dict[str, Metric] = {
    "seconds": ("s", "lower", lambda run: run.seconds, "s", "{:.1f}"),
    CPU_SECONDS: ("s", "lower", lambda run: run.cpu_seconds, "CPU s", "{:.1f}"),
    "held-out PSNR": _quality("psnr", "PSNR", "{:.2f}", "dB"),
    "held-out PSNR in mask": _quality("psnr_mask", "in mask", "{:.2f}", "dB"),
    "held-out PSNR, 2 px tolerated": _quality("psnr_shift", "+-2 px", "{:.2f}", "dB"),
    "held-out SSIM": _quality("ssim", "SSIM"),
    "held-out FLIP": _quality("flip", "FLIP", "{:.4f}", lower=True),
    "held-out LPIPS": _quality("lpips", lower=True),
    "held-out outline IoU": _quality("silhouette_iou", "outline"),
    "held-out lines F1": _quality("ink_f1", "lines", "{:.2f}"),
    "held-out label accuracy": _quality("label_accuracy", "labels"),
    "held-out label mIoU": _quality("label_miou"),
    "held-out palette PSNR": _quality("palette_psnr", "pal. PSNR", "{:.2f}", "dB"),
    "held-out palette PSNR in mask": _quality("palette_psnr_mask", unit="dB"),
    "held-out palette FLIP": _quality("palette_flip", "pal. FLIP", "{:.4f}", lower=True),
    "parameters": ("1", "lower", lambda run: run.parameters or None, "", ""),
    "model size": ("kB", "lower", lambda run: run.model_bytes / 1000 or None, "kB", "{:.0f}"),
}
COLUMNS = tuple(
    Column(metric, heading, form, "value" if unit in ("s", "kB") else "mean")
    for metric, (unit, _, _, heading, form) in METRICS.items()
    if heading
)
