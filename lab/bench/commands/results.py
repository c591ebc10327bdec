"""What a bench writes for every subject: records, charts in three forms, one page of all."""

from __future__ import annotations

import json
import re
import shlex
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lab.bench.records.record import Record

RECORDS, REPORT = "records.json", "report.html"
WRITTEN = (RECORDS, REPORT, "chart-*.png", "chart-*.svg", "chart-*.csv")


def result_files(
    subject: str, records: list[Record], seeds: str, others: Mapping[str, bytes] | None = None
) -> dict[str, bytes]:
    """Return records.json, a chart per group as PNG, SVG and CSV, and report.html, by name.

    Args:
        subject: what was measured.
        records: what was found.
        seeds: as captions have them, e.g. "seed 0".
        others: further pictures for the page, by what they show.
    """
    from lab.bench.records.chart import charts_of
    from lab.bench.records.drawing import draw_chart
    from lab.bench.records.record import as_dicts, machine
    from lab.bench.records.report import (
        chart_section,
        figure,
        records_section,
        report_html,
        section,
    )

    files = {RECORDS: (json.dumps(as_dicts(records), indent=2, allow_nan=False) + "\n").encode()}
    sections = []
    for chart in charts_of(subject, records, seeds):
        name, drawing = f"chart-{file_name(chart.group)}", draw_chart(chart, "svg")
        files |= {f"{name}.png": draw_chart(chart), f"{name}.svg": drawing}
        files[f"{name}.csv"] = chart.csv().encode()
        sections.append(chart_section(chart, drawing))
    sections += [section(shows, figure(data, shows)) for shows, data in (others or {}).items()]
    sections.append(records_section(records))
    command = shlex.join(["python", "-m", "lab.bench", *sys.argv[1:]])
    page = report_html(f"python -m lab.bench {subject}", command, f"{seeds}; {machine()}", sections)
    files[REPORT] = page.encode()
    return files


def file_name(text: str) -> str:
    """Return the text without what file names should not have."""
    return re.sub(r"[^\w.-]+", "-", text)
