"""What a chart of cost against merit shows: points, their front, and what to know of them."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass

from bench.records.pareto import DEFAULT, Point, Standing, pareto_front, standing_of

__all__ = ["COLORS", "DEFAULT", "SHOWN", "Chart"]

SHOWN = ("o", "s", "^", "D", "v", "P", "X", "*")
# Okabe and Ito's colours: distinguishable with colour-blind eyes
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
COLUMNS = "method cost merit spread n parameters on_front not_compared_because".split()


@dataclass(frozen=True)
class Chart:
    """What a chart shows.

    Attributes:
        subject: what was measured, e.g. "train".
        group: the condition.
        points: a method each.
        merit: name of the merit, e.g. "held-out PSNR".
        unit: of the merit.
        cost: name of the cost, e.g. "CPU seconds of training".
        cost_unit: short.
        statistic: what the merit is of its samples, "mean" or "median".
        caption: n, seeds and machine.
        lower_is_better: the merit is an error.
        same: methods that left out what had nothing to do: the default's own runs, not drawn.
    """

    subject: str
    group: str
    points: tuple[Point, ...]
    merit: str
    unit: str
    cost: str
    cost_unit: str
    statistic: str
    caption: str
    lower_is_better: bool
    same: tuple[str, ...] = ()

    @property
    def front(self) -> list[Point]:
        """Return the Pareto front, cheapest first."""
        return pareto_front(self.points, lower_is_better=self.lower_is_better)

    @property
    def standing(self) -> Standing | None:
        """Return where the default stands, if it is there."""
        return standing_of(self.points, lower_is_better=self.lower_is_better)

    @property
    def headline(self) -> str:
        """Return the message in a line."""
        standing = self.standing
        if standing is None:
            return self.group
        return standing.headline(self.merit, self.unit, self.cost_unit)

    @property
    def notes(self) -> list[str]:
        """Return what must be known to read the chart, in sentences."""
        tail = 95 if self.lower_is_better else 5
        notes = [self.standing.sentence(self.unit)] if self.standing else []
        marks = f"Each point is a {self.statistic}, whiskers go to the {tail}th percentile."
        notes.append(f"Star: the default. Blue: the Pareto front. Grey: behind it. {marks}")
        known = [p.parameters for p in self.points if p.parameters is not None]
        if known:
            least, most = (f"{value:,}" for value in (min(known), max(known)))
            notes.append(f"Marker area: parameters, {least} to {most}. Cross: none, or unknown.")
        reasons = dict.fromkeys(p.aside for p in self.points if p.aside)
        aside = [
            f"{', '.join(p.method for p in self.points if p.aside == reason)} ({reason})"
            for reason in reasons
        ]
        if aside:
            notes.append(f"Hollow, not compared: {'; '.join(aside)}.")
        if self.same:
            notes.append(
                f"The same runs as the default, with nothing to leave out: {', '.join(self.same)}."
            )
        return [*notes, self.caption]

    def csv(self) -> str:
        """Return the points as CSV, cheapest first; unknown numbers are empty."""
        front = [p.method for p in self.front]
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(COLUMNS)
        for p in sorted(self.points, key=lambda p: p.cost):
            row = (p.method, p.cost, p.merit, p.spread, p.n, p.parameters)
            writer.writerow((*row, p.method in front, p.aside))
        return buffer.getvalue()
