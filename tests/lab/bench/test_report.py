"""The page of a bench's results, and the files beside it."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import pytest

from lab.bench.records.chart import Chart, Point
from lab.bench.records.drawing import draw_chart
from lab.bench.records.report import chart_section, figure, records_section, report_html, section
from tests.lab.bench.records import record


def test_the_page_holds_all_and_needs_nothing_else() -> None:
    points = (Point("default", 2, 30, 29, 1), Point("fast & <small>", 1, 31, 28, 1))
    names = ("train", "exact", points, "PSNR", "dB", "CPU seconds", "CPU s", "n = 1.")
    shown = Chart(*names, lower_is_better=False)
    records = [record("held-out PSNR", "default", {"a": 30.25}), record("GMSD", "other", {"a": 2})]
    sections = [
        chart_section(shown, draw_chart(shown, "svg")),
        section("other", figure(draw_chart(shown), 'what "it" shows', "a <caption>")),
        records_section(records),
    ]
    page = report_html("a page", "python -m lab.bench train -o 'a b'", "seed 0", sections)
    kinds = re.findall('<img alt="[^"]+" src="(data:image/[a-z+]*);', page)
    assert kinds == ["data:image/svg+xml", "data:image/png"]
    assert page.count("<table") == 2
    assert not re.search("<script|<link|<iframe|<svg|<caption>|& <small>", page)
    assert 'alt="what &quot;it&quot; shows"' in page
    words = html.unescape(re.sub("<[^>]*>", "", page))
    for said in ("python -m lab.bench train -o 'a b'", "30.25", "GMSD (dB)", "a <caption>"):
        assert said in words
    assert "Where the default loses:fast & <small>: 1.00 dB better at 0.50" in words


def test_a_bench_writes_charts_in_three_forms_and_the_page(
    bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    records = [
        record(metric, method, by_case, group)
        for method in ("default", "extcolors")
        for metric, by_case, group in (
            ("F1 of colours", {"a": 0.9}, "png"),
            ("CPU seconds", {"": 0.1}, "150 x 150"),
        )
    ]
    monkeypatch.setattr(
        "lab.bench.palette.measure.bench_palette", lambda *_, **__: (records, "table")
    )
    out = tmp_path / "out"
    done = bench("palette", "-o", out)
    assert done.code == 0, done
    assert f"look at {out / 'report.html'}" in done.err
    assert {path.name for path in out.iterdir()} == {
        "records.json",
        "report.html",
        *(f"chart-150-x-150.{form}" for form in ("png", "svg", "csv")),
    }
    kept = json.loads((out / "records.json").read_text())
    assert kept[0]["by_case"] == {"a": 0.9}
    assert f"python -m lab.bench palette -o {out}" in html.unescape(
        (out / "report.html").read_text()
    )
    assert bench("palette", "-o", out, "--force", "--quiet").code == 0
