"""Cost against merit: a point per method, their Pareto front, and where the default stands.

A method dominates another if it costs no more and is at least as good, and not level in both. A
method that was run on fewer cases than the default, or is told more, is not compared.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lab.bench.records.methods import METHODS, Entry
from lab.bench.records.record import CPU_SECONDS, DEFAULT, Record, Recorder

ALL = "all"  # the group of all others together: where there is one, it alone has a chart
COLUMNS = "method cost merit spread n on_front not_compared_because".split()


@dataclass(frozen=True)
class Point:
    """One method: what it costs and how good it is.

    Attributes:
        method: its name.
        cost: in seconds; 0 = nothing is computed.
        merit: an error or a quality.
        spread: the merit's 95th percentile towards the bad end.
        n: samples behind the merit.
        by_case: the merit in every case, to pair methods by.
        aside: why it is not compared with the others; "" = it is.
    """

    method: str
    cost: float
    merit: float
    spread: float
    n: int
    by_case: Mapping[str, float] = field(default_factory=dict)
    aside: str = ""


@dataclass(frozen=True)
class Chart:
    """Content of a chart.

    Attributes:
        subject: what was measured, e.g. "train".
        group: the condition.
        points: a method each.
        merit: name of the merit, e.g. "held-out PSNR".
        unit: of the merit.
        cost: name of the cost, e.g. "CPU seconds of training".
        cost_unit: short.
        caption: what the merit is of its samples, n, seeds and machine.
        lower_is_better: the merit is an error.
    """

    subject: str
    group: str
    points: tuple[Point, ...]
    merit: str
    unit: str
    cost: str
    cost_unit: str
    caption: str
    lower_is_better: bool

    @property
    def front(self) -> list[Point]:
        """Return the points that nothing dominates, cheapest first; of equals, the first."""
        sign = 1 if self.lower_is_better else -1
        front: list[Point] = []
        for point in sorted(self.points, key=lambda p: (p.cost, sign * p.merit)):
            beaten = front and sign * point.merit >= sign * front[-1].merit
            if not point.aside and not beaten:
                front.append(point)
        return front

    @property
    def default(self) -> Point | None:
        """Return the default's point, if it is there and compared."""
        return next((p for p in self.points if p.method == DEFAULT and not p.aside), None)

    @property
    def winners(self) -> list[Point]:
        """Return what dominates the default, the best first."""
        default, sign = self.default, 1 if self.lower_is_better else -1
        if default is None:
            return []
        better = [
            p
            for p in self.points
            if not p.aside
            and p.cost <= default.cost
            and sign * p.merit <= sign * default.merit
            and (p.cost, p.merit) != (default.cost, default.merit)
        ]
        return sorted(better, key=lambda p: sign * p.merit)

    @property
    def headline(self) -> str:
        """Return the message in a line."""
        default, winners = self.default, self.winners
        if default is None:
            return self.group
        figure = quantity(default.merit, self.unit)
        figure = figure if self.unit else f"{self.merit} {figure}"
        place = f"loses to {winners[0].method}" if winners else "on the Pareto front"
        return f"{DEFAULT}: {figure} in {default.cost:.3g} {self.cost_unit}, {place}"

    @property
    def losses(self) -> list[str]:
        """Return, of each method that dominates the default, by how much and why it is not it."""
        return [self._loss(winner) for winner in self.winners]

    @property
    def notes(self) -> list[str]:
        """Return what must be known to read the chart, in sentences."""
        tail = 95 if self.lower_is_better else 5
        notes = [
            "Star: the default. Blue line: the Pareto front. "
            f"Whiskers go to the {tail}th percentile."
        ]
        for reason in dict.fromkeys(p.aside for p in self.points if p.aside):
            names = ", ".join(p.method for p in self.points if p.aside == reason)
            notes.append(f"Hollow, not compared: {names} ({reason}).")
        return [*notes, self.caption]

    def csv(self) -> str:
        """Return the points as CSV, cheapest first; unknown numbers are empty."""
        front = [p.method for p in self.front]
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(COLUMNS)
        for p in sorted(self.points, key=lambda p: p.cost):
            row = (p.method, p.cost, p.merit, p.spread, p.n, p.method in front, p.aside)
            writer.writerow(row)
        return buffer.getvalue()

    def _loss(self, winner: Point) -> str:
        default = self.default
        assert default is not None
        gap, share = abs(winner.merit - default.merit), winner.cost / default.cost
        shared = [case for case in default.by_case if case in winner.by_case]
        lead = f"{winner.method}: {quantity(gap, self.unit)} better at {share:.2f} of the cost"
        if len(shared) > 1:
            apart = [winner.by_case[case] - default.by_case[case] for case in shared]
            error = float(np.std(apart, ddof=1)) / math.sqrt(len(shared))
            noise = "within" if gap <= error else "more than"
            lead += f", {noise} its standard error of {quantity(error, self.unit)}"
            lead += f" over {len(shared)} cases"
        why = METHODS.get(self.subject, {}).get(winner.method, Entry()).why
        return f"{lead}. {why[:1].upper()}{why[1:]}." if why else f"{lead}. No reason is known."


def quantity(value: float, unit: str) -> str:
    """Return a number with its unit: three digits, from 10 on two decimals."""
    text = f"{value:.2f}" if abs(value) >= 10 else f"{value:#.3g}"
    return f"{text} {unit}".rstrip()


