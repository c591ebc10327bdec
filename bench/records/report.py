"""A bench's results as one page that needs nothing else: charts, captions, figures, all records."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from bench.charts.chart import Chart
from bench.records.pareto import Point, quantity
from bench.records.record import Record

WHOLE = 1e4  # from here on numbers are written without decimals
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 66rem; margin: 2rem auto;
  padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: 0; } h2 { font-size: 1.2rem; margin: 3rem 0 .5rem; }
code { background: #f2f2f2; padding: .1em .3em; overflow-wrap: anywhere; }
figure { margin: 1rem 0; } svg { width: 100%; height: auto; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .2rem .6rem; border-bottom: 1px solid #ddd;
  vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; } th { font-weight: 600; }
.points td:last-child { text-align: left; }
td small { color: #777; display: block; }
tr.default td { font-weight: 600; color: #b34700; } tr.front td:first-child { color: #0072b2; }
@page { margin: 12mm; } @page wide { size: landscape; }
@media print { body { font-size: 9pt; margin: 0; max-width: none; } figure { break-inside: avoid; }
  section { break-before: page; } section:first-of-type { break-before: auto; }
  section.all { page: wide; } .wide { overflow: visible; } tr { break-inside: avoid; }
  .points { font-size: 7.5pt; } .records { font-size: 5.5pt; } th, td { padding: .1rem .25rem; } }
""".strip()


@dataclass(frozen=True)
class Picture:
    """An SVG and what it shows, for those who do not see it."""

    svg: bytes
    shows: str


def report_html(
    command: str,
    version: str,
    charts: Sequence[tuple[Chart, Picture]],
    others: Sequence[Picture],
    records: Sequence[Record],
) -> str:
    """Return the page; no scripts, and nothing is loaded from elsewhere.

    Args:
        command: the command line that made it, its second word the subject.
        version: of toonset.
        charts: with their drawings.
        others: further pictures, which come after the charts.
        records: all that was measured.
    """
    title = escape(" ".join(command.split()[:3]))
    machines = ", ".join(dict.fromkeys(record.machine for record in records))
    seeds = ", ".join(str(seed) for seed in sorted({record.seed for record in records}))
    parts = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>",
        f"<h1>{title}</h1>\n<p><code>{escape(command)}</code><br>",
        f"toonset {escape(version)}; first seed {seeds}; {escape(machines)}</p>",
    ]
    for number, (chart, picture) in enumerate(charts):
        parts += [
            f"<section>\n<h2>{escape(chart.group)}</h2>",
            f"<figure>{inlined(picture, f'chart{number}-')}</figure>",
            _points_table(chart),
            "</section>",
        ]
    for number, picture in enumerate(others):
        parts += [
            f"<section>\n<h2>{escape(picture.shows)}</h2>",
            f"<figure>{inlined(picture, f'other{number}-')}</figure>\n</section>",
        ]
    parts += _record_tables(records)
    return "\n".join([*parts, "</body>\n</html>\n"])


def inlined(picture: Picture, prefix: str) -> str:
    """Return the SVG as an element of a page: names of its parts are no other picture's."""
    svg = picture.svg.decode()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r'\bid="', f'id="{prefix}', svg)
    svg = re.sub(r'(url\(#|href="#)', rf"\g<1>{prefix}", svg)
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(picture.shows)}" ', 1)


def _points_table(chart: Chart) -> str:
    """Return the chart's figures, cheapest first."""
    tail = "p95" if chart.lower_is_better else "p5"
    merit = f"{chart.merit}, {chart.statistic}" + f" ({chart.unit})" * bool(chart.unit)
    head = ("method", merit, tail, "n", chart.cost, "parameters", "")
    front = chart.front
    rows = []
    for p in sorted(chart.points, key=lambda p: p.cost):
        on_front = any(p is f for f in front)
        size = "" if p.parameters is None else f"{p.parameters:,}"
        figures = (quantity(p.merit, ""), quantity(p.spread, ""), str(p.n), f"{p.cost:.3g}", size)
        place = _place(p, on_front)
        kind = "default" if p.method == "default" else "front" if on_front else ""
        rows.append((kind, (escape(p.method), *figures, escape(place))))
    return _table("points", head, rows)


def _place(point: Point, on_front: bool) -> str:
    if point.aside:
        return f"not compared: {point.aside}"
    return "Pareto front" if on_front else "behind it"


def _record_tables(records: Sequence[Record]) -> list[str]:
    """Return a table per group: a row per method, a column per metric, its value over its p95."""
    parts = ['<section class="all">\n<h2>All records</h2>']
    parts.append(
        "<p>A median, count or share, and below it the 95th percentile towards the bad end.</p>"
    )
    for group in dict.fromkeys(record.group for record in records):
        own = [record for record in records if record.group == group]
        found = {(r.method, r.metric): r for r in own}
        metrics = {r.metric: r.unit for r in own}
        units = (f" ({unit})" if unit not in ("", "1") else "" for unit in metrics.values())
        head = ("method", "n", *(m + unit for m, unit in zip(metrics, units, strict=True)))
        rows = []
        for method in dict.fromkeys(r.method for r in own):
            n = max(r.n for r in own if r.method == method)
            cells = [_cell(found.get((method, metric))) for metric in metrics]
            rows.append(("default" * (method == "default"), (escape(method), str(n), *cells)))
        parts += [f"<h3>{escape(group)}</h3>", _table("records", head, rows)]
    return [*parts, "</section>"]


def _cell(record: Record | None) -> str:
    if record is None:
        return ""
    value, tail = (f"{v:,.0f}" if v >= WHOLE else f"{v:.4g}" for v in (record.value, record.p95))
    return f"{value}<small>{tail}</small>"


def _table(kind: str, head: Iterable[str], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Return a table of rows of markup, each with its class."""
    heading = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    lines = [f"<thead><tr>{heading}</tr></thead>", "<tbody>"]
    for name, cells in rows:
        mark = f' class="{name}"' if name else ""
        lines.append(f"<tr{mark}>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>")
    return "\n".join(
        [f'<div class="wide"><table class="{kind}">', *lines, "</tbody>\n</table></div>"]
    )
