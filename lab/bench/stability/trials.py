"""What the sweeps count: trials, which of them failed, and what the tool said of them.

A page's trials all have one value, the larger the worse. Above one bound a trial has failed, below
another it is fine; what lies between counts as neither. A failure is announced if the tool raised
an alarm: said anything but its calm words. Raised over a fine trial, it is a false one.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from lab.bench.records.record import Record, Recorder, aligned
from lab.bench.stability.sheets import Step

OFTEN = 0.1  # share of a step's trials from which the step fails
UNJUDGED = ""  # the voice of what says nothing by design
REFUSED, CRASHED = "refused", "crashed"
HEAD = ("page", "fails from", "n", "failed", "announced", "fine", "false alarms")
SUMMED = "all pages"


@dataclass(frozen=True)
class Trial:
    """One thing that was tried: the larger its value, the worse.

    What the tool said is a word (UNJUDGED: it gives no verdict), and the reason that it gave.
    """

    seed: int
    value: float
    voice: str
    words: str = ""


Drawer = Callable[[], Any]
Tried = tuple[tuple[Trial, ...], bytes]  # of one sheet, and a PNG of its worst


@dataclass(frozen=True)
class Kind:
    """Kind of the trials of some pages.

    Attributes:
        subject: e.g. "calibration".
        trials: what one is, in the plural, e.g. "views".
        value: its quantity, e.g. "rotation error".
        unit: of the quantity.
        fine: the value below which all is well.
        failed: the value above which it is not.
        worst: the value where nothing comes out at all.
        calm: what the tool says where it raises no alarm.
        attempt: tries what is drawn, by its seed.
        rule: what fine, failed and announced are, in a sentence or two.
        pictures: what its pictures show.
        logarithmic: whether the value spans powers of ten.
        relative: values are counted from that of the page's first or base step, seed by seed.
        many: sheets are cheap: a step has as many as one of calibration.
    """

    subject: str
    trials: str
    value: str
    unit: str
    fine: float
    failed: float
    worst: float
    calm: tuple[str, ...]
    attempt: Callable[[Drawer, int], Tried]
    rule: str
    pictures: str
    logarithmic: bool = False
    relative: bool = False
    many: bool = False

    def badness(self, trial: Trial) -> tuple[bool, float]:
        """Return what sorts trials by how bad they are: failed in silence before anything else."""
        return trial.value > self.failed and trial.voice in self.calm, trial.value


@dataclass(frozen=True)
class Page:
    """One way of failing: a property of a sheet, in steps from harmless to extreme.

    Attributes:
        kind: of its trials.
        name: for --only and the tables.
        axis: what the steps are, with unit.
        steps: from harmless to extreme.
        base: the step that is its kind's base sheet, tried once for all pages; None: no step is.
        draw: step and seed to what is tried.
    """

    kind: Kind
    name: str
    axis: str
    steps: tuple[Step, ...]
    base: Step | None
    draw: Callable[[Any, int], Any]

    @property
    def quick(self) -> tuple[Step, ...]:
        """Return the steps of a quick run: the first, the middle one, the last, and the base."""
        kept = {0, len(self.steps) // 2, len(self.steps) - 1}
        return tuple(s for i, s in enumerate(self.steps) if i in kept or s == self.base)

    @property
    def reference(self) -> Step:
        """Return the step that others are compared with."""
        return self.steps[0] if self.base is None else self.base


@dataclass(frozen=True)
class TriedStep:
    """All trials of a step, its name in words."""

    step: str
    trials: tuple[Trial, ...]


@dataclass(frozen=True)
class TriedPage:
    """A way of failing and what was found, steps in order."""

    page: Page
    steps: tuple[TriedStep, ...]

    @property
    def kind(self) -> Kind:
        """Return what its trials are."""
        return self.page.kind


@dataclass(frozen=True)
class Tally:
    """All trials counted; failed ones, of these those with a verdict, of these those announced.

    And fine ones with a verdict, of these those that an alarm was raised over.
    """

    n: int
    failed: int
    judged: int
    announced: int
    fine: int
    alarms: int


def tally(trials: Iterable[Trial], kind: Kind) -> Tally:
    """Return the counts of any trials of a kind."""
    trials = list(trials)
    failed = [t for t in trials if t.value > kind.failed]
    judged = [t for t in failed if t.voice != UNJUDGED]
    fine = [t for t in trials if t.value < kind.fine and t.voice != UNJUDGED]
    loud = [sum(t.voice not in kind.calm for t in some) for some in (judged, fine)]
    return Tally(len(trials), len(failed), len(judged), loud[0], len(fine), loud[1])


def shares(step: TriedStep, kind: Kind) -> list[float]:
    """Return the shares of a step's trials, in the order of `bench.records.drawing.FATES`."""
    found = tally(step.trials, kind)
    unjudged = sum(t.value < kind.fine and t.voice == UNJUDGED for t in step.trials)
    between = found.n - found.failed - found.fine - unjudged
    calm, said = found.fine - found.alarms + unjudged, found.announced
    counts = (calm, found.alarms, between, said, found.failed - said)
    return [count / found.n for count in counts]


