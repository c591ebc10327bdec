"""What the bench of the plain method runs: every palette, several characters and seeds."""

from __future__ import annotations

from collections.abc import Sequence

from bench.cases.cases import TrainCase
from bench.charts.chart import DEFAULT
from bench.train.plan import METHODS, PAPER, PAPER_STEPS, Job, side_px, view_counts
from toonset.nerf.options import USUAL_STEPS

CASES, SEEDS, VIEWS = 8, 3, 8
QUICK_CASES = 3  # of each condition and size, with one seed and the fewest iterations


def paper_plan(cases: Sequence[TrainCase], seed: int, only: str, *, quick: bool) -> list[Job]:
    """Return the jobs, few iterations first, then seed by seed, character by character.

    So a stopped run has all palettes of whatever characters it has come to. The default goes with
    the first seed alone. Curves cost more than a short training, so that of the default alone is
    followed: it tells when the plain method is outdone.

    Args:
        cases: with all their views; several sizes of one case are several cases.
        seed: the first.
        only: keep jobs whose name contains this.
        quick: some cases, one seed, few iterations.
    """
    methods = [DEFAULT, *PAPER]
    if quick:
        cases = _some(cases)
        methods = [name for name in methods if _steps(name) < max(PAPER_STEPS)]
    jobs = [
        Job(case, view_counts(case, (VIEWS,))[0], method, seed + number, method == DEFAULT)
        for number in range(1 if quick else SEEDS)
        for case in cases
        for method in methods
        if (number == 0 or method != DEFAULT) and _has_palette(case, method)
    ]
    jobs.sort(key=lambda job: (_steps(job.method), job.seed))  # stable: the rest stays in order
    return [job for job in jobs if only in job.name]


def _steps(method: str) -> int:
    options = METHODS[method].options
    return 0 if options is None else options.steps or USUAL_STEPS


def _has_palette(case: TrainCase, method: str) -> bool:
    return METHODS[method].palette != "hand-picked palette" or case.train.palette is not None


def _some(cases: Sequence[TrainCase]) -> list[TrainCase]:
    seen: dict[tuple[str, int], list[TrainCase]] = {}
    for case in cases:
        seen.setdefault((case.group, side_px(case)), []).append(case)
    return [case for group in seen.values() for case in group[:QUICK_CASES]]
