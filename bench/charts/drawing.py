"""A chart as a figure: the default a star, the front blue, what is beaten grey, names beside."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, cast

from bench.charts.chart import Chart
from bench.charts.figure import DARK, DPI, LIGHT, Form, figure_bytes, log_ticks, new_figure
from bench.charts.labels import Box, Label, needs_leader, place_labels
from bench.records.pareto import DEFAULT, Point, quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
    from matplotlib.figure import Figure

ON_FRONT, MARKED, BEATEN = "#0072B2", "#D55E00", "#7d7d7d"
SIZE_IN = 9.0, 6.0
AREA, MOST_AREA = 45.0, 200.0  # of markers, in square points
STAR = 3.4  # a star's area over that of a disc that looks as large
CAPTION_WIDTH = 150  # characters
PAD = 0.06  # of an axis' length, beyond the points
LEAST_RATIO = 3.0  # of the ends of a logarithmic axis
FEW = 8  # methods, up to which names have their figure beside them
POINTS_PER_INCH = 72


def draw_chart(chart: Chart, form: Form = "png") -> bytes:
    """Return the chart as a file."""
    return figure_bytes(chart_figure(chart), form)


def chart_figure(chart: Chart) -> Figure:
    """Return the chart as a figure; names of methods are annotations with their method as gid."""
    figure = new_figure(*SIZE_IN)
    axes = figure.add_subplot()
    axes.set_title(chart.headline, loc="left", fontsize=13, fontweight="bold", pad=26)
    told = f"python -m bench {chart.subject}: {chart.group}"
    axes.text(0, 1.02, told, transform=axes.transAxes, fontsize=9.5, color=DARK, va="bottom")
    _set_scales(axes, chart)
    for point in chart.points:
        _draw_point(axes, point, chart)
    corners = _stairs(axes, chart)
    axes.plot([x for x, _ in corners], [y for _, y in corners], color=ON_FRONT, lw=2, alpha=0.45)
    lines = [textwrap.fill(note, CAPTION_WIDTH) for note in chart.notes]
    figure.supxlabel("\n".join(lines), x=0.01, ha="left", fontsize=7.5, color=DARK)
    _write_names(figure, axes, chart)
    return figure


def _set_scales(axes: Axes, chart: Chart) -> None:
    paid = [p for p in chart.points if p.cost > 0] or list(chart.points)
    merits = [value for p in paid for value in (p.merit, p.spread)]
    if chart.lower_is_better and all(p.merit > 0 for p in chart.points):
        axes.set_yscale("log")
        low, high = _log_range([*merits, *(p.merit for p in chart.points)])
        log_ticks(axes.yaxis, low, high)
    else:
        margin = max((max(merits) - min(merits)) * PAD, 0.01 * abs(max(merits)), 1e-3)
        low, high = min(merits) - margin, max(merits) + margin
    axes.set_ylim(low, high)
    axes.set_xscale("log")
    left, right = _log_range([p.cost for p in paid if p.cost > 0] or [1.0])
    axes.set_xlim(left, right)
    log_ticks(axes.xaxis, left, right)
    axes.set_xlabel(f"{chart.cost}, logarithmic", fontsize=9.5)
    better = "lower" if chart.lower_is_better else "higher"
    unit = f", {chart.unit}" if chart.unit else ""
    axes.set_ylabel(f"{chart.merit}{unit} ({better} is better)", fontsize=9.5)
    axes.tick_params(labelsize=9)
    axes.grid(True, color=LIGHT, lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _log_range(values: Sequence[float]) -> tuple[float, float]:
    """Return a range with room about the values: what differs by a hair must not look far apart."""
    low, high = min(values), max(values)
    factor = max((high / low) ** PAD, 1.1, (LEAST_RATIO * low / high) ** 0.5)
    return low / factor, high * factor


def _look(point: Point, chart: Chart) -> tuple[str, str, float]:
    """Return colour, marker and area of a point."""
    on_front = any(point is p for p in chart.front)
    known = [p.parameters for p in chart.points if p.parameters is not None]
    area, marker = AREA, "o"
    if known:
        marker = "o" if point.parameters is not None else "X"
        area = max(MOST_AREA * (point.parameters or 0) / max(known), AREA / 3)
    if point.method == DEFAULT:
        return MARKED, "*", max(area, AREA) * STAR
    return ON_FRONT if on_front else BEATEN, marker, area


def _draw_point(axes: Axes, point: Point, chart: Chart) -> None:
    color, marker, area = _look(point, chart)
    if point.cost <= 0:
        axes.axhline(point.merit, color=color, lw=1.2, ls=(0, (1, 2)), zorder=1)
        return
    low, high = sorted((point.merit, point.spread))
    axes.vlines(point.cost, low, high, color=color, lw=1, alpha=0.35, zorder=1.5)
    axes.scatter(
        [point.cost],
        [point.merit],
        s=area,
        marker=marker,
        facecolor="white" if point.aside else color,
        edgecolor=color if point.aside else "white",
        linewidth=1.3 if point.aside else 0.7,
        zorder=4 if point.method == DEFAULT else 3,
    )


def _stairs(axes: Axes, chart: Chart) -> list[tuple[float, float]]:
    """Return the corners of the front: how good one gets for a cost, to the right end."""
    paid = [p for p in chart.front if p.cost > 0]
    corners = [(p.cost, p.merit) for p in paid[:1]]
    for before, after in pairwise(paid):
        corners += [(after.cost, before.merit), (after.cost, after.merit)]
    return [*corners, *((axes.get_xlim()[1], p.merit) for p in paid[-1:])]


def _write_names(figure: Figure, axes: Axes, chart: Chart) -> None:
    """Write every method's name beside its point, the default's and the front's first."""
    canvas = cast("FigureCanvasAgg", figure.canvas)
    canvas.draw()  # lays out: from here on the axes keep their place
    figure.set_layout_engine("none")
    renderer = canvas.get_renderer()
    window = axes.get_window_extent(renderer)
    room = Box(window.x0 + 3, window.y0 + 3, window.x1, window.y1)
    free = [_write_baseline(axes, p, chart, renderer) for p in chart.points if p.cost <= 0]
    paid = sorted((p for p in chart.points if p.cost > 0), key=lambda p: _rank(p, chart))
    labels = [_label(axes, p, chart, renderer) for p in paid]
    boxes = place_labels(labels, room, taken=free, lines=_lines(axes, chart))
    for point, label, box in zip(paid, labels, boxes, strict=True):
        _write_name(axes, point, chart, label, box)


