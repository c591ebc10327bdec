"""From records to charts: which metric is the cost, which the merit, and who may be compared.

A method that was run on fewer cases than the default is set aside. It stands where the default's
figures on those cases and on all of them say that it would: their ratio for seconds and errors,
their difference for other merits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bench.charts.chart import Chart
from bench.records.pareto import DEFAULT, Point
from bench.records.record import CPU_SECONDS, Record, summarise
from bench.train.plan import MANNEQUIN, METHODS

PARAMETERS = "parameters"
COLORS_FOUND = "F1 of colours"
STRUCTURE_FROM_MOTION = (
    *("COLMAP", "COLMAP 1000 px", "COLMAP 1000 px, far", "COLMAP 1000 px, global"),
)
CLICKED = tuple(f"PnP, landmarks {share} % off" for share in (1, 2, 4))


@dataclass(frozen=True)
class Plot:
    """How a subject's records are charted.

    Attributes:
        merits: metrics on the y axis; a group has one of them.
        cost: metric on the x axis.
        cost_name: what is written there.
        cost_unit: short.
        samples: what n counts; "" = the cases.
        cases: what methods are paired by.
        mean: the merit is the mean over the cases, not the median of the samples.
        told: methods that know more than the default, and what; they are set aside.
        of: what else than the group names the chart; "" = nothing.
        only: methods that are shown; empty = all.
        switches: methods that leave a step out, and share the default's runs where it had nothing
            to do.
    """

    merits: tuple[str, ...]
    cost: str
    cost_name: str
    cost_unit: str
    samples: str
    cases: str
    mean: bool
    told: Mapping[str, str] = field(default_factory=dict)
    of: str = ""
    only: tuple[str, ...] = ()
    switches: tuple[str, ...] = ()


TRAINING = Plot(
    ("held-out PSNR",),
    *(CPU_SECONDS, "CPU seconds of training", "CPU s"),
    *("trainings", "characters"),
    mean=True,
    switches=tuple(name for name, method in METHODS.items() if method.leaves_out),
    told={
        MANNEQUIN: "told a body's shape",
        **{
            f"paper, hand-picked palette, {steps} steps": "told the palette"
            for steps in (200, 2000)
        },
    },
)
MODELS = replace(
    TRAINING,
    cost="model size",
    cost_name="size of the saved model, kB",
    cost_unit="kB",
    of=", model size",
    only=(
        *(DEFAULT, "finest planes", "planes of 2/3", "planes of 1/3"),
        *("voxel", "mlp", "coloured hull", "paper, automatic palette, 2000 steps"),
    ),
)
PLOTS: dict[str, Plot] = {
    "calib": Plot(
        ("rotation error", "yaw error"),
        *("seconds", "seconds per sheet", "s"),
        *("views", "sheets"),
        mean=False,
        told={
            "labels": "told the directions",
            **dict.fromkeys(STRUCTURE_FROM_MOTION, "its placed views alone, turned to the truth"),
            **dict.fromkeys(CLICKED, "told 12 clicked points a view; clicking is not timed"),
        },
    ),
    "train": TRAINING,
    "paper": TRAINING,
    "look": Plot(
        ("FLIP",),
        *(CPU_SECONDS, "CPU seconds of training, laying out and 16 views", "CPU s"),
        *("", "characters"),
        mean=True,
    ),
    "palette": Plot(
        (COLORS_FOUND,),
        *(CPU_SECONDS, "CPU seconds per sheet", "CPU s"),
        *("", "drawings of all sizes and kinds"),
        mean=True,
        told={
            "colorgram, true k": "told how many colours",
            "k-means, true k": "told how many colours",
        },
    ),
}
SECOND = {"train": MODELS}  # subjects with another chart per group


def charts_of(subject: str, records: Sequence[Record], seeds: str) -> list[Chart]:
    """Return a chart per group whose records have both the cost and the merit.

    Args:
        subject: a key of `PLOTS`.
        records: of all groups; those of colours are pooled over the conditions.
        seeds: for the captions.
    """
    records = [*records, *_pooled(records)]
    plots = [PLOTS[subject], *([SECOND[subject]] if subject in SECOND else [])]
    found = (
        _chart(subject, group, [r for r in records if r.group == group], plot, seeds)
        for plot in plots
        for group in dict.fromkeys(record.group for record in records)
    )
    return [chart for chart in found if chart]


def _chart(subject: str, group: str, own: Sequence[Record], plot: Plot, seeds: str) -> Chart | None:
    own = [r for r in own if not plot.only or r.method in plot.only]
    merits = {r.method: r for r in own if r.metric in plot.merits}
    points = points_of(own, plot)
    if not points:
        return None
    same = _same_as_default(points, plot.switches)
    first = merits.get(DEFAULT) or next(iter(merits.values()))
    cases = f"{len(first.by_case)} {plot.cases}"
    n = f"n = {first.n} {plot.samples} of {cases}" if plot.samples else f"n = {cases}"
    fewest = min((p.n for p in points if not p.aside), default=first.n)
    if plot.samples and fewest < first.n:  # slow methods have one seed
        n += f", {fewest} of some methods"
    return Chart(
        subject=subject,
        group=f"{group}{plot.of}",
        points=tuple(p for p in points if p.method not in same),
        same=same,
        merit=first.metric,
        unit=first.unit if first.unit != "1" else "",
        cost=plot.cost_name,
        cost_unit=plot.cost_unit,
        statistic="mean" if plot.mean else "median",
        caption=f"{n}; {seeds}; {first.machine}.",
        lower_is_better=first.direction == "lower",
    )


def _same_as_default(points: Sequence[Point], switches: Sequence[str]) -> tuple[str, ...]:
    """Return the switches that had nothing to do: their runs are the default's to the bit.

    Where the default has more seeds than they, they are those that share one run among them.
    """

    def figures(point: Point) -> tuple[float, float, tuple[tuple[str, float], ...]]:
        return point.cost, point.merit, tuple(point.by_case.items())

    runs = Counter(figures(p) for p in points if p.method in (DEFAULT, *switches))
    return tuple(p.method for p in points if p.method in switches and runs[figures(p)] > 1)


def points_of(records: Sequence[Record], plot: Plot) -> list[Point]:
    """Return the points of one group's records."""
    merits = {r.method: r for r in records if r.metric in plot.merits}
    costs = {r.method: r for r in records if r.metric == plot.cost}
    sizes = {r.method: r.median for r in records if r.metric == PARAMETERS}
    points = []
    for method in (m for m in merits if m in costs):
        merit, cost = merits[method], costs[method]
        everywhere = merits[DEFAULT].by_case if DEFAULT in merits else {}
        cases = [case for case in everywhere if case in merit.by_case]
        fewer = f"{len(cases)} of {len(everywhere)} {plot.cases}" * (len(cases) < len(everywhere))
        value = float(np.mean(list(merit.by_case.values()))) if plot.mean else merit.median
        spread, spent = merit.p95, cost.median
        if fewer and cases:
            by_ratio = merit.direction == "lower"
            value, spread = _moved((value, spread), merits[DEFAULT], cases, plot, by_ratio=by_ratio)
            (spent,) = _moved((spent,), costs[DEFAULT], cases, plot, by_ratio=True)
        aside = plot.told.get(method) or fewer
        size = round(sizes[method]) if method in sizes else None
        points.append(Point(method, spent, value, spread, merit.n, size, merit.by_case, aside))
    return points


