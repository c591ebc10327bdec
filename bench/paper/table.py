"""The paper's Table 1: palettes and iterations of the plain method, and how soon it is outdone."""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.charts.chart import DEFAULT
from bench.records.record import aligned
from bench.train.plan import METHODS, PAPER
from bench.train.run import RunResult, reached
from toonset.nerf.options import USUAL_STEPS

METRICS = ("psnr", "ssim", "flip", "lpips")
LOWER = ("flip", "lpips")  # are errors
BEFORE, AFTER = "field", "classifier"  # a view as the field has it, and in palette colours
FORMS = {"psnr": "{:.2f}", "ssim": "{:.3f}", "flip": "{:.4f}", "lpips": "{:.3f}"}


def paper_rows(runs: Sequence[RunResult]) -> list[dict[str, Any]]:
    """Return the table: a row per condition, method and layer.

    Figures are means over the characters, of every one the mean over its seeds and held-out views;
    seconds are medians. The default's rows come last. A metric that this machine lacks is None.
    """
    rows = []
    runs = [run for run in runs if not run.note]
    keys = itertools.product(dict.fromkeys(run.group for run in runs), (*PAPER, DEFAULT))
    for group, method in keys:
        found = [run for run in runs if (run.group, run.method) == (group, method)]
        options = METHODS[method].options
        for layer, prefix in ((BEFORE, ""), (AFTER, "palette_")):
            if not found or options is None or f"{prefix}psnr" not in found[0].figures:
                continue
            row: dict[str, Any] = {
                "condition": group,
                "method": "paper" if method in PAPER else method,
                "palette": METHODS[method].palette,
                "iterations": options.steps or USUAL_STEPS,
                "layer": layer,
                "n": len({run.case for run in found}),
                "trainings": len(found),
            }
            row |= {name: _mean(found, f"{prefix}{name}") for name in METRICS}
            row["seconds"] = float(np.median([run.seconds for run in found]))
            row["cpu_seconds"] = float(np.median([run.cpu_seconds for run in found]))
            rows.append(row)
    return rows


def as_csv(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as CSV; what there is no figure for is empty."""
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue()


def as_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as a table for people, condition by condition; n is of characters."""
    heading = ("method", "palette", "iterations", "layer", "n", "trainings", *METRICS, "CPU s")
    lines: list[str] = []
    for condition, own in itertools.groupby(rows, key=lambda row: row["condition"]):
        cells: list[tuple[str, ...]] = [heading]
        for row in own:
            figures = ["-" if row[m] is None else FORMS[m].format(row[m]) for m in METRICS]
            first = [str(row[name]) for name in heading[:6]]
            cells.append((*first, *figures, f"{row['cpu_seconds']:.1f}"))
        lines += ["", condition, *aligned(cells, words=4)]
    return "\n".join(lines[1:])


def outdone(runs: Sequence[RunResult]) -> list[dict[str, Any]]:
    """Return when followed defaults pass the plain method's end for good, and at what share.

    `share` is of the plain method's processor seconds; None where the default does not pass it.
    PSNR is that of the curves: of some of the held-out views.
    """
    last = [name for name in PAPER if METHODS[name].palette == "automatic palette"][-1]
    followed = {
        (run.group, run.case, run.seed): run
        for run in runs
        if run.method == DEFAULT and len(run.curve) > 1
    }
    found = []
    for slow in (run for run in runs if run.method == last and not run.note):
        fast = followed.get((slow.group, slow.case, slow.seed))
        if fast is None:
            continue
        goal = slow.curve[-1].psnr
        passed = reached(fast.curve, goal)
        cpu = None if passed is None else passed.cpu_seconds
        found.append(
            {
                "case": slow.case,
                "group": slow.group,
                "paper": {"psnr": goal, "cpu_seconds": slow.cpu_seconds},
                "default": {"psnr": fast.curve[-1].psnr, "cpu_seconds": fast.cpu_seconds},
                "passed_after_cpu_s": cpu,
                "share": None if cpu is None else cpu / slow.cpu_seconds,
            }
        )
    return found


def outdone_text(entry: dict[str, Any]) -> str:
    """Return an entry of `outdone` as a line."""
    slow, fast, share = entry["paper"], entry["default"], entry["share"]
    end = (
        f"{entry['case']}, {entry['group']}: the paper's method ends at {slow['psnr']:.2f} dB "
        f"after {slow['cpu_seconds']:.0f} CPU s; the default "
    )
    if share is None:
        return f"{end}does not get there ({fast['psnr']:.2f} dB)"
    return (
        f"{end}passes that after {entry['passed_after_cpu_s']:.1f} CPU s (1/{1 / share:.0f}) and "
        f"ends at {fast['psnr']:.2f} dB after {fast['cpu_seconds']:.0f}"
    )


def _mean(runs: Sequence[RunResult], name: str) -> float | None:
    """Return the mean over the cases of the means over their seeds."""
    by_case: dict[str, list[float]] = {}
    for run in runs:
        value = run.figures.get(name)
        if value is not None:
            by_case.setdefault(run.case, []).append(value)
    return float(np.mean([np.mean(values) for values in by_case.values()])) if by_case else None