def _rank(point: Point, chart: Chart) -> int:
    if point.method == DEFAULT:
        return 0
    return 1 if any(point is p for p in chart.front) else 2


def _style(point: Point, chart: Chart) -> dict[str, Any]:
    """Return how a point's name is written."""
    color = _look(point, chart)[0]
    if point.method == DEFAULT:
        return {"fontsize": 12, "fontweight": "bold", "color": color}
    return {"fontsize": 9, "color": color if _rank(point, chart) == 1 else DARK}


def _name(point: Point, chart: Chart) -> str:
    figure = f"  {quantity(point.merit, '')}" if len(chart.points) <= FEW else ""
    return f"{point.method}{figure}"


def _label(axes: Axes, point: Point, chart: Chart, renderer: RendererAgg) -> Label:
    measured = axes.text(0, 0, _name(point, chart), **_style(point, chart))
    extent = measured.get_window_extent(renderer)
    measured.remove()
    x, y = axes.transData.transform((point.cost, point.merit))
    radius = math.sqrt(_look(point, chart)[2] / math.pi) * DPI / POINTS_PER_INCH
    return Label(float(x), float(y), radius, extent.width + 2, extent.height)


def _write_name(axes: Axes, point: Point, chart: Chart, label: Label, box: Box) -> None:
    x, y = box.nearest(label.x, label.y)
    pt = POINTS_PER_INCH / DPI  # of a pixel
    leader = {
        "arrowstyle": "-",
        "color": BEATEN,
        "lw": 0.6,
        "shrinkA": 0,
        "shrinkB": label.radius * pt,
        "relpos": ((x - box.left) / label.width, (y - box.bottom) / label.height),
    }
    written = axes.annotate(
        _name(point, chart),
        (point.cost, point.merit),
        ((box.left - label.x) * pt, (box.bottom - label.y) * pt),
        textcoords="offset points",
        va="bottom",
        arrowprops=leader if needs_leader(label, box) else None,
        zorder=5,
        **_style(point, chart),
    )
    written.set_in_layout(False)


def _write_baseline(axes: Axes, point: Point, chart: Chart, renderer: RendererAgg) -> Box:
    """Write a name on the dotted line of what costs nothing, or at the edge it is beyond."""
    low, high = axes.get_ylim()
    beyond = "\N{DOWNWARDS ARROW} " if point.merit < low else ""
    beyond = "\N{UPWARDS ARROW} " if point.merit > high else beyond
    at = min(max(point.merit, low), high)
    written = axes.annotate(
        f"{beyond}{point.method}, at no cost: {quantity(point.merit, chart.unit)}",
        (1, at),
        (-4, -4 if at == high else 4),
        xycoords=axes.get_yaxis_transform(),
        textcoords="offset points",
        ha="right",
        va="top" if at == high else "bottom",
        **_style(point, chart),
    )
    written.set_in_layout(False)
    extent = written.get_window_extent(renderer)
    return Box(extent.x0, extent.y0, extent.x1, extent.y1)


def _lines(axes: Axes, chart: Chart) -> list[Box]:
    """Return the front's stairs and the whiskers in pixels."""
    whiskers = [((p.cost, p.merit), (p.cost, p.spread)) for p in chart.points if p.cost > 0]
    boxes = []
    for line in (*pairwise(_stairs(axes, chart)), *whiskers):
        (x0, y0), (x1, y1) = axes.transData.transform(line)
        boxes.append(Box(min(x0, x1) - 1, min(y0, y1) - 1, max(x0, x1) + 1, max(y0, y1) + 1))
    return boxes
