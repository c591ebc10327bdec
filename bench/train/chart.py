"""Held-out PSNR against CPU seconds of training: a panel per condition, a curve per field.

Only methods whose trainings were followed have a curve; baselines are marks; what else was trained
is in the charts of cost against merit.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from bench.charts.chart import COLORS, DEFAULT, SHOWN
from bench.charts.figure import DARK, LIGHT, Form, figure_bytes, log_ticks, new_figure
from bench.train.measure import in_order
from bench.train.plan import MANNEQUIN, METHODS, NEAREST
from bench.train.run import RunResult, Seen

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

COLUMNS = 2
POINTS = 64  # of a mean curve
LEAST_S = 0.1  # left end of the time axis, for what takes none
BASELINES = {"coloured hull": "s", MANNEQUIN: "X"}  # marks of what is not followed
VERMILION, GREY = COLORS[1], "#666666"
*DISCS, STAR = SHOWN
FOLLOWED = (DEFAULT, *(m for m in METHODS if METHODS[m].curve and m != DEFAULT), *BASELINES)


def draw_curves(runs: Sequence[RunResult], caption: str, form: Form = "png") -> bytes:
    """Return the figure as a file: mean curves over n cases and the seeds, to where the last ends.

    At least one of the runs must have succeeded.
    """
    panels = _panels(in_order(runs))
    columns = min(COLUMNS, len(panels))
    lines = math.ceil(len(panels) / columns)
    figure = new_figure(4.6 * columns + 2.8, 3.6 * lines + 0.6)
    places = figure.subplots(lines, columns, squeeze=False).ravel()
    for place, panel in zip(places, panels, strict=False):
        _draw_panel(place, panel)
    for place in places[len(panels) :]:
        place.set_axis_off()
    names = (*FOLLOWED, *_peers(runs), NEAREST)
    cases = {m: {r.case for p in panels for r in p if r.method == m} for m in names}
    figure.legend(
        handles=[_handle(method, len(own)) for method, own in cases.items() if own],
        loc="outside right upper",
        fontsize=9,
        frameon=False,
    )
    figure.supxlabel(
        f"CPU seconds of training, without imports; logarithmic\n{caption}",
        fontsize=8.5,
        color=DARK,
    )
    figure.supylabel("held-out PSNR, dB (higher is better)", fontsize=9.5)
    return figure_bytes(figure, form)


def _peers(runs: Sequence[RunResult]) -> list[str]:
    """Return the other programs' names."""
    return list(dict.fromkeys(run.method for run in runs if run.method not in METHODS))


def _panels(runs: Sequence[RunResult]) -> list[list[RunResult]]:
    """Return the runs of each condition that has curves; of all conditions if none has any."""
    panels = [list(found) for _, found in groupby(runs, key=lambda run: run.group)]
    followed = [panel for panel in panels if any(len(run.curve) > 1 for run in panel)]
    return followed or panels


def mean_curve(curves: Sequence[Sequence[Seen]]) -> list[tuple[float, float]]:
    """Return the mean of curves from where the last of them has begun to where the last one ends.

    Between its points a curve is straight over the logarithm of time; past its end it stays.
    """
    first = max(max(curve[0].cpu_seconds, LEAST_S) for curve in curves)
    last = max(max(curve[-1].cpu_seconds, LEAST_S) for curve in curves)
    at = np.geomspace(first, last, POINTS) if last > first else np.array([first])
    each = []
    for curve in curves:
        seconds = np.log([max(seen.cpu_seconds, LEAST_S) for seen in curve])
        each.append(np.interp(np.log(at), seconds, [seen.psnr for seen in curve]))
    return list(zip(at.tolist(), np.mean(each, axis=0).tolist(), strict=True))


def _draw_panel(axes: Axes, runs: Sequence[RunResult]) -> None:
    ends = [LEAST_S]
    for method in (*FOLLOWED, *_peers(runs), NEAREST):
        found = [run for run in runs if run.method == method]
        if not found:
            continue
        psnr = float(np.mean([run.curve[-1].psnr for run in found]))
        color, marker, width = _look(method)
        if method == NEAREST:
            axes.axhline(psnr, color=color, lw=1.2, ls=":")
            continue
        if all(len(run.curve) > 1 for run in found):
            at, values = zip(*mean_curve([run.curve for run in found]), strict=True)
            axes.plot(at, values, color=color, lw=width, zorder=3 if method == DEFAULT else 2)
            ends += [at[0], at[-1]]
        else:
            ends.append(max(float(np.median([run.cpu_seconds for run in found])), LEAST_S))
        axes.scatter(ends[-1], psnr, color=color, marker=marker, s=40 * width, zorder=4)
    axes.set_title(runs[0].group, loc="left", fontsize=10, fontweight="bold")
    axes.set_xscale("log")
    left, right = min(ends[1:], default=LEAST_S) / 1.3, max(ends) * 1.3
    axes.set_xlim(left, right)
    log_ticks(axes.xaxis, left, right)
    axes.tick_params(labelsize=8.5)
    axes.grid(True, color=LIGHT, lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _handle(method: str, cases: int) -> Line2D:
    from matplotlib.lines import Line2D

    color, marker, width = _look(method)
    if method == NEAREST:
        return Line2D([], [], color=color, lw=1.2, ls=":", label=f"{method}, at no cost")
    line, name = (
        "none" if method in BASELINES or method not in METHODS else "-",
        f"{method} (n = {cases})",
    )
    return Line2D([], [], color=color, marker=marker, lw=width, ls=line, label=name)


def _look(method: str) -> tuple[str, str, float]:
    """Return colour, marker and line width; the default's are those of the charts."""
    if method == DEFAULT:
        return VERMILION, STAR, 2.6
    if method == NEAREST or method in BASELINES:
        return GREY, BASELINES.get(method, ""), 1.2
    if method not in METHODS:
        return COLORS[6], DISCS[zlib.crc32(method.encode()) % len(DISCS)], 1.2
    number = FOLLOWED.index(method) - 1
    others = [color for color in COLORS if color != VERMILION]
    return others[number % len(others)], DISCS[(number + number // len(others)) % len(DISCS)], 1.3
