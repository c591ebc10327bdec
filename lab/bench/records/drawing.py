"""All figures of the bench, by matplotlib: PNG to look at, SVG to print; the same bytes again."""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from lab.bench.records.chart import Chart, quantity
from lab.bench.records.record import DEFAULT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

Form = Literal["png", "svg"]
FORMS: tuple[Form, ...] = ("png", "svg")
DPI = 110
DARK, LIGHT = "#444444", "#dddddd"  # words beside the data; the grid
# Okabe and Ito's colours: distinguishable with colour-blind eyes
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
BLUE, VERMILION, GREEN, _, ORANGE, SKY, BLACK, GREY = COLORS
OTHERS = tuple(color for color in COLORS if color != VERMILION)  # than the default's
DISCS, STAR = ("o", "s", "^", "D", "v", "P", "X"), "*"
FEW = 5.0  # high over low, up to which ticks are evenly apart in value
CAPTION_WIDTH = 150  # characters
LEGEND: dict[str, Any] = {"loc": "outside right upper", "fontsize": 8, "frameon": False}
# text stays text, element names do not depend on the run, no date
DRAWN: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "toonset"}
WITHOUT_DATE: dict[Form, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
}


def new_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty figure that lays itself out."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def figure_bytes(figure: Figure, form: Form) -> bytes:
    """Return the figure as a file of this form."""
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context(DRAWN):
        figure.savefig(buffer, format=form, metadata=WITHOUT_DATE[form])
    return buffer.getvalue()


def style_of(method: str, methods: Sequence[str]) -> dict[str, Any]:
    """Return colour and marker of a method among the others of its figure."""
    if method == DEFAULT:
        return {"color": VERMILION, "marker": STAR}
    number = [name for name in methods if name != DEFAULT].index(method)
    row = number // len(OTHERS)
    return {"color": OTHERS[number % len(OTHERS)], "marker": DISCS[(number + row) % len(DISCS)]}


def draw_chart(chart: Chart, form: Form = "png") -> bytes:
    """Return cost against merit as a file: a mark per method, the front as stairs, a legend."""
    figure = new_figure(9.6, 5.6)
    axes = figure.add_subplot()
    axes.set_title(chart.headline, loc="left", fontsize=12, fontweight="bold", pad=22)
    told = f"python -m lab.bench {chart.subject}: {chart.group}"
    axes.text(0, 1.02, told, transform=axes.transAxes, fontsize=9, color=DARK)
    methods = [p.method for p in chart.points]
    for p in sorted(chart.points, key=lambda p: p.cost):
        style, label = style_of(p.method, methods), f"{p.method}  {quantity(p.merit, '')}"
        if p.cost <= 0:
            axes.axhline(p.merit, color=style["color"], lw=1.2, ls=":", label=f"{label}, no cost")
            continue
        low, high = sorted((p.merit, p.spread))
        axes.vlines(p.cost, low, high, color=style["color"], lw=1, alpha=0.35)
        size, face = 190 if p.method == DEFAULT else 50, "white" if p.aside else style["color"]
        marker, edge = style["marker"], style["color"]
        look: dict[str, Any] = {"s": size, "c": face, "marker": marker, "edgecolor": edge}
        axes.scatter([p.cost], [p.merit], **look, label=label, zorder=3)
    if all(p.merit > 0 for p in chart.points) and chart.lower_is_better:
        axes.set_yscale("log")
        log_ticks(axes.yaxis, *axes.get_ylim())
    if any(p.cost > 0 for p in chart.points):
        axes.set_xscale("log")
        log_ticks(axes.xaxis, *axes.get_xlim())
    _draw_front(axes, chart)
    axes.set_xlabel(f"{chart.cost}, logarithmic", fontsize=9.5)
    better = "lower" if chart.lower_is_better else "higher"
    unit = f", {chart.unit}" if chart.unit else ""
    axes.set_ylabel(f"{chart.merit}{unit} ({better} is better)", fontsize=9.5)
    _plain(axes)
    figure.legend(**LEGEND)
    caption = "\n".join(textwrap.fill(note, CAPTION_WIDTH) for note in chart.notes)
    figure.supxlabel(caption, x=0.01, ha="left", fontsize=7.5, color=DARK)
    return figure_bytes(figure, form)


