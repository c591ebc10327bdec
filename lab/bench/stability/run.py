"""Running the steps of pages, in a folder that a later run continues.

steps.json in the output folder is rewritten after every step, with a picture of the step's worst
trial in pictures/. A run with the same seed, counts and version takes finished steps from it;
tables and pictures show all steps of the folder. Who has changed the code in between starts afresh
with --force.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

from lab.bench.cases.workers import in_order, usable_workers
from lab.bench.commands.chosen import Chosen
from lab.bench.records.kept import keep_rows, kept_rows
from lab.bench.stability import pages as listed
from lab.bench.stability.report import write_results
from lab.bench.stability.sheets import Step
from lab.bench.stability.trials import CRASHED, REFUSED, Page, Trial, Tried, TriedPage, TriedStep
from toonset import __version__
from toonset.errors import BundleError, ToonsetError
from toonset.write import write_bytes

STEPS, PICTURES = "steps.json", "pictures"
WRITTEN = (STEPS, PICTURES, "pages.csv", "stability.png", "records.json", "report.html")
SHEETS, QUICK_SHEETS = 8, 2  # per step of calibration
BODIES, QUICK_BODIES = 3, 1  # per step of training and palettes

Plan = Sequence[tuple[Page, Step]]
Steps = dict[tuple[str, str], tuple[Trial, ...]]  # by page and step


@dataclass(frozen=True)
class Key:
    """Key of finished steps: sheets for a step of cameras, bodies for the others."""

    version: str
    seed: int
    sheets: int
    bodies: int

    def count(self, page: Page) -> int:
        """Return how many sheets a step of the page has."""
        return self.sheets if page.kind.many else self.bodies


def sweep_into(
    folder: Path, chosen: Chosen, *, force: bool, progress: Callable[[str], None]
) -> list[TriedPage]:
    """Return all pages of the folder, after running the chosen steps that it lacks.

    Raises:
        ToonsetError: no page of that name, or a folder that may not be written or continued.
    """
    picked = [page for page in listed.PAGES if chosen.only in page.name]
    if not picked:
        names = ", ".join(page.name for page in listed.PAGES)
        raise BundleError(f"no page's name contains {chosen.only!r}; --only takes one of {names}")
    quick, count = chosen.quick, chosen.count
    plan = [(page, step) for page in picked for step in (page.quick if quick else page.steps)]
    usual = (QUICK_SHEETS, QUICK_BODIES) if quick else (SHEETS, BODIES)
    key = Key(__version__, chosen.seed, *(usual if count is None else (count, count)))
    kept = folder / STEPS
    done = dict(kept_rows(kept, asdict(key), _read, WRITTEN, force=force))
    missing = [(page, step) for page, step in plan if (page.name, str(step)) not in done]
    for page, step, (trials, picture) in run_steps(missing, key, usable_workers(), progress):
        if picture:
            write_bytes(picture_of(folder, page.name, str(step)), picture)
        done[page.name, str(step)] = trials
        keep_rows(kept, asdict(key), _plain(done))
    pages = tried_pages(done)
    about = f"{key.sheets} sheets, {key.bodies} trainings or palettes per step"
    pictures = {name: picture_of(folder, *name) for name in done}
    write_results(folder, pages, f"first seed {key.seed}; {about}", key.seed, pictures)
    return pages


def run_steps(
    plan: Plan, key: Key, workers: int = 1, progress: Callable[[str], None] = lambda text: None
) -> Iterator[tuple[Page, Step, Tried]]:
    """Yield the trials of a step and a PNG of its worst one, in order, as soon as it is done."""
    jobs = [(page.name, step, key.seed + i) for page, step in plan for i in range(key.count(page))]
    done = in_order(run_job, jobs, min(workers, len(jobs)))
    for number, (page, step) in enumerate(plan, start=1):
        progress(f"{number} of {len(plan)}: {page.name} {step}")
        found = list(islice(done, key.count(page)))
        _, worst = max(found, key=lambda one: max(page.kind.badness(t) for t in one[0]))
        yield page, step, (tuple(trial for trials, _ in found for trial in trials), worst)


def run_job(job: tuple[str, Step, int]) -> Tried:
    """Return what became of one sheet, by its page's name, step and seed, and a picture of it."""
    name, step, seed = job
    page = next(page for page in listed.PAGES if page.name == name)
    if step == page.base:
        return _base_tried(page.kind.subject, seed)
    return _tried(page, step, seed)


@cache
def _base_tried(subject: str, seed: int) -> Tried:
    own = (p for p in listed.PAGES if p.kind.subject == subject and p.base is not None)
    page = next(own)
    return _tried(page, page.reference, seed)


def _tried(page: Page, step: Step, seed: int) -> Tried:
    """Return what became of a sheet: a refusal and an exception are results, too."""
    try:
        return page.kind.attempt(lambda: page.draw(step, seed), seed)
    except ToonsetError as error:
        voice, words = REFUSED, str(error)
    except Exception as error:
        voice, words = CRASHED, f"{type(error).__name__}: {error}"
    return (Trial(seed, page.kind.worst, voice, words),), b""


def tried_pages(done: Steps) -> list[TriedPage]:
    """Return the pages of which there are results, steps as listed.

    A page whose values are relative is left out without the step that they are relative to.
    """
    found = []
    for page in listed.PAGES:
        own = {str(s): done[page.name, str(s)] for s in page.steps if (page.name, str(s)) in done}
        if page.kind.relative and own:
            clean = {trial.seed: trial.value for trial in own.get(str(page.reference), ())}
            own = {
                step: tuple(replace(t, value=t.value - clean[t.seed]) for t in trials)
                for step, trials in own.items()
                if clean
            }
        if own:
            found.append(TriedPage(page, tuple(TriedStep(*one) for one in own.items())))
    return found


def picture_of(folder: Path, page: str, step: str) -> Path:
    """Return where the picture of a step's worst trial is kept."""
    return folder / PICTURES / f"{page}-{step}.png".replace(" ", "-")


def _plain(done: Steps) -> list[dict[str, Any]]:
    return [
        {"page": page, "step": step, "trials": [asdict(trial) for trial in trials]}
        for (page, step), trials in done.items()
    ]


def _read(row: Any) -> tuple[tuple[str, str], tuple[Trial, ...]]:
    return (row["page"], row["step"]), tuple(Trial(**trial) for trial in row["trials"])
