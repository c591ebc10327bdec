"""The charts of `toonset bench`: accuracy against seconds, PNG by file name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toonset.cli.bench_chosen import Chosen

if TYPE_CHECKING:
    from toonset.bench.chart import Point
    from toonset.bench.record import Record

CHARTED = ("rotation error modulo twin", "yaw error")
COLORS_FOUND = "F1 of colours"
LEAST_S = 1e-3  # a chart's time axis is logarithmic


def charts_by_group(chosen: Chosen, records: list[Record]) -> dict[str, bytes]:
    """Return a chart per condition whose records have both an accuracy and seconds."""
    from toonset.bench.chart import Point

    charts = {}
    for group in dict.fromkeys(record.group for record in records):
        own = [record for record in records if record.group == group]
        seconds = {r.method: r.median for r in own if r.metric == "seconds"}
        merits = [r for r in own if r.metric in CHARTED]
        if not merits:
            continue
        points = [Point(r.method, max(seconds[r.method], LEAST_S), r.median, r.p95) for r in merits]
        charts[_file_name(group)] = _chart(
            chosen,
            points,
            title=f"{group}: median, whisker to p95",
            labels=(
                "seconds per sheet",
                f"{merits[0].metric} ({merits[0].unit})",
            ),
            n=merits[0].n,
            lower_is_better=merits[0].direction == "lower",
        )
    return charts


def charts_of_colors(chosen: Chosen, records: list[Record]) -> dict[str, bytes]:
    """Return a chart per sheet size: colours found under all conditions against seconds."""
    from toonset.bench.chart import Point

    found: dict[str, list[Record]] = {}
    for record in records:
        if record.metric == COLORS_FOUND:
            found.setdefault(record.method, []).append(record)
    charts = {}
    for size in dict.fromkeys(r.group for r in records if r.metric == "seconds"):
        seconds = {r.method: r.value for r in records if r.metric == "seconds" and r.group == size}
        points = []
        for method, conditions in found.items():
            values = [record.value for record in conditions]
            mean = sum(values) / len(values)
            points.append(Point(method, max(seconds[method], LEAST_S), mean, min(values)))
        charts[_file_name(size)] = _chart(
            chosen,
            points,
            title=f"{size}: mean of all conditions, whisker to the worst",
            labels=("seconds per sheet", COLORS_FOUND),
            n=sum(record.n for record in next(iter(found.values()))),
            lower_is_better=False,
        )
    return charts


def _chart(
    chosen: Chosen,
    points: list[Point],
    *,
    title: str,
    labels: tuple[str, str],
    n: int,
    lower_is_better: bool,
) -> bytes:
    from toonset.bench.chart import draw_chart
    from toonset.bench.record import machine

    return draw_chart(
        points,
        title=f"toonset bench {chosen.subject.value}, {title}",
        cost_label=labels[0],
        merit_label=labels[1],
        caption=f"n = {n}, seed {chosen.seed}, {machine()}",
        lower_is_better=lower_is_better,
    )


def _file_name(group: str) -> str:
    return f"chart-{group.replace(' ', '-').replace(',', '')}.png"