def all_trials(pages: Iterable[TriedPage]) -> list[Trial]:
    """Return the trials of all steps of some pages; those of their common base sheet only once."""
    trials: list[Trial] = []
    with_base = False
    for page in pages:
        for step in page.steps:
            is_base = step.step == str(page.page.base)
            if not (is_base and with_base):
                trials += step.trials
            with_base |= is_base
    return trials


def fails_from(page: TriedPage) -> TriedStep | None:
    """Return the first step at which more than OFTEN of the trials fail; None: nowhere."""
    for step in page.steps:
        found = tally(step.trials, page.kind)
        if found.failed > OFTEN * found.n:
            return step
    return None


def summary_rows(pages: Sequence[TriedPage]) -> list[tuple[str, ...]]:
    """Return a row per page and one for every kind, as HEAD says."""
    rows = []
    for kind in dict.fromkeys(page.kind.subject for page in pages):
        own = [page for page in pages if page.kind.subject == kind]
        for page in own:
            first = fails_from(page)
            where = "nowhere" if first is None else first.step
            rows.append((page.page.name, where, *_cells(tally(all_trials([page]), page.kind))))
        rows.append((f"{SUMMED}: {kind}", "", *_cells(tally(all_trials(own), own[0].kind))))
    return rows


def summary_text(pages: Sequence[TriedPage]) -> str:
    """Return the pages' rows as an aligned table for people."""
    return "\n".join(aligned([HEAD, *summary_rows(pages)], words=2))


def summary_csv(pages: Sequence[TriedPage]) -> bytes:
    """Return the pages' rows as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([HEAD, *summary_rows(pages)])
    return text.getvalue().encode()


def as_plain(pages: Sequence[TriedPage]) -> list[dict[str, Any]]:
    """Return the pages' counts as plain data; `fails_from` is None where a page fails nowhere."""
    found = [(page, fails_from(page)) for page in pages]
    return [
        {"page": page.page.name, "fails_from": None if first is None else first.step}
        | asdict(tally(all_trials([page]), page.kind))
        for page, first in found
    ]


def as_records(pages: Sequence[TriedPage], seed: int) -> list[Record]:
    """Return values and silent failures of every step in the records' common form."""
    records = []
    for found, step in ((page, step) for page in pages for step in page.steps):
        kind, recorder = found.kind, Recorder(step.step, found.page.name, seed)
        silent = [t.value > kind.failed and t.voice in kind.calm for t in step.trials]
        records += [
            recorder.samples(kind.value, [t.value for t in step.trials], kind.unit),
            recorder.total("failed in silence", silent, kind.trials),
        ]
    return records


def share_text(part: int, whole: int) -> str:
    """Return a share as a percentage with its counts; "-" of nothing."""
    return f"{100 * part / whole:.0f} % ({part} of {whole})" if whole else "-"


def _cells(found: Tally) -> tuple[str, ...]:
    said, alarms = (found.announced, found.judged), (found.alarms, found.fine)
    return str(found.n), str(found.failed), share_text(*said), str(found.fine), share_text(*alarms)