@dataclass(frozen=True)
class Plot:
    """Axes and methods of a subject's chart.

    Attributes:
        merits: metrics on the y axis; a group has one of them.
        cost: metric on the x axis.
        cost_name: what is written there.
        cost_unit: short.
        samples: what n counts; "" = the cases.
        cases: what methods are paired by.
        mean: the merit is the mean over the cases, not the median of the samples.
    """

    merits: tuple[str, ...]
    cost: str
    cost_name: str
    cost_unit: str
    samples: str
    cases: str
    mean: bool = True


TRAIN_S = (CPU_SECONDS, "CPU seconds of training", "CPU s")
SHEET_S = ("seconds", "seconds per sheet", "s")
LOOK_S = (CPU_SECONDS, "CPU seconds of training, laying out and 16 views", "CPU s")
PALETTE_S = (CPU_SECONDS, "CPU seconds per sheet", "CPU s")
LABEL_S = (CPU_SECONDS, "CPU seconds per megapixel", "CPU s")
SPLIT_S = ("seconds per megapixel", "CPU seconds per megapixel", "CPU s")
PLOTS: dict[str, Plot] = {
    "calib": Plot(("rotation error", "yaw error"), *SHEET_S, "views", "sheets", mean=False),
    "train": Plot(("held-out PSNR",), *TRAIN_S, "trainings", "characters"),
    "look": Plot(("FLIP",), *LOOK_S, "", "characters"),
    "palette": Plot(("F1 of colours",), *PALETTE_S, "", "drawings of all sizes and kinds"),
    "labels": Plot(("right",), *LABEL_S, "", "drawings of all sizes and kinds"),
    "split": Plot(("exactly right",), *SPLIT_S, "sheets", "sheets", mean=False),
}


def charts_of(subject: str, records: Sequence[Record], seeds: str) -> list[Chart]:
    """Return a chart per group whose records have both the cost and the merit.

    Args:
        subject: a key of `PLOTS`.
        records: of all groups; those of colours and labels are pooled over the conditions.
        seeds: for the captions.
    """
    if subject in ("palette", "labels"):
        records = [*records, *_pooled(records, PLOTS[subject].merits[0])]
    if whole := [record for record in records if record.group == ALL]:
        records = whole
    found = (
        _chart(subject, group, [r for r in records if r.group == group], seeds)
        for group in dict.fromkeys(record.group for record in records)
    )
    return [chart for chart in found if chart]


def _chart(subject: str, group: str, own: Sequence[Record], seeds: str) -> Chart | None:
    plot = PLOTS[subject]
    merits = {r.method: r for r in own if r.metric in plot.merits}
    points = points_of(own, plot, METHODS[subject])
    if not points:
        return None
    first = merits.get(DEFAULT) or next(iter(merits.values()))
    n = f"{len(first.by_case)} {plot.cases}" if first.by_case else f"{first.n} {plot.samples}"
    if plot.samples and first.by_case:
        n = f"{first.n} {plot.samples} of {n}"
        fewest = min((p.n for p in points if not p.aside), default=first.n)
        n += f", {fewest} of some methods" if fewest < first.n else ""
    return Chart(
        subject=subject,
        group=group,
        points=tuple(points),
        merit=first.metric,
        unit=first.unit if first.unit != "1" else "",
        cost=plot.cost_name,
        cost_unit=plot.cost_unit,
        caption=f"{'Mean' if plot.mean else 'Median'}; n = {n}; {seeds}; {first.machine}.",
        lower_is_better=first.direction == "lower",
    )


def points_of(
    records: Sequence[Record], plot: Plot, known: Mapping[str, Entry] | None = None
) -> list[Point]:
    """Return the points of one group's records."""
    merits = {r.method: r for r in records if r.metric in plot.merits}
    costs = {r.method: r for r in records if r.metric == plot.cost}
    everywhere = merits[DEFAULT].by_case if DEFAULT in merits else {}
    points = []
    for method in (m for m in merits if m in costs):
        merit, spent = merits[method], costs[method].median
        cases = [case for case in everywhere if case in merit.by_case]
        fewer = f"{len(cases)} of {len(everywhere)} {plot.cases}" * (len(cases) < len(everywhere))
        value, spread = merit.mean if plot.mean else merit.median, merit.p95
        aside = (known or {}).get(method, Entry()).told or fewer
        points.append(Point(method, spent, value, spread, merit.n, merit.by_case, aside))
    return points


def _pooled(records: Sequence[Record], metric: str) -> list[Record]:
    """Return a merit under all conditions together, once per size of sheet that is timed."""
    found: dict[str, dict[str, float]] = {}
    merits = [record for record in records if record.metric == metric]
    for record in merits:
        own = record.by_case or {"": record.value}
        named = {f"{record.group}: {case}": value for case, value in own.items()}
        found.setdefault(record.method, {}).update(named)
    sizes = dict.fromkeys(r.group for r in records if r.metric == CPU_SECONDS)
    return [
        Recorder(method, size, first.seed).samples(
            metric, list(values.values()), first.unit, first.direction, values
        )
        for first in merits[:1]
        for size in sizes
        for method, values in found.items()
    ]
