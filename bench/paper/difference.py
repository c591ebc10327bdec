"""Does a palette help? Palette minus no palette, paired over characters, with its interval.

The unit is the character: the difference of two trainings with the same seed, averaged over the
seeds, is one sample. The interval is Student's, 95 %, for each comparison by itself.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np

from bench.paper.table import AFTER, BEFORE, LOWER, METRICS
from bench.records.record import aligned
from bench.train.plan import METHODS, PALETTES, PAPER
from bench.train.run import RunResult
from toonset.nerf.options import USUAL_STEPS

CONFIDENCE = 0.95
BARE, *WITH_PALETTE = PALETTES
LAYERS = {BEFORE: "", AFTER: "palette_"}  # how the figures' names begin
SAID = {BEFORE: "before the classifier", AFTER: "after the classifier"}
NAMES = {"psnr": "PSNR", "ssim": "SSIM", "flip": "FLIP", "lpips": "LPIPS"}
CSV_COLUMNS = "condition palette iterations layer metric n seeds mean low high verdict".split()
Verdict = Literal["better", "worse", "undecided"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)


@dataclass(frozen=True)
class Difference:
    """A comparison of a palette with none.

    Attributes:
        group: condition.
        palette: whose it is.
        iterations: of both trainings.
        layer: of the training with a palette; without one, it is as the field has it.
        metric: what is compared.
        by_case: palette minus no palette per character, mean over the seeds that both have.
        seeds: of the character with the fewest.
        mean: over the characters.
        interval: of the mean, low and high; None with fewer than two characters.
    """

    group: str
    palette: str
    iterations: int
    layer: str
    metric: str
    by_case: Mapping[str, float]
    seeds: int
    mean: float
    interval: tuple[float, float] | None

    @property
    def n(self) -> int:
        """Return how many characters there are."""
        return len(self.by_case)

    @property
    def verdict(self) -> Verdict:
        """Return which is better: undecided where the interval holds 0."""
        if self.interval is None or self.interval[0] <= 0 <= self.interval[1]:
            return "undecided"
        return "better" if (self.mean < 0) == (self.metric in LOWER) else "worse"


def differences_of(runs: Sequence[RunResult]) -> list[Difference]:
    """Return all comparisons that there are trainings for, group by group."""
    figures = {(r.group, r.method, r.case, r.seed): r.figures for r in runs if not r.note}
    found = []
    for group in dict.fromkeys(run.group for run in runs):
        for palette, steps, layer, metric in _comparisons():
            pairs: dict[str, list[float]] = {}
            for (where, method, case, seed), own in figures.items():
                bare = figures.get((group, _method(BARE, steps), case, seed), {}).get(metric)
                value = own.get(LAYERS[layer] + metric)
                if (where, method) != (group, _method(palette, steps)):
                    continue
                if value is not None and bare is not None:
                    pairs.setdefault(case, []).append(value - bare)
            if pairs:
                found.append(_difference((group, palette, steps, layer, metric), pairs))
    return found


def student_interval(samples: Sequence[float]) -> tuple[float, float] | None:
    """Return the interval of the mean at `CONFIDENCE`; None of fewer than two samples."""
    from scipy.special import stdtrit

    n = len(samples)
    if n < 2:
        return None
    half = float(stdtrit(n - 1, (1 + CONFIDENCE) / 2)) * float(np.std(samples, ddof=1))
    mean = float(np.mean(samples))
    return mean - half / math.sqrt(n), mean + half / math.sqrt(n)


def as_rows(differences: Sequence[Difference]) -> list[dict[str, Any]]:
    """Return the comparisons as plain data."""
    return [asdict(d) | {"n": d.n, "verdict": d.verdict} for d in differences]


def as_csv(differences: Sequence[Difference]) -> str:
    """Return the comparisons as CSV; what there is no figure for is empty."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for d in differences:
        low, high = d.interval or ("", "")
        key = (d.group, d.palette, d.iterations, d.layer, d.metric)
        writer.writerow((*key, d.n, d.seeds, d.mean, low, high, d.verdict))
    return buffer.getvalue()


def as_table(differences: Sequence[Difference]) -> str:
    """Return the comparisons as a table for people, condition by condition."""
    heading = ("palette - none", "iterations", "layer", "metric", "verdict", "n", "seeds")
    lines: list[str] = []
    for group in dict.fromkeys(d.group for d in differences):
        cells: list[tuple[str, ...]] = [(*heading, "difference", "95 % interval")]
        for d in (d for d in differences if d.group == group):
            words = (word(d.palette), str(d.iterations), d.layer, NAMES[d.metric], d.verdict)
            cells.append((*words, str(d.n), str(d.seeds), signed(d.mean, d.metric), _interval(d)))
        lines += ["", group, *aligned(cells, words=5)]
    return "\n".join(lines[1:])


def claim(differences: Sequence[Difference]) -> str:
    """Return, per condition and layer, whether a palette helps, where not, and by how much."""
    lines = ["Does a palette help? (95 % for each comparison by itself)"]
    for group in dict.fromkeys(d.group for d in differences):
        for layer in LAYERS:
            own = [d for d in differences if (d.group, d.layer) == (group, layer)]
            found = {str(v): [d for d in own if d.verdict == v] for v in VERDICTS}
            counts = ", ".join(f"{len(listed)} {verdict}" for verdict, listed in found.items())
            lines.append(f"{group}, {SAID[layer]}: {_answer(found)}; {counts}")
            decided = [v for v in VERDICTS if v != "undecided" and found[v]]
            lines += [f"  {verdict}: {_listed(found[verdict])}" for verdict in decided]
    return "\n".join(lines)


def signed(value: float, metric: str) -> str:
    """Return a difference of a metric with its sign."""
    return f"{value:+.2f}" if metric == "psnr" else f"{value:+.4f}"


def word(palette: str) -> str:
    """Return what kind of palette it is, in a word."""
    return palette.removesuffix(" palette")


def _answer(found: Mapping[str, Sequence[Difference]]) -> str:
    if not found["better"]:
        return "no" if found["worse"] else "undecided"
    return "in part" if found["worse"] or found["undecided"] else "yes"


def _listed(differences: Sequence[Difference]) -> str:
    """Return the differences metric by metric."""
    parts = []
    for metric in dict.fromkeys(d.metric for d in differences):
        each = (
            f"{signed(d.mean, metric)} ({word(d.palette)}, {d.iterations})"
            for d in differences
            if d.metric == metric
        )
        parts.append(f"{NAMES[metric]} {', '.join(each)}")
    return "; ".join(parts)


def _interval(d: Difference) -> str:
    if d.interval is None:
        return "-"
    return f"[{', '.join(signed(end, d.metric) for end in d.interval)}]"


def _difference(
    of: tuple[str, str, int, str, str], pairs: Mapping[str, Sequence[float]]
) -> Difference:
    by_case = {case: float(np.mean(values)) for case, values in pairs.items()}
    samples = list(by_case.values())
    seeds = min(map(len, pairs.values()))
    return Difference(*of, by_case, seeds, float(np.mean(samples)), student_interval(samples))


def _comparisons() -> list[tuple[str, int, str, str]]:
    steps = sorted({_steps(name) for name in PAPER})
    return [(p, s, at, m) for at in LAYERS for s in steps for p in WITH_PALETTE for m in METRICS]


def _method(palette: str, steps: int) -> str:
    return next(n for n in PAPER if METHODS[n].palette == palette and _steps(n) == steps)


def _steps(name: str) -> int:
    options = PAPER[name].options
    assert options is not None
    return options.steps or USUAL_STEPS
