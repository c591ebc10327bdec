"""The atlas as one page that needs nothing else: a section per way of failing, summary first."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from bench.atlas.chart import draw_page
from bench.atlas.figures import (
    HEAD,
    SUMMED,
    UNJUDGED,
    Kind,
    Trial,
    TriedPage,
    TriedStep,
    by_sheet,
    commonest_words,
    fails_from,
    share_text,
    summary_rows,
    tally,
)
from bench.records.report import STYLE, Picture, inlined

MORE_STYLE = """
.pair { display: flex; flex-wrap: wrap; gap: 1.5rem; align-items: flex-start; margin: 1rem 0; }
.pair .curve { flex: 1 1 34rem; min-width: 20rem; } .pair figure { margin: 0; }
.pair .worst { flex: 0 1 22rem; } .worst img { max-width: 100%; border: 1px solid #ddd; }
figcaption { font-size: .85rem; color: #444; }
.strip { display: flex; flex-wrap: wrap; gap: .8rem; } .strip figure { margin: 0; width: 9rem; }
.strip img { max-width: 100%; max-height: 8rem; border: 1px solid #ddd; }
.summary tr.sum td { font-weight: 600; border-top: 2px solid #444; }
.summary td:nth-child(2), .steps td:last-child, .steps th:last-child { text-align: left; }
.steps { margin-top: 1rem; } .steps td:nth-child(-n+8) { white-space: nowrap; }
nav { columns: 3; font-size: .9rem; }
""".strip()
KEYS = {
    "calibration": "Pictures: the worst view of a step, its mannequin's outline as it is in blue, "
    "as it was found in vermilion.",
    "training": "Pictures: the worst held-out view of a step: as it should be, as it was rendered, "
    "and where these differ.",
    "look": "Pictures: the held-out view of a step where the drawn layer is worst beside the "
    "field: as it should be, from the drawings, from the field.",
    "labels": "Pictures: the worst drawing of a step, its labels in the palette's colours (grey: "
    "none), and what is wrong in vermilion.",
    "paints": "Pictures: as on the pages about labels.",
    "palette": "Pictures: a drawing, the colours that were to be found, the palette that was.",
}
RULES = {
    "calibration": "A view is fine within 5 degrees of the truth and has failed beyond 15; it is "
    "announced if its verdict is not ok.",
    "training": "A training is fine if its worst held-out view looks as if moved by less than "
    "0.8 % of the height more than with the same body's clean scene (FLIP over that of a move by "
    "a pixel), and has failed beyond 1.1 %; it is announced if train refused or called the run "
    "weak. What it set right it says, too, but that is no alarm.",
    "look": "The drawn layer has failed where its FLIP over all held-out views is above the "
    "field's, and is fine where it is at least 5 % below; it gives no verdict of itself.",
    "labels": "Of the pixels that are one paint's alone, fewer than 5 % are wrong on a fine sheet "
    "and more than 10 % on one that has failed; it is announced by a warning of the palette's.",
    "paints": "The palette of a fine sheet has an F1 of 0.9 or more, one below 0.75 has failed; it "
    "is announced by a warning of the palette's.",
    "palette": "A palette has failed that lacks one of the colours; it is announced if that colour "
    "is listed as left out, the number of colours is called a close call, or there is a warning.",
}

Pictures = Mapping[tuple[str, str], bytes]  # PNG by page and step


def atlas_html(
    command: str, version: str, about: str, pages: Sequence[TriedPage], pictures: Pictures
) -> str:
    """Return the page; no scripts, and nothing is loaded from elsewhere.

    Args:
        command: the command line that made it.
        version: of toonset.
        about: seeds, counts, machine.
        pages: what was found.
        pictures: the worst trial of every step; those that are missing are left out.
    """
    title = "How toonset fails, and whether it says so"
    links = "".join(f'<a href="#{_anchor(p)}">{escape(p.page.name)}</a><br>' for p in pages)
    parts = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}</title>\n<style>\n{STYLE}\n{MORE_STYLE}\n</style>\n</head>\n<body>",
        f"<h1>{title}</h1>\n<p><code>{escape(command)}</code><br>",
        f"toonset {escape(version)}; {escape(about)}</p>",
        f"<section>\n<nav>{links}</nav>",
        *(f"<p>{escape(RULES[kind])}</p>" for kind in _subjects(pages)),
        "<p>A page fails from the first step at which more than a tenth of the trials fail. "
        "The clean sheet that pages share counts once for all of them.</p>",
        _summary(pages),
        "</section>",
        *(_section(number, page, pictures) for number, page in enumerate(pages)),
    ]
    return "\n".join([*parts, "</body>\n</html>\n"])


def _subjects(pages: Sequence[TriedPage]) -> list[str]:
    return list(dict.fromkeys(page.kind.subject for page in pages))


def _anchor(page: TriedPage) -> str:
    return page.page.name.replace(" ", "-")


def _summary(pages: Sequence[TriedPage]) -> str:
    rows = [
        ("sum" if row[0].startswith(SUMMED) else "", [escape(cell) for cell in row])
        for row in summary_rows(pages)
    ]
    return _table("summary", HEAD, rows)


def _section(number: int, page: TriedPage, pictures: Pictures) -> str:
    lead = "" if page.page.name.startswith(page.kind.subject[:5]) else f"{page.kind.subject}: "
    name = escape(lead + page.page.name)
    curve = Picture(draw_page(page), f"{page.page.name}: {page.kind.value} by {page.page.axis}")
    shown = [step for step in page.steps if pictures.get((page.page.name, step.step))]
    parts = [
        f'<section id="{_anchor(page)}">\n<h2>{name}</h2>',
        f"<p>{escape(page.page.about)} {escape(_verdict(page))}</p>",
        f'<div class="pair"><figure class="curve">{inlined(curve, f"page{number}-")}</figure>',
    ]
    if shown:
        worst = max(shown, key=lambda step: badness(worst_trial(step, page.kind), page.kind))
        parts.append(_figure("worst", page, worst, pictures, "Worst case: "))
    parts.append("</div>")
    if shown:
        figures = "".join(_figure("", page, step, pictures) for step in shown)
        parts.append(f"<p><small>{escape(KEYS[page.kind.subject])}</small></p>")
        parts.append(f'<div class="strip">{figures}</div>')
    return "\n".join([*parts, _steps_table(page), "</section>"])


def badness(trial: Trial, kind: Kind) -> tuple[bool, float]:
    """Return what sorts trials by how bad they are: failed in silence before anything else."""
    return trial.value > kind.failed and kind.is_calm(trial.voice), trial.value


def worst_trial(step: TriedStep, kind: Kind) -> Trial:
    """Return the trial of a step that is to be looked at."""
    return max(step.trials, key=lambda trial: badness(trial, kind))


def _figure(kind: str, page: TriedPage, step: TriedStep, pictures: Pictures, lead: str = "") -> str:
    data = base64.b64encode(pictures[page.page.name, step.step]).decode()
    trial = worst_trial(step, page.kind)
    said = f"; {trial.voice}" if trial.voice != UNJUDGED else ""
    words = f': "{trial.words}"' if trial.words and lead else ""
    axis, what = (f"{page.page.axis}: ", f"{page.kind.value} ") if lead else ("", "")
    caption = f"{lead}{axis}{step.step}; {what}{trial.value:.1f} {page.kind.unit}{said}{words}"
    return (
        f'<figure class="{kind}"><img alt="" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


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
    kind = page.kind
    unit = f", {kind.unit}"
    head = (
        *(page.page.axis, "n", "failed", f"median{unit}", "95th percentile", "sheets' medians"),
        *("announced", "false alarms", "said", "most often"),
    )
    rows = []
    for step in page.steps:
        found, values = tally(step.trials, kind), [trial.value for trial in step.trials]
        low, high = min(by_sheet(step)), max(by_sheet(step))
        voices = Counter(trial.voice for trial in step.trials)
        said = ", ".join(f"{voices[voice]} {voice}" for voice in kind.voices if voices[voice])
        words, count = commonest_words(step.trials)
        cells = (
            *(step.step, str(found.n), str(found.failed)),
            *(f"{np.median(values):.2f}", f"{np.percentile(values, 95):.2f}"),
            f"{low:.2f} to {high:.2f}",
            share_text(found.announced, found.judged),
            share_text(found.alarms, found.fine),
            said,
            f"{words} ({count})" if words else "",
        )
        rows.append(("", [escape(cell) for cell in cells]))
    return _table("steps", head, rows)


def _table(kind: str, head: Sequence[str], rows: Sequence[tuple[str, Sequence[str]]]) -> str:
    heading = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    lines = []
    for name, cells in rows:
        mark = f' class="{name}"' if name else ""
        lines.append(f"<tr{mark}>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>")
    return "\n".join(
        [
            f'<div class="wide"><table class="{kind}"><thead><tr>{heading}</tr></thead><tbody>',
            *lines,
            "</tbody></table></div>",
        ]
    )