def _moved(
    values: Sequence[float], default: Record, cases: Sequence[str], plot: Plot, *, by_ratio: bool
) -> list[float]:
    """Return figures on some cases as they would be on all, if they changed as the default's."""
    figure = np.mean if plot.mean else np.median
    everywhere = float(figure(list(default.by_case.values())))
    here = float(figure([default.by_case[case] for case in cases]))
    if by_ratio:
        return [value * everywhere / here for value in values] if here > 0 else list(values)
    return [value + everywhere - here for value in values]


def _pooled(records: Sequence[Record]) -> list[Record]:
    """Return what colours are found under all conditions, once per size of sheet that is timed."""
    found: dict[str, dict[str, float]] = {}
    merits = [record for record in records if record.metric == COLORS_FOUND]
    for record in merits:
        own = {f"{record.group}: {case}": value for case, value in record.by_case.items()}
        found.setdefault(record.method, {}).update(own)
    sizes = dict.fromkeys(r.group for r in records if r.metric == CPU_SECONDS) if merits else {}
    return [
        summarise(
            list(values.values()),
            method=method,
            metric=COLORS_FOUND,
            unit=merits[0].unit,
            direction=merits[0].direction,
            seed=merits[0].seed,
            group=size,
            by_case=values,
        )
        for size in sizes
        for method, values in found.items()
    ]
