"""Figures of the calibration sweeps: one row per step, as CSV and records."""

from __future__ import annotations

import csv
import io
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields, replace

import numpy as np

from bench.records.record import Record, summarise
from bench.stability.steps import NO_VERDICT, StepResult

SOLVED_DEG = 5.0
WRONG_DEG = 15.0


@dataclass(frozen=True)
class Row:
    """One step in figures; the fields are the columns of stability.csv.

    Attributes:
        sweep: what changes.
        step: how much.
        sheets: drawn for it.
        views: of all sheets.
        solved_modulo_twin: share of views within 5 degrees of the truth or of its mirror twin.
        solved: share of views within 5 degrees of the truth.
        median_deg: of the error modulo twin.
        p95_deg: of the error modulo twin.
        median_raw_deg: of the error.
        p95_raw_deg: of the error.
        ok: views with this verdict; alignments alone have none.
        weak: views with this verdict.
        ambiguous: views with this verdict.
        failed: views with this verdict, refused sheets among them (they count as 180 degrees).
        crashed: views of sheets that ended in an exception (they count as 180 degrees).
        wrong: views more than 15 degrees off.
        silent_wrong: wrong views that are called ok.
        announced: share of wrong views that are not called ok; None without wrong views.
        false_alarms: solved views that are not called ok.
    """

    sweep: str
    step: str
    sheets: int
    views: int
    solved_modulo_twin: float
    solved: float
    median_deg: float
    p95_deg: float
    median_raw_deg: float
    p95_raw_deg: float
    ok: int
    weak: int
    ambiguous: int
    failed: int
    crashed: int
    wrong: int
    silent_wrong: int
    announced: float | None
    false_alarms: int


def row(result: StepResult) -> Row:
    """Return the figures of one step."""
    views = [view for sheet in result.sheets for view in sheet.views]
    raw = np.degrees([view.raw for view in views])
    modulo = np.degrees([view.modulo_twin for view in views])
    verdicts = Counter(view.verdict for view in views)
    ok = np.array([view.verdict == "ok" for view in views])
    judged = np.array([view.verdict != NO_VERDICT for view in views])
    wrong = raw > WRONG_DEG
    announced = float((~ok[wrong & judged]).mean()) if (wrong & judged).any() else None
    return Row(
        sweep=result.sweep,
        step=result.step,
        sheets=len(result.sheets),
        views=len(views),
        solved_modulo_twin=float((modulo < SOLVED_DEG).mean()),
        solved=float((raw < SOLVED_DEG).mean()),
        median_deg=float(np.median(modulo)),
        p95_deg=float(np.percentile(modulo, 95)),
        median_raw_deg=float(np.median(raw)),
        p95_raw_deg=float(np.percentile(raw, 95)),
        ok=verdicts["ok"],
        weak=verdicts["weak"],
        ambiguous=verdicts["ambiguous"],
        failed=verdicts["failed"],
        crashed=verdicts["crashed"],
        wrong=int(wrong.sum()),
        silent_wrong=int((wrong & ok).sum()),
        announced=announced,
        false_alarms=int(((raw < SOLVED_DEG) & judged & ~ok).sum()),
    )


def as_csv(rows: Sequence[Row], seed: int) -> bytes:
    """Return the rows as CSV with a column for the seed; the same results give the same bytes."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*(field.name for field in fields(Row)), "seed"])
    for item in rows:
        writer.writerow([*map(_cell, astuple(item)), seed])
    return text.getvalue().encode()


def as_records(results: Sequence[StepResult], seed: int) -> list[Record]:
    """Return errors, silent errors and seconds of every step in the records' common form."""
    return [record for result in results for record in _records(result, seed)]


def _records(result: StepResult, seed: int) -> list[Record]:
    views = [view for sheet in result.sheets for view in sheet.views]
    silent = [view.verdict == "ok" and view.raw > math.radians(WRONG_DEG) for view in views]
    total = float(sum(silent))

    def one(metric: str, samples: Sequence[float], unit: str) -> Record:
        return summarise(
            samples,
            method=result.step,
            metric=metric,
            unit=unit,
            direction="lower",
            seed=seed,
            group=result.sweep,
        )

    return [
        one("rotation error", [math.degrees(view.raw) for view in views], "deg"),
        one("rotation error modulo twin", [math.degrees(v.modulo_twin) for v in views], "deg"),
        replace(one("wrong but ok", silent, "views"), value=total, median=total, p95=total),
        one("seconds", [sheet.seconds for sheet in result.sheets], "s"),
    ]


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.4f}" if isinstance(value, float) else str(value)
