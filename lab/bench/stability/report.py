"""The sweeps as tables, one picture, and one page: a section per way of failing, summary first."""

from __future__ import annotations

import shlex
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np

from lab.bench.records.drawing import Steps, draw_steps
from lab.bench.records.record import as_dicts, machine
from lab.bench.records.report import figure, report_html, section, table
from lab.bench.stability.trials import (
    HEAD,
    SUMMED,
    UNJUDGED,
    TriedPage,
    TriedStep,
    as_records,
    fails_from,
    share_text,
    shares,
    summary_csv,
    summary_rows,
    tally,
)
from toonset.write import write_bytes, write_json

TITLE = "How toonset fails, and whether it says so"

Pictures = Mapping[tuple[str, str], Path]  # by page and step


def write_results(
    folder: Path, pages: Sequence[TriedPage], about: str, seed: int, pictures: Pictures
) -> None:
    """Write all that is made of the pages: tables, the picture of all, the page of them."""
    about = f"{about}; {machine()}"
    shown = {name: path.read_bytes() for name, path in pictures.items() if path.is_file()}
    write_bytes(folder / "report.html", sweep_html(pages, about, shown).encode())
    write_bytes(folder / "pages.csv", summary_csv(pages))
    write_json(folder / "records.json", as_dicts(as_records(pages, seed)))
    if pages:
        write_bytes(folder / "stability.png", draw_steps([_steps(p) for p in pages], about))


def sweep_html(
    pages: Sequence[TriedPage], about: str, pictures: Mapping[tuple[str, str], bytes]
) -> str:
    """Return the page; steps without a picture have none."""
    rules = dict.fromkeys(page.kind.rule for page in pages)
    often = (
        "A page fails from the first step at which more than a tenth of the trials fail. "
        "The clean sheet that pages share counts once for all of them."
    )
    rows = [
        ("default" if row[0].startswith(SUMMED) else "", [escape(cell) for cell in row])
        for row in summary_rows(pages)
    ]
    summary = section("All pages", *(f"<p>{escape(t)}</p>" for t in (*rules, often)))
    command = shlex.join(["python", "-m", "lab.bench", *sys.argv[1:]])
    sections = [summary, table(HEAD, rows), *(_section(page, pictures) for page in pages)]
    return report_html(TITLE, command, about, sections)


def _section(page: TriedPage, pictures: Mapping[tuple[str, str], bytes]) -> str:
    name, kind = page.page.name, page.kind
    curve = figure(draw_steps([_steps(page)], form="svg"), f"{name}: {kind.value} by step")
    shown = "".join(
        figure(pictures[name, step.step], f"the worst of {step.step}", _caption(page, step))
        for step in page.steps
        if (name, step.step) in pictures
    )
    strip = f'<p>Below: {escape(kind.pictures)}</p><div class="strip">{shown}</div>' * bool(shown)
    return section(name, f"<p>{escape(_verdict(page))}</p>", curve, strip, _steps_table(page))


def _steps(page: TriedPage) -> Steps:
    kind = page.kind
    return Steps(
        page.page.name,
        page.page.axis,
        [step.step for step in page.steps],
        [[trial.value for trial in step.trials] for step in page.steps],
        [shares(step, kind) for step in page.steps],
        kind.fine,
        kind.failed,
        f"{kind.value}, {kind.unit}",
        kind.logarithmic,
    )


def _caption(page: TriedPage, step: TriedStep) -> str:
    trial = max(step.trials, key=page.kind.badness)
    said = f"; {trial.voice}" if trial.voice != UNJUDGED else ""
    return f"{step.step}: {trial.value:.1f} {page.kind.unit}{said}"


def _verdict(page: TriedPage) -> str:
    """Return where the page fails, and whether that is said there, in a sentence."""
    first = fails_from(page)
    if first is None:
        return f"Fails nowhere: at no step more than a tenth of the {page.kind.trials}."
    found = tally(first.trials, page.kind)
    said = f"{found.announced} of them announced" if found.judged else "without a verdict"
    failed = f"{found.failed} of {found.n} {page.kind.trials}"
    return f"Fails from {first.step} on: there {failed} fail, {said}."


def _steps_table(page: TriedPage) -> str:
    head = (page.page.axis, "n", "failed", "median", "p95", "announced", "false alarms", "said")
    rows = []
    for step in page.steps:
        found, values = tally(step.trials, page.kind), [trial.value for trial in step.trials]
        voices = Counter(trial.voice for trial in step.trials if trial.voice != UNJUDGED)
        worst = max(step.trials, key=page.kind.badness).words
        said = ", ".join(f"{count} {voice}" for voice, count in voices.most_common())
        cells = (
            *(step.step, str(found.n), str(found.failed)),
            *(f"{np.median(values):.2f}", f"{np.percentile(values, 95):.2f}"),
            share_text(found.announced, found.judged),
            share_text(found.alarms, found.fine),
            f"{said}; {worst}" if worst else said,
        )
        rows.append(("", [escape(cell) for cell in cells]))
    return table(head, rows)
