"""Which methods are worth their cost: the Pareto front, and where the default stands.

A method dominates another if it costs no more and is at least as good, and not level in both. The
front is what nothing dominates; of methods that are level in both it has the first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

DEFAULT = "default"


@dataclass(frozen=True)
class Point:
    """One method: what it costs and how good it is.

    Attributes:
        method: its name.
        cost: in seconds; 0 = nothing is computed.
        merit: an error or a quality.
        spread: the merit's 95th percentile towards the bad end.
        n: samples behind the merit.
        parameters: numbers that are fitted; None = unknown.
        by_case: the merit in every case, to pair methods by.
        aside: why it is not compared with the others; "" = it is.
    """

    method: str
    cost: float
    merit: float
    spread: float
    n: int
    parameters: int | None = None
    by_case: Mapping[str, float] = field(default_factory=dict)
    aside: str = ""


@dataclass(frozen=True)
class Standing:
    """Where the default stands.

    Attributes:
        default: its point.
        rival: the best that costs no more; None: nothing dominates the default.
        gap: how much better the rival is, not negative.
        noise: standard error of the mean paired difference; None with fewer than two cases.
        cases: shared with the rival.
    """

    default: Point
    rival: Point | None = None
    gap: float = 0.0
    noise: float | None = None
    cases: int = 0

    @property
    def within_noise(self) -> bool:
        """Return whether the rival's lead is no larger than its standard error."""
        return self.gap == 0 or (self.noise is not None and self.gap <= self.noise)

    def headline(self, merit: str, unit: str, cost_unit: str) -> str:
        """Return the message in a line, e.g. "default: 30.10 dB in 12 CPU s, on the ..."."""
        if self.rival is None:
            place = "on the Pareto front"
        elif self.within_noise:
            place = "level with the Pareto front"
        else:
            place = f"{_small(self.gap, unit)} behind the Pareto front"
        figure = (
            quantity(self.default.merit, unit) if unit else f"{merit} {self.default.merit:#.3g}"
        )
        return f"{DEFAULT}: {figure} in {self.default.cost:.3g} {cost_unit}, {place}"

    def sentence(self, unit: str) -> str:
        """Return whether the default is on the front, else how far off, and if that is noise."""
        if self.rival is None:
            return "The default is on the Pareto front: nothing else is as good for no more."
        costs = f"{self.rival.method}, at {self.rival.cost / self.default.cost:.2f} of its cost"
        if self.gap == 0:
            return f"The default is not on the Pareto front, but as good: level with {costs}."
        behind = f"The default is {_small(self.gap, unit)} behind the Pareto front ({costs})"
        if self.noise is None:
            return f"{behind}; with fewer than two cases, nothing tells whether that is noise."
        verdict = "within noise" if self.within_noise else "more than noise"
        error = f"paired standard error {_small(self.noise, unit)} over {self.cases} cases"
        return f"{behind}: {verdict}, {error}."


def quantity(value: float, unit: str) -> str:
    """Return a number with its unit: three digits, from 10 on two decimals."""
    text = f"{value:.2f}" if abs(value) >= 10 else f"{value:#.3g}"
    return f"{text} {unit}".rstrip()


def _small(value: float, unit: str) -> str:
    return f"{value:.2g} {unit}".rstrip()


def pareto_front(points: Sequence[Point], *, lower_is_better: bool) -> list[Point]:
    """Return the points that nothing dominates, cheapest first; those set aside do not compete."""
    sign = 1 if lower_is_better else -1
    front: list[Point] = []
    for point in sorted(points, key=lambda p: (p.cost, sign * p.merit)):
        beaten = front and sign * point.merit >= sign * front[-1].merit
        if not point.aside and not beaten:
            front.append(point)
    return front


def standing_of(points: Sequence[Point], *, lower_is_better: bool) -> Standing | None:
    """Return where the default stands; None if there is no default, or it is set aside."""
    default = next((p for p in points if p.method == DEFAULT and not p.aside), None)
    if default is None:
        return None
    front = pareto_front(points, lower_is_better=lower_is_better)
    rival = [p for p in front if p.cost <= default.cost][-1]
    if rival is default:
        return Standing(default)
    shared = [case for case in default.by_case if case in rival.by_case]
    differences = [default.by_case[case] - rival.by_case[case] for case in shared]
    noise = None
    if len(shared) > 1:
        noise = float(np.std(differences, ddof=1)) / math.sqrt(len(shared))
    return Standing(default, rival, abs(default.merit - rival.merit), noise, len(shared))
