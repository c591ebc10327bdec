"""The stability sweeps as one picture: a panel per sweep, success, error and verdicts by step."""

from __future__ import annotations

import io
import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.charts.chart import COLORS
from bench.stability.sweeps import SWEEPS
from bench.stability.table import SOLVED_DEG, WRONG_DEG, Row

COLUMNS = 3
LEGEND_COLUMNS = (2, 4, 6)  # by the columns of panels: what is as wide as they are
ROW_HEIGHTS = (1.0, 1.0, 0.55)  # share solved, error, verdicts
BLUE, VERMILION, GREEN, _, ORANGE, SKY, BLACK, GREY = COLORS
VERDICTS = {"ok": GREEN, "weak": ORANGE, "ambiguous": SKY, "failed": VERMILION, "crashed": BLACK}
LEAST_ERROR_DEG, MOST_ERROR_DEG = 0.01, 180.0


def draw_stability(rows: Sequence[Row], caption: str) -> bytes:
    """Return the picture as PNG; sweeps in the order of their rows."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    panels = [list(group) for _, group in itertools.groupby(rows, key=lambda row: row.sweep)]
    columns = min(COLUMNS, len(panels))
    lines = math.ceil(len(panels) / columns)
    figure = plt.figure(figsize=(4.6 * columns, 3.3 * lines + 0.8), dpi=100, layout="constrained")
    frames = figure.subfigures(lines, columns, squeeze=False, wspace=0.03, hspace=0.03)
    for frame, panel in zip(frames.ravel(), panels, strict=False):  # the last row may have room
        _draw_panel(frame, panel)
    figure.legend(
        handles=_legend(),
        loc="outside upper center",
        ncols=LEGEND_COLUMNS[columns - 1],
        fontsize=8,
        frameon=False,
    )
    figure.supxlabel(caption, fontsize=8, color="#555555")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()


def _draw_panel(frame: Any, rows: Sequence[Row]) -> None:
    share, error, verdicts = frame.subplots(3, 1, sharex=True, height_ratios=ROW_HEIGHTS)
    at = np.arange(len(rows))
    share.plot(at, [100 * r.solved_modulo_twin for r in rows], "o-", color=BLUE, ms=5)
    share.plot(at, [100 * r.solved for r in rows], "s--", color=VERMILION, ms=4, mfc="white")
    share.set(ylim=(-6, 106), yticks=(0, 50, 100))
    share.set_ylabel("solved, %", fontsize=8)
    share.set_title(rows[0].sweep, loc="left", fontsize=10, fontweight="bold")
    median = np.clip([r.median_deg for r in rows], LEAST_ERROR_DEG, MOST_ERROR_DEG)
    tail = np.clip([r.p95_deg for r in rows], LEAST_ERROR_DEG, MOST_ERROR_DEG)
    error.vlines(at, median, tail, color=GREY, lw=3)
    error.plot(at, median, "D-", color=BLACK, ms=4)
    for bound in (SOLVED_DEG, WRONG_DEG):
        error.axhline(bound, color=GREY, lw=0.8, ls=":")
    error.set(yscale="log", ylim=(LEAST_ERROR_DEG, MOST_ERROR_DEG), yticks=(0.01, 0.1, 1, 10, 100))
    error.set_yticklabels(("", "0.1", "1", "10", "100"))
    error.minorticks_off()
    error.set_ylabel("error, °", fontsize=8)
    _draw_verdicts(verdicts, rows)
    verdicts.set_xticks(at, [r.step for r in rows])
    verdicts.set_xlabel(_axis(rows[0].sweep), fontsize=8)
    for axes in (share, error, verdicts):
        axes.tick_params(labelsize=8)
        axes.grid(axis="y", alpha=0.25)


def _draw_verdicts(axes: Any, rows: Sequence[Row]) -> None:
    """Stack the verdicts' shares; write how many views are wrong without a word of it."""
    at, below = np.arange(len(rows)), np.zeros(len(rows))
    for name, color in VERDICTS.items():
        shares = np.array([100 * getattr(r, name) / r.views for r in rows])
        axes.bar(at, shares, bottom=below, width=0.9, color=color)
        below += shares
    for i, r in enumerate(rows):
        if r.silent_wrong:
            axes.text(i, 50, f"{r.silent_wrong}!", ha="center", va="center", weight="bold")
    if not below.any():
        axes.text(at.mean(), 50, "alignment only: no verdict", ha="center", va="center", fontsize=8)
    axes.set(ylim=(0, 100), yticks=(0, 100))
    axes.set_ylabel("verdict, %", fontsize=8)


def _axis(sweep: str) -> str:
    return next(known.axis for known in SWEEPS if known.name == sweep)


def _legend() -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    return [
        Line2D([], [], color=BLUE, marker="o", label="within 5° of truth or mirror twin"),
        Line2D([], [], color=VERMILION, marker="s", ls="--", mfc="white", label="within 5°"),
        Line2D([], [], color=BLACK, marker="D", label="median error modulo twin"),
        Line2D([], [], color=GREY, lw=3, label="to its 95th percentile"),
        Line2D([], [], color=GREY, lw=0.8, ls=":", label="5° (solved) and 15° (wrong)"),
        Line2D([], [], ls="", marker="$3!$", color=BLACK, ms=11, label="wrong views called ok"),
        *(Patch(color=color, label=name) for name, color in VERDICTS.items()),
    ]
