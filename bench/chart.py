"""Time against accuracy: one point per method, the Pareto front drawn, the default marked."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

DEFAULT = "default"
SHOWN = ("o", "s", "^", "D", "v", "P", "X", "*")
# Okabe and Ito's colours: distinguishable with colour-blind eyes
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")


@dataclass(frozen=True)
class Point:
    """One method in the chart: seconds (or another cost) against error (or quality)."""

    method: str
    cost: float
    merit: float
    spread: float  # p95 of the merit, drawn as a whisker


def pareto_front(points: Sequence[Point], *, lower_is_better: bool) -> list[Point]:
    """Return the points that no other point beats in both cost and merit, cheapest first."""
    sign = 1 if lower_is_better else -1
    front: list[Point] = []
    for point in sorted(points, key=lambda p: (p.cost, sign * p.merit)):
        if not front or sign * point.merit < sign * front[-1].merit:
            front.append(point)
    return front


def draw_chart(
    points: Sequence[Point],
    *,
    title: str,
    cost_label: str,
    merit_label: str,
    caption: str,
    lower_is_better: bool,
) -> bytes:
    """Return the chart as PNG; both axes logarithmic where the merit is an error."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7.2, 4.6), dpi=110, layout="constrained")
    front = pareto_front(points, lower_is_better=lower_is_better)
    axes.plot([p.cost for p in front], [p.merit for p in front], color="#bbbbbb", lw=1.5, zorder=1)
    for i, point in enumerate(points):
        color, marker = COLORS[i % len(COLORS)], SHOWN[i % len(SHOWN)]
        low, high = sorted((point.merit, point.spread))
        axes.vlines(point.cost, low, high, color=color, lw=1, alpha=0.6)
        size = 150 if point.method == DEFAULT else 60
        label = f"{point.method} ({point.merit:.2f})"
        axes.scatter(
            point.cost,
            point.merit,
            s=size,
            color=color,
            marker=marker,
            label=label,
            zorder=3,
            edgecolor="black" if point.method == DEFAULT else "none",
        )
    axes.set_xscale("log")
    if lower_is_better:
        axes.set_yscale("log")
    axes.set_xlabel(cost_label)
    axes.set_ylabel(merit_label)
    axes.set_title(title, loc="left", fontsize=11)
    axes.grid(True, which="both", alpha=0.25)
    axes.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.supxlabel(caption, fontsize=7, color="#555555")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()