def _draw_front(axes: Axes, chart: Chart) -> None:
    """Draw how good one gets for a cost, to the right end."""
    paid = [p for p in chart.front if p.cost > 0]
    corners = [(p.cost, p.merit) for p in paid[:1]]
    for before, after in pairwise(paid):
        corners += [(after.cost, before.merit), (after.cost, after.merit)]
    corners += [(axes.get_xlim()[1], p.merit) for p in paid[-1:]]
    axes.plot([x for x, _ in corners], [y for _, y in corners], color=BLUE, lw=2, alpha=0.4)


@dataclass(frozen=True)
class Panel:
    """One of several small charts: points (x, y) of every method; of what costs nothing x is 0.

    `ideal` is a level to compare with, if there is one.
    """

    title: str
    series: Mapping[str, Sequence[tuple[float, float]]]
    ideal: float | None = None


def draw_panels(
    panels: Sequence[Panel], axis: tuple[str, str], columns: int, form: Form = "png"
) -> bytes:
    """Return small charts side by side, with one legend.

    Args:
        panels: at least one.
        axis: what is across (logarithmic), with the caption, and what is upwards.
        columns: of panels.
        form: of the file.
    """
    columns = min(columns, len(panels))
    lines = math.ceil(len(panels) / columns)
    figure = new_figure(3.6 * columns + 2.6, 2.9 * lines + 0.8)
    places = figure.subplots(lines, columns, squeeze=False).ravel()
    methods = list(dict.fromkeys(name for panel in panels for name in panel.series))
    handles: dict[str, Any] = {}
    for axes, panel in zip(places, panels, strict=False):
        for method, points in panel.series.items():
            handles[method] = _draw_series(axes, points, style_of(method, methods))
        if panel.ideal is not None:
            axes.axhline(panel.ideal, color=DARK, lw=0.9, ls="--")
        axes.set_title(panel.title, loc="left", fontsize=9.5)
        axes.set_xscale("log")
        log_ticks(axes.xaxis, *axes.get_xlim())
        _plain(axes)
    for axes in places[len(panels) :]:
        axes.set_axis_off()
    figure.legend(list(handles.values()), list(handles), **LEGEND)
    figure.supxlabel(axis[0], fontsize=8.5, color=DARK)
    figure.supylabel(axis[1], fontsize=9)
    return figure_bytes(figure, form)


def _draw_series(axes: Axes, points: Sequence[tuple[float, float]], style: dict[str, Any]) -> Any:
    """Draw one method's points, and return what stands for it in a legend."""
    x, y = zip(*points, strict=True)
    if max(x) <= 0:
        return axes.axhline(y[-1], color=style["color"], lw=1.2, ls=":")
    wide = style["marker"] == STAR
    line: dict[str, Any] = {"lw": 2.4 if wide else 1.3, "markersize": 12 if wide else 6}
    return axes.plot(x, y, **style, **line, markevery=[-1], zorder=4 if wide else 3)[0]


@dataclass(frozen=True)
class Steps:
    """A page of a sweep: values of all trials by step, and what became of them.

    Attributes:
        title: the page's name.
        axis: what the steps are.
        names: of the steps.
        values: of each step's trials; the larger the worse.
        shares: of each step's trials, in the order of FATES.
        fine: the value below which all is well.
        failed: the value above which it is not.
        quantity: what a value is, with unit.
        logarithmic: whether values span powers of ten.
    """

    title: str
    axis: str
    names: Sequence[str]
    values: Sequence[Sequence[float]]
    shares: Sequence[Sequence[float]]
    fine: float
    failed: float
    quantity: str
    logarithmic: bool = False


FATES = {  # from the bottom: what became of a trial, and how it is drawn
    "fine, nothing said": (GREEN, ""),
    "fine, something said: false alarm": (ORANGE, "//"),
    "between fine and failed": (LIGHT, ""),
    "failed, announced": (SKY, ""),
    "failed, nothing said": (VERMILION, "xx"),
}
LOWEST, HIGHEST = 0.03, 240.0  # of a logarithmic value


