"""Running the steps of all pages of the atlas: every one a result with a picture of its worst."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

from bench.atlas.labels import LabelPage, try_labels
from bench.atlas.look import LookPage, try_look
from bench.atlas.pages import LABEL_PAGES, LOOK_PAGES, PALETTE_PAGES, TRAIN_PAGES
from bench.atlas.palette import PalettePage, try_palette
from bench.atlas.training import TrainPage, Tried, try_training
from bench.cases.workers import in_order
from bench.stability.sheet import Step
from bench.stability.steps import SheetResult, StepResult, badness, run_sheet, worst_view
from bench.stability.sweeps import SWEEPS, Sweep

AnyPage = Sweep | PalettePage | LabelPage | TrainPage | LookPage
Plan = Sequence[tuple[AnyPage, Step]]


@dataclass(frozen=True)
class Counts:
    """How many sheets a step of calibration has, and how many bodies one of the other pages."""

    sheets: int
    bodies: int

    def of(self, page: AnyPage) -> int:
        """Return how many a step of the page has."""
        return self.sheets if isinstance(page, Sweep) else self.bodies


@dataclass(frozen=True)
class TriedStepResult:
    """All bodies of one step of a page about training, look, palettes or labels."""

    page: str
    step: str
    tried: tuple[Tried, ...]


@dataclass(frozen=True)
class Job:
    """One sheet of one step."""

    page: AnyPage
    step: Step
    seed: int


Result = StepResult | TriedStepResult


def all_pages() -> tuple[AnyPage, ...]:
    """Return the pages, in the order of the report."""
    return (*SWEEPS, *PALETTE_PAGES, *LABEL_PAGES, *TRAIN_PAGES, *LOOK_PAGES)


def run_steps(
    plan: Plan,
    seed: int,
    counts: Counts,
    *,
    workers: int = 1,
    progress: Callable[[str], None] = lambda text: None,
) -> Iterator[tuple[Result, bytes]]:
    """Yield a result per step and a PNG of its worst trial, in order, as soon as it is done.

    Args:
        plan: pages with the step to run.
        seed: of the first sheet; the others' follow.
        counts: sheets per step.
        workers: processes; the result does not depend on them.
        progress: called with the step that is waited for.
    """
    jobs = [Job(page, step, seed + i) for page, step in plan for i in range(counts.of(page))]
    done = in_order(run_job, jobs, min(workers, len(jobs)))
    for number, (page, step) in enumerate(plan, start=1):
        progress(f"{number} of {len(plan)}: {page.name} {step}")
        yield _gathered(page, step, list(islice(done, counts.of(page))))


def run_job(job: Job) -> tuple[SheetResult | Tried, bytes]:
    """Return what became of one sheet, and a picture of it."""
    if isinstance(job.page, Sweep):
        return run_sheet(job.page, job.step, job.seed)
    if isinstance(job.page, PalettePage):
        return try_palette(job.page, job.step, job.seed)
    if isinstance(job.page, LabelPage):
        return try_labels(job.page, job.step, job.seed)
    if isinstance(job.page, LookPage):
        return try_look(job.page, job.step, job.seed)
    return try_training(job.page, job.step, job.seed)


def _gathered(
    page: AnyPage, step: Step, done: Sequence[tuple[SheetResult | Tried, bytes]]
) -> tuple[Result, bytes]:
    sheets = [(found, png) for found, png in done if isinstance(found, SheetResult)]
    if sheets:
        _, worst = max(sheets, key=lambda pair: badness(pair[0].views[worst_view(pair[0].views)]))
        return StepResult(page.name, str(step), tuple(found for found, _ in sheets)), worst
    tried = [(found, png) for found, png in done if isinstance(found, Tried)]
    _, worst = min(tried, key=lambda pair: pair[0].figure)
    return TriedStepResult(page.name, str(step), tuple(found for found, _ in tried)), worst
