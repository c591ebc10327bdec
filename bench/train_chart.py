"""Held-out PSNR against seconds of training: a panel per condition, a curve per method."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from toonset.bench.chart import COLORS, DEFAULT, SHOWN
from toonset.bench.train import in_order
from toonset.bench.train_plan import METHODS, NEAREST
from toonset.bench.train_run import RunResult, Seen

COLUMNS = 3
POINTS = 64  # of a mean curve
LEAST_S = 0.1  # left end of the time axis, for what takes none


def draw_curves(runs: Sequence[RunResult], caption: str) -> bytes:
    """Return the figure as PNG: mean curves over cases and seeds, and where each method ends.

    At least one of the runs must have succeeded.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    panels = [list(found) for _, found in groupby(in_order(runs), key=lambda run: run.group)]
    columns = min(COLUMNS, len(panels))
    lines = math.ceil(len(panels) / columns)
    size = (4.4 * columns + 1.8, 3.4 * lines + 0.4)
    figure, axes = plt.subplots(
        lines, columns, figsize=size, dpi=110, layout="constrained", squeeze=False
    )
    for place, panel in zip(axes.ravel(), panels, strict=False):
        _draw_panel(place, panel)
    for place in axes.ravel()[len(panels) :]:
        place.set_axis_off()
    shown = [name for name in METHODS if any(run.method == name for run in runs)]
    handles = [_handle(name) for name in shown]
    figure.legend(handles=handles, loc="outside right upper", fontsize=8, frameon=False)
    figure.supxlabel(f"seconds of training, without imports\n{caption}", fontsize=8)
    figure.supylabel("held-out PSNR, dB", fontsize=9)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()


def mean_curve(curves: Sequence[Sequence[Seen]]) -> list[tuple[float, float]]:
    """Return the mean of curves from where the last of them has begun to where the last one ends.

    Between its points a curve is straight over the logarithm of time; past its end it stays.
    """
    first = max(max(curve[0].seconds, LEAST_S) for curve in curves)
    last = max(max(curve[-1].seconds, LEAST_S) for curve in curves)
    at = np.geomspace(first, last, POINTS) if last > first else np.array([first])
    each = []
    for curve in curves:
        seconds = np.log([max(seen.seconds, LEAST_S) for seen in curve])
        each.append(np.interp(np.log(at), seconds, [seen.psnr for seen in curve]))
    return list(zip(at.tolist(), np.mean(each, axis=0).tolist(), strict=True))


def _draw_panel(axes: Any, runs: Sequence[RunResult]) -> None:
    from matplotlib.ticker import LogFormatter

    for method, listed in groupby(runs, key=lambda run: run.method):
        found = list(listed)
        color, marker, width = _look(method)
        psnr = float(np.mean([run.curve[-1].psnr for run in found]))
        if method == NEAREST:
            axes.axhline(psnr, color=color, lw=1, ls=":")
            continue
        if all(len(run.curve) > 1 for run in found):
            at, values = zip(*mean_curve([run.curve for run in found]), strict=True)
            axes.plot(at, values, color=color, lw=width, alpha=0.8)
        end = max(float(np.median([run.seconds for run in found])), LEAST_S)
        axes.scatter(end, psnr, color=color, marker=marker, s=30, zorder=3)
    cases = len({run.case for run in runs})
    seeds = len({run.seed for run in runs})
    axes.set_title(f"{runs[0].group}; {cases} cases, {seeds} seeds", loc="left", fontsize=9)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False, minor_thresholds=(1, 0.4)))
    axes.tick_params(labelsize=8, which="both")
    axes.grid(True, which="both", alpha=0.25)


def _handle(method: str) -> Any:
    from matplotlib.lines import Line2D

    color, marker, width = _look(method)
    if method == NEAREST:
        return Line2D([], [], color=color, lw=1, ls=":", label=method)
    return Line2D([], [], color=color, marker=marker, lw=width, label=method)


def _look(method: str) -> tuple[str, str, float]:
    number = list(METHODS).index(method)
    width = 2.4 if method == DEFAULT else 1.2
    return COLORS[number % len(COLORS)], SHOWN[(number * 3 + number // 8) % len(SHOWN)], width
