"""The page of a bench's results, and the files beside it."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from pathlib import Path

import pytest

from bench.charts.chart import Chart
from bench.charts.drawing import draw_chart
from bench.records.pareto import Point
from bench.records.report import Picture, inlined, report_html
from tests.bench.records import record


class Page(HTMLParser):
    """A page's elements, ids and words; unclosed elements fail."""

    VOID = ("meta", "br")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        self.ids += [value or "" for name, value in attrs if name == "id"]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data.strip())


def test_the_page_holds_all_and_needs_nothing_else() -> None:
    points = (Point("default", 2, 30, 29, 1), Point("fast & <small>", 1, 29, 28, 1))
    names = ("train", "exact", points, "PSNR", "dB", "CPU seconds", "CPU s", "mean", "n = 1.")
    shown = Chart(*names, lower_is_better=False)
    picture = Picture(draw_chart(shown, "svg"), 'what "it" shows')
    records = [record("held-out PSNR", "default", {"a": 30.25}), record("GMSD", "other", {"a": 2})]
    page = report_html(
        "python -m bench train -o 'a b'", "1.2", [(shown, picture), (shown, picture)], [], records
    )
    found = Page(page)
    tags = [tag for tag, _ in found.seen]
    assert tags.count("svg") == 2
    assert tags.count("table") == 3
    assert not {"script", "img", "link", "iframe"} & set(tags)
    assert len(set(found.ids)) == len(found.ids)
    targets = {v for _, attrs in found.seen for k, v in attrs.items() if k == "xlink:href" and v}
    assert targets
    assert {target[1:] for target in targets} <= set(found.ids)
    assert {"python -m bench train -o 'a b'", "fast & <small>", "30.25", "GMSD (dB)"} <= set(
        found.words
    )
    assert any("toonset 1.2; first seed 0" in word for word in found.words)
    assert 'aria-label="what &quot;it&quot; shows"' in inlined(picture, "x-")


def test_a_bench_writes_charts_in_four_forms_and_the_page(
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
    monkeypatch.setattr("bench.palette.measure.bench_palette", lambda *_, **__: (records, "table"))
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
    assert f"python -m bench palette -o {out}" in Page((out / "report.html").read_text()).words
    assert bench("palette", "-o", out, "--force", "--quiet").code == 0
