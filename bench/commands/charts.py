"""What a bench writes for every subject: records, charts in four forms, one page of all."""

from __future__ import annotations

import json
import re
import shlex
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from toonset import __version__

if TYPE_CHECKING:
    from bench.records.record import Record
    from bench.records.report import Picture

RECORDS, REPORT = "records.json", "report.html"
WRITTEN = (RECORDS, REPORT, "chart-*.png", "chart-*.svg", "chart-*.csv")


def result_files(
    subject: str, records: list[Record], seeds: str, others: Sequence[Picture] = ()
) -> dict[str, bytes]:
    """Return records.json, a chart per group as PNG, SVG and CSV, and report.html, by name.

    Args:
        subject: what was measured; not all have charts.
        records: what was found.
        seeds: as captions have them, e.g. "seed 0".
        others: further pictures for the page.
    """
    from bench.charts.drawing import draw_chart
    from bench.charts.points import PLOTS, charts_of
    from bench.records.record import as_dicts
    from bench.records.report import Picture, report_html

    files = {RECORDS: (json.dumps(as_dicts(records), indent=2, allow_nan=False) + "\n").encode()}
    drawn = []
    for chart in charts_of(subject, records, seeds) if subject in PLOTS else []:
        name = f"chart-{file_name(chart.group)}"
        drawing = draw_chart(chart, "svg")
        files |= {f"{name}.png": draw_chart(chart), f"{name}.svg": drawing}
        files[f"{name}.csv"] = chart.csv().encode()
        drawn.append((chart, Picture(drawing, " ".join([chart.headline + ".", *chart.notes]))))
    command = shlex.join(["python", "-m", "bench", *sys.argv[1:]])
    files[REPORT] = report_html(command, __version__, drawn, others, records).encode()
    return files


def file_name(text: str) -> str:
    """Return the text without what file names should not have."""
    return re.sub(r"[^\w.-]+", "-", text)