def draw_steps(pages: Sequence[Steps], caption: str = "", form: Form = "png") -> bytes:
    """Return pages side by side: values over a bar of what became of the trials, per step."""
    columns = min(4, len(pages))
    lines = math.ceil(len(pages) / columns)
    figure = new_figure(4.4 * columns + 0.6, 3.4 * lines + 0.9)
    frames = figure.subfigures(lines, columns, squeeze=False, wspace=0.03, hspace=0.03)
    for frame, page in zip(frames.ravel(), pages, strict=False):
        values, shares = frame.subplots(2, 1, sharex=True, height_ratios=(1.6, 1))
        _draw_values(values, page)
        _draw_shares(shares, page)
        shares.set_xticks(range(len(page.names)), page.names)
        shares.set_xlabel(page.axis, fontsize=9)
        for axes in (values, shares):
            _plain(axes)
    handles, labels = frames.ravel()[0].axes[1].get_legend_handles_labels()
    place = {"loc": "outside upper left", "ncols": min(5, 2 * columns)}
    figure.legend(handles, labels, **LEGEND | place)
    told = f"Diamonds: medians; bars: to the 95th percentile. {caption}"
    figure.supxlabel(textwrap.fill(told, 60 * columns), fontsize=8)
    return figure_bytes(figure, form)


def _draw_values(axes: Axes, page: Steps) -> None:
    at = np.arange(len(page.names))
    low, high = (LOWEST, HIGHEST) if page.logarithmic else (-np.inf, np.inf)
    values = [np.clip(own, low, high) for own in page.values]
    middles = [float(np.median(own)) for own in values]
    axes.vlines(at, middles, [float(np.percentile(own, 95)) for own in values], GREY, lw=4)
    axes.plot(at, middles, "D-", color=BLACK, ms=5)
    for bound in (page.fine, page.failed):
        axes.axhline(bound, color=DARK, lw=0.9, ls=":")
    axes.axhspan(
        page.failed, max(page.failed * 1.5, axes.get_ylim()[1]), color=VERMILION, alpha=0.08
    )
    if page.logarithmic:
        axes.set(yscale="log", ylim=(LOWEST, HIGHEST), yticks=(0.1, 1, 10, 100))
        axes.set_yticklabels(("0.1", "1", "10", "100"))
        axes.minorticks_off()
    axes.set_title(page.title, loc="left", fontsize=10, fontweight="bold")
    axes.set_ylabel(page.quantity, fontsize=8.5)


def _draw_shares(axes: Axes, page: Steps) -> None:
    at, below = np.arange(len(page.names)), np.zeros(len(page.names))
    for number, (name, (color, hatch)) in enumerate(FATES.items()):
        shares = np.array([100 * own[number] for own in page.shares])
        look: dict[str, Any] = {"color": color, "hatch": hatch, "edgecolor": "white", "lw": 0.5}
        axes.bar(at, shares, 0.8, below, label=name, **look)
        below += shares
    axes.set(ylim=(0, 100), yticks=(0, 50, 100))
    axes.set_ylabel("%", fontsize=8.5)


def draw_scatter(
    groups: Mapping[str, Sequence[tuple[float, float]]],
    axis: tuple[str, str],
    bound: tuple[float, str],
    band: tuple[float, float],
) -> bytes:
    """Return points (x, y) of some groups as a PNG; y is above 0.

    Args:
        groups: by name.
        axis: what is across, and upwards.
        bound: a value of x, and what is said on either side of it.
        band: values of y between two judgements.
    """
    figure = new_figure(6.4, 4.4)
    axes = figure.add_subplot()
    for color, (name, points) in zip(COLORS, groups.items(), strict=False):
        x, y = zip(*points, strict=True)
        axes.scatter(x, y, s=26, color=color, label=f"{name}: {len(points)}")
    axes.axvline(bound[0], color="black", lw=1, ls="--", label=bound[1])
    axes.axhspan(*band, color=LIGHT, zorder=0)
    axes.set(xlim=(-0.1, None), yscale="log", xlabel=axis[0], ylabel=f"{axis[1]}, logarithmic")
    log_ticks(axes.yaxis, *axes.get_ylim())
    axes.legend(fontsize=8, frameon=False, loc="lower right")
    return figure_bytes(figure, "png")


def log_ticks(axis: Axis, low: float, high: float) -> None:
    """Write plain numbers along a logarithmic axis from low to high: few, and no powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

    subs = (1.0, 2.0, 5.0) if high / low < 1000 else (1.0,)
    axis.set_major_locator(
        MaxNLocator(6, steps=[1, 2, 2.5, 5, 10])
        if high / low < FEW
        else LogLocator(subs=subs, numticks=12)
    )
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _plain(axes: Axes) -> None:
    axes.tick_params(labelsize=8.5)
    axes.grid(True, color=LIGHT, lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
