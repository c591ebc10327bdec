"""Results as one page that needs nothing else: the template of all reports of the bench."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape

from lab.bench.records.chart import Chart, quantity
from lab.bench.records.record import DEFAULT, Record
from toonset import __version__

WHOLE = 1e4  # from here on numbers are written without decimals
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 66rem; margin: 2rem auto;
  padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: 0; } h2 { font-size: 1.2rem; margin: 3rem 0 .5rem; }
code { background: #f2f2f2; padding: .1em .3em; overflow-wrap: anywhere; }
figure { margin: 1rem 0; } img { max-width: 100%; } figcaption { font-size: .85rem; color: #444; }
.strip { display: flex; flex-wrap: wrap; gap: .8rem; } .strip figure { margin: 0; width: 9rem; }
.loss { border-left: 4px solid #d55e00; padding-left: 1rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .2rem .6rem; border-bottom: 1px solid #ddd;
  vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; } th { font-weight: 600; }
td small { color: #777; display: block; }
tr.default td { font-weight: 600; color: #b34700; } tr.front td:first-child { color: #0072b2; }
@media print { body { font-size: 9pt; margin: 0; max-width: none; } figure { break-inside: avoid; }
  section { break-before: page; } .wide { overflow: visible; } table { font-size: 6.5pt; } }
""".strip()


def report_html(title: str, command: str, about: str, sections: Iterable[str]) -> str:
    """Return the page; no scripts, and nothing is loaded from elsewhere.

    Args:
        title: of the page.
        command: the command line that made it.
        about: seeds, counts, machine.
        sections: markup, of `section`.
    """
    parts = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>",
        f"<h1>{escape(title)}</h1>\n<p><code>{escape(command)}</code><br>",
        f"toonset {escape(__version__)}; {escape(about)}</p>",
    ]
    return "\n".join([*parts, *sections, "</body>\n</html>\n"])


def section(title: str, *parts: str) -> str:
    """Return a section of markup under its title."""
    return "\n".join([f"<section>\n<h2>{escape(title)}</h2>", *parts, "</section>"])


def figure(data: bytes, shows: str, caption: str = "") -> str:
    """Return a PNG or SVG as an element of the page, with what it shows in words."""
    kind = "png" if data.startswith(b"\x89PNG") else "svg+xml"
    image = f'<img alt="{escape(shows)}" src="data:image/{kind};base64,{b64encode(data).decode()}">'
    below = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return f"<figure>{image}{below}</figure>"


def table(head: Iterable[str], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Return a table of rows of markup, each with its class."""
    heading = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    lines = [f"<thead><tr>{heading}</tr></thead>", "<tbody>"]
    for name, cells in rows:
        mark = f' class="{name}"' if name else ""
        lines.append(f"<tr{mark}>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>")
    return "\n".join(['<div class="wide"><table>', *lines, "</tbody>\n</table></div>"])


def chart_section(chart: Chart, drawing: bytes) -> str:
    """Return a chart with its figures and, where the default loses, to what and why it stays."""
    losses = "".join(f"<li>{escape(loss)}</li>" for loss in chart.losses)
    loss = f'<div class="loss"><p>Where the default loses:</p><ul>{losses}</ul></div>'
    shows = " ".join([f"{chart.headline}.", *chart.notes])
    return section(
        chart.group, figure(drawing, shows), loss if losses else "", _points_table(chart)
    )


def records_section(records: Sequence[Record]) -> str:
    """Return a table per group: a row per method, a column per metric, its value over its p95."""
    parts = [
        "<p>A median, count or share, and below it the 95th percentile towards the bad end.</p>"
    ]
    for group in dict.fromkeys(record.group for record in records):
        own = [record for record in records if record.group == group]
        found = {(r.method, r.metric): r for r in own}
        metrics = {r.metric: f" ({r.unit})" * (r.unit not in ("", "1")) for r in own}
        head = ("method", "n", *(metric + unit for metric, unit in metrics.items()))
        rows = []
        for method in dict.fromkeys(r.method for r in own):
            n = max(r.n for r in own if r.method == method)
            cells = [_cell(found.get((method, metric))) for metric in metrics]
            rows.append((DEFAULT * (method == DEFAULT), (escape(method), str(n), *cells)))
        parts += [f"<h3>{escape(group)}</h3>", table(head, rows)]
    return section("All records", *parts)


def _points_table(chart: Chart) -> str:
    """Return the chart's figures, cheapest first."""
    tail = "p95" if chart.lower_is_better else "p5"
    merit = chart.merit + f" ({chart.unit})" * bool(chart.unit)
    rows = []
    for p in sorted(chart.points, key=lambda p: p.cost):
        on_front = any(p is f for f in chart.front)
        figures = (quantity(p.merit, ""), quantity(p.spread, ""), str(p.n), f"{p.cost:.3g}")
        place = "Pareto front" if on_front else "behind it"
        place = f"not compared: {p.aside}" if p.aside else place
        kind = DEFAULT if p.method == DEFAULT else "front" * on_front
        rows.append((kind, (escape(p.method), *figures, escape(place))))
    return table(("method", merit, tail, "n", chart.cost, ""), rows)


def _cell(record: Record | None) -> str:
    if record is None:
        return ""
    value, tail = (f"{v:,.0f}" if v >= WHOLE else f"{v:.4g}" for v in (record.value, record.p95))
    return f"{value}<small>{tail}</small>"
