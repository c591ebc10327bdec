"""Palette minus no palette as a figure: a panel per metric, a dot and interval per comparison."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bench.charts.chart import COLORS
from bench.charts.figure import DARK, LIGHT, Form, figure_bytes, new_figure
from bench.paper.difference import NAMES, SAID, Difference, word
from bench.paper.table import BEFORE, LOWER

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOR = {"automatic palette": COLORS[0], "hand-picked palette": COLORS[1]}
GREY = "#999999"
BELOW = 0.3  # of a row
WIDE_IN, ROW_IN, NAMES_IN, REST_IN = 2.6, 0.42, 2.6, 1.4


def draw_differences(differences: Sequence[Difference], caption: str, form: Form = "png") -> bytes:
    """Return the figure of one condition as a file.

    Args:
        differences: of one condition; one at least.
        caption: what was measured on.
        form: PNG or SVG.
    """
    metrics = list(dict.fromkeys(d.metric for d in differences))
    rows = list(dict.fromkeys(map(_row, differences)))
    figure = new_figure(NAMES_IN + WIDE_IN * len(metrics), REST_IN + ROW_IN * len(rows))
    panels = figure.subplots(1, len(metrics), sharey=True, squeeze=False)[0]
    for axes, metric in zip(panels, metrics, strict=True):
        axes.axvline(0, color=DARK, lw=1)
        for d in (d for d in differences if d.metric == metric):
            _draw(axes, d, rows.index(_row(d)))
        unit = ", dB" if metric == "psnr" else ""
        better = "lower" if metric in LOWER else "higher"
        axes.set_xlabel(f"{NAMES[metric]}{unit} ({better} is better)", fontsize=9)
        axes.grid(True, axis="x", color=LIGHT, lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.tick_params(labelsize=8.5, left=False)
        axes.locator_params(axis="x", nbins=5)
    panels[0].set_yticks(range(len(rows)), [_name(row, differences) for row in rows])
    panels[0].set_ylim(len(rows) - 0.5, -0.5)  # the first on top
    figure.suptitle("Palette minus no palette", x=0.01, ha="left", fontsize=12, fontweight="bold")
    figure.supxlabel(
        f"Dot and bar: mean over the characters and its 95 % interval (Student's t); grey: a "
        f"character, mean over its seeds.\n{caption}",
        fontsize=8.5,
        color=DARK,
    )
    return figure_bytes(figure, form)


def _row(d: Difference) -> tuple[str, int, str]:
    return d.layer, d.iterations, d.palette


def _name(row: tuple[str, int, str], differences: Sequence[Difference]) -> str:
    layer, iterations, palette = row
    n = max(d.n for d in differences if _row(d) == row)
    return f"{word(palette)}, {iterations:,} iterations,\n{SAID[layer]} (n = {n})"


def _draw(axes: Axes, d: Difference, y: int) -> None:
    color, before = COLOR[d.palette], d.layer == BEFORE
    each = list(d.by_case.values())
    axes.scatter(each, [y + BELOW] * d.n, s=14, color=GREY, lw=0, alpha=0.8, zorder=2)
    if d.interval is not None:
        axes.hlines(y, *d.interval, color=color, lw=2.2, zorder=3)
    axes.scatter(
        d.mean, y, s=42, zorder=4, edgecolor=color, facecolor=color if before else "white", lw=1.6
    )
