"""What an atlas of failures counts: trials, which of them failed, and what the tool said of them.

A page's trials all have one value, the larger the worse. Above one bound a trial has failed, below
another it is fine; what lies between counts as neither. A failure is announced if the tool raised
an alarm: said anything but its calm words. Raised over a fine trial, it is a false one.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from bench.records.record import aligned
from bench.stability.page import Page

OFTEN = 0.1  # share of a step's trials from which the step fails
UNJUDGED = ""  # the voice of what says nothing by design
HEAD = ("page", "fails from", "n", "failed", "announced", "fine", "false alarms")
SUMMED = "all pages"


@dataclass(frozen=True)
class Kind:
    """What the trials of some pages are.

    Attributes:
        subject: e.g. "calibration".
        trials: what one is, in the plural, e.g. "views".
        value: its quantity, e.g. "rotation error".
        unit: of the quantity.
        fine: the value below which all is well.
        failed: the value above which it is not.
        voices: what the tool may say, with its colour; the first says that all is well.
        logarithmic: whether the value spans powers of ten.
        informs: voices besides the first that are no alarm.
    """

    subject: str
    trials: str
    value: str
    unit: str
    fine: float
    failed: float
    voices: Mapping[str, str]
    logarithmic: bool = False
    informs: tuple[str, ...] = ()

    def is_calm(self, voice: str) -> bool:
        """Return whether a voice raises no alarm."""
        return voice in (next(iter(self.voices)), *self.informs)


@dataclass(frozen=True)
class Trial:
    """One thing that was tried.

    Attributes:
        sheet: number of its sheet; spreads are over sheets.
        value: the larger the worse.
        voice: one of the kind's, or UNJUDGED.
        words: the reason that the tool gave, if any.
    """

    sheet: int
    value: float
    voice: str
    words: str = ""


@dataclass(frozen=True)
class TriedStep:
    """All trials of a step."""

    step: str
    trials: tuple[Trial, ...]


@dataclass(frozen=True)
class TriedPage:
    """A way of failing and what was found, steps in order."""

    page: Page
    kind: Kind
    steps: tuple[TriedStep, ...]


@dataclass(frozen=True)
class Tally:
    """Trials counted.

    Attributes:
        n: all.
        failed: beyond the kind's bound.
        judged: of these, those that the tool gives a verdict on.
        announced: of these, those that it raised an alarm over.
        fine: within the kind's bound, with a verdict.
        alarms: of these, those that it raised an alarm over.
    """

    n: int
    failed: int
    judged: int
    announced: int
    fine: int
    alarms: int

    @property
    def announced_share(self) -> float | None:
        """Return announced over judged failures; None without any."""
        return self.announced / self.judged if self.judged else None

    @property
    def alarm_share(self) -> float | None:
        """Return false alarms over fine trials; None without any."""
        return self.alarms / self.fine if self.fine else None


def tally(trials: Iterable[Trial], kind: Kind) -> Tally:
    """Return the counts of any trials of a kind."""
    trials = list(trials)
    failed = [t for t in trials if t.value > kind.failed]
    judged = [t for t in failed if t.voice != UNJUDGED]
    fine = [t for t in trials if t.value < kind.fine and t.voice != UNJUDGED]
    loud = [[t for t in some if not kind.is_calm(t.voice)] for some in (judged, fine)]
    return Tally(len(trials), len(failed), len(judged), len(loud[0]), len(fine), len(loud[1]))


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


def by_sheet(step: TriedStep) -> list[float]:
    """Return the median value of every sheet."""
    sheets = sorted({trial.sheet for trial in step.trials})
    return [float(np.median([t.value for t in step.trials if t.sheet == s])) for s in sheets]


def commonest_words(trials: Sequence[Trial]) -> tuple[str, int]:
    """Return what was said most often, and how often; numbers in it are the first one's."""
    said = [trial.words for trial in trials if trial.words]
    if not said:
        return "", 0
    counts = Counter(map(_without_numbers, said))
    common, count = counts.most_common(1)[0]
    return next(words for words in said if _without_numbers(words) == common), count


def summary_rows(pages: Sequence[TriedPage]) -> list[tuple[str, ...]]:
    """Return a row per page and one for every kind, as HEAD says."""
    rows = []
    for kind in dict.fromkeys(page.kind.subject for page in pages):
        own = [page for page in pages if page.kind.subject == kind]
        for page in own:
            first = fails_from(page)
            where = "nowhere" if first is None else first.step
            rows.append((page.page.name, where, *_cells(tally(all_trials([page]), page.kind))))
        found = tally(all_trials(own), own[0].kind)
        rows.append((f"{SUMMED}: {kind}", "", *_cells(found)))
    return rows


def summary_text(pages: Sequence[TriedPage]) -> str:
    """Return the pages' rows as an aligned table for people."""
    return "\n".join(aligned([HEAD, *summary_rows(pages)], words=2))


def summary_csv(pages: Sequence[TriedPage]) -> bytes:
    """Return the pages' rows as CSV, shares as counts only."""
    text = io.StringIO()
    rows = as_plain(pages)
    writer = csv.DictWriter(text, rows[0] if rows else (), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def as_plain(pages: Sequence[TriedPage]) -> list[dict[str, Any]]:
    """Return the pages' counts as plain data; `fails_from` is None where a page fails nowhere."""
    rows = []
    for page in pages:
        first, found = fails_from(page), tally(all_trials([page]), page.kind)
        where = None if first is None else first.step
        named = {"page": page.page.name, "subject": page.kind.subject, "fails_from": where}
        rows.append(named | asdict(found))
    return rows


def share_text(part: int, whole: int) -> str:
    """Return a share as a percentage with its counts; "-" of nothing."""
    return f"{100 * part / whole:.0f} % ({part} of {whole})" if whole else "-"


def _cells(found: Tally) -> tuple[str, ...]:
    return (
        str(found.n),
        str(found.failed),
        share_text(found.announced, found.judged),
        str(found.fine),
        share_text(found.alarms, found.fine),
    )


def _without_numbers(words: str) -> str:
    return "".join(letter for letter in words if not letter.isdigit())
