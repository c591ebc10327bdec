"""A page's curve: what its trials lost per step, and whether the tool said so where they failed."""

from __future__ import annotations

from typing import Any

import numpy as np

from bench.atlas.figures import UNJUDGED, Kind, Trial, TriedPage, by_sheet
from bench.charts.chart import COLORS
from bench.charts.figure import DARK, LIGHT, Form, figure_bytes, new_figure

BLUE, VERMILION, GREEN, _, ORANGE, SKY, BLACK, GREY = COLORS
SIZE_IN = 6.6, 4.9
LOWEST, HIGHEST = 0.03, 180.0  # of a logarithmic value
SPREAD = 0.28  # of a step's width, over which its sheets' dots lie
FATES = (  # from the bottom: what became of a trial, and how it is drawn
    ("fine, nothing said", GREEN, ""),
    ("fine, something said: false alarm", ORANGE, "//"),
    ("between fine and failed", LIGHT, ""),
    ("failed, announced", SKY, ""),
    ("failed, nothing said", VERMILION, "xx"),
)


def draw_page(page: TriedPage, form: Form = "svg") -> bytes:
    """Return the picture: values of all sheets per step over a bar of what became of the trials."""
    figure = new_figure(*SIZE_IN)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1))
    _draw_values(top, page)
    _draw_fates(bottom, page)
    bottom.set_xticks(range(len(page.steps)), [step.step for step in page.steps])
    bottom.set_xlabel(page.page.axis, fontsize=10)
    for axes in (top, bottom):
        axes.tick_params(labelsize=9.5)
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(
        handles=_legend(page), loc="outside lower center", ncols=2, fontsize=9, frameon=False
    )
    return figure_bytes(figure, form)


def _draw_values(axes: Any, page: TriedPage) -> None:
    kind, at = page.kind, np.arange(len(page.steps))
    values = [_shown([t.value for t in step.trials], kind) for step in page.steps]
    axes.axhspan(*_failed_range(values, kind), color=VERMILION, alpha=0.08, lw=0)
    bounds = [(kind.failed, "failed", "bottom"), (kind.fine, "fine", "top")]
    for bound, words, side in bounds if kind.fine < kind.failed else bounds[:1]:
        axes.axhline(bound, color=DARK, lw=0.9, ls=(0, (2, 3)))
        _write_beside(axes, bound, words, side)
    axes.vlines(
        at, [np.median(v) for v in values], [np.percentile(v, 95) for v in values], color=GREY, lw=4
    )
    for i, step in enumerate(page.steps):
        sheets = _shown(by_sheet(step), kind)
        places = i + (np.linspace(-SPREAD, SPREAD, len(sheets)) if len(sheets) > 1 else 0)
        axes.scatter(
            np.broadcast_to(places, len(sheets)), sheets, s=14, color=BLUE, alpha=0.75, zorder=3
        )
    axes.plot(at, [np.median(v) for v in values], "D-", color=BLACK, ms=5, zorder=4)
    if kind.logarithmic:
        axes.set(yscale="log", ylim=(LOWEST, HIGHEST * 1.3), yticks=(0.1, 1, 10, 100))
        axes.set_yticklabels(("0.1", "1", "10", "100"))
        axes.minorticks_off()
    axes.set_ylabel(f"{kind.value}, {kind.unit}", fontsize=10)
    axes.grid(axis="y", color=LIGHT, lw=0.6)
    axes.set_axisbelow(True)


def _write_beside(axes: Any, height: float, words: str, side: str) -> None:
    """Write words to the right of the axes, on one side of a height."""
    axes.annotate(
        words,
        (1, height),
        (4, 0),
        xycoords=axes.get_yaxis_transform(),
        textcoords="offset points",
        va=side,
        fontsize=9,
        color=DARK,
        annotation_clip=False,
    )


def _failed_range(values: list[np.ndarray], kind: Kind) -> tuple[float, float]:
    most = max(float(v.max()) for v in values)
    return kind.failed, HIGHEST * 1.3 if kind.logarithmic else max(most * 1.05, kind.failed * 1.5)


def _shown(values: list[float], kind: Kind) -> np.ndarray:
    return np.clip(values, LOWEST, HIGHEST) if kind.logarithmic else np.asarray(values)


def _draw_fates(axes: Any, page: TriedPage) -> None:
    at, below = np.arange(len(page.steps)), np.zeros(len(page.steps))
    counts = np.array([_fates(step.trials, page.kind) for step in page.steps], dtype=float)
    shares = 100 * counts / counts.sum(axis=1, keepdims=True)
    for i, (_, color, hatch) in enumerate(FATES):
        axes.bar(at, shares[:, i], 0.8, below, color=color, hatch=hatch, edgecolor="white", lw=0.5)
        below += shares[:, i]
    axes.set(ylim=(0, 100), yticks=(0, 50, 100), xlim=(-0.6, len(at) - 0.4))
    axes.set_ylabel(f"{page.kind.trials}, %", fontsize=10)


def _fates(trials: tuple[Trial, ...], kind: Kind) -> list[int]:
    counts = [0] * len(FATES)
    for trial in trials:
        said = trial.voice != UNJUDGED and not kind.is_calm(trial.voice)
        if trial.value > kind.failed:
            counts[3 if said else 4] += 1
        elif trial.value < kind.fine:
            counts[1 if said else 0] += 1
        else:
            counts[2] += 1
    return counts


def _legend(page: TriedPage) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    trials = page.kind.trials
    return [
        Line2D([], [], color=BLACK, marker="D", ms=5, label=f"median of all {trials}"),
        Line2D([], [], color=GREY, lw=4, label="to the 95th percentile"),
        Line2D([], [], color=BLUE, ls="", marker="o", ms=4, label="median of each sheet"),
        *(
            Patch(facecolor=color, hatch=hatch, edgecolor="white", label=name)
            for name, color, hatch in FATES
        ),
    ]
