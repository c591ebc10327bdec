"""Charts of cost against merit: the front, where the default stands, labels, files, the page."""

from __future__ import annotations

import csv
import io
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from bench.calib.baselines import BASELINES
from bench.calib.measure import METHODS as CALIB_METHODS
from bench.calib.sfm import METHODS as SFM_METHODS
from bench.charts.chart import Chart
from bench.charts.drawing import chart_figure, draw_chart
from bench.charts.labels import Box, Label, place_labels
from bench.charts.points import PLOTS, SECOND, charts_of, points_of
from bench.palette.methods import METHODS as PALETTE_METHODS
from bench.records.pareto import Point, Standing, pareto_front, standing_of
from bench.records.record import Record
from bench.train.plan import METHODS as TRAIN_METHODS
from tests.bench.records import record


def point(method: str, cost: float, merit: float, **given: float) -> Point:
    """Return a point; further arguments are the merit by case."""
    return Point(method, cost, merit, merit, 2, by_case=given)


def chart(*points: Point, lower_is_better: bool = False) -> Chart:
    unit = "deg" if lower_is_better else "dB"
    names = ("train", "exact 150 px", points, "PSNR", unit, "CPU seconds", "CPU s", "mean")
    return Chart(*names, "n = 2; seed 0; a machine.", lower_is_better)


def crowd(count: int, seed: int) -> Chart:
    """Return a chart of so many methods, most of them in one spot."""
    rng = np.random.default_rng(seed)
    costs = 10 * np.exp(rng.normal(scale=0.02, size=count))
    merits = 30 + rng.normal(scale=0.02, size=count)
    costs[:3], merits[:3] = (1, 5, 400), (20, 25, 31)
    names = ["default", *(f"without the step {i}" for i in range(1, count))]
    return chart(*(point(n, c, m) for n, c, m in zip(names, costs, merits, strict=True)))


# ---- the front


@pytest.mark.parametrize("lower_is_better", [True, False])
def test_the_front_is_what_nothing_dominates(lower_is_better: bool) -> None:
    rng = np.random.default_rng(3)
    points = [
        point(str(i), float(cost), float(merit))
        for i, (cost, merit) in enumerate(rng.integers(0, 6, (40, 2)))
    ]
    sign = 1 if lower_is_better else -1
    places = {(p.cost, sign * p.merit) for p in points}
    best = {(c, m) for c, m in places if not any(a <= c and b <= m for a, b in places - {(c, m)})}
    front = pareto_front(points, lower_is_better=lower_is_better)
    assert {(p.cost, sign * p.merit) for p in front} == best
    assert len(front) == len(best)  # of equals, one
    assert [p.cost for p in front] == sorted(p.cost for p in front)


def test_of_equals_the_first_is_on_the_front_and_the_dearer_is_not() -> None:
    points = [point("a", 1, 30), point("b", 1, 30), point("c", 2, 30), point("d", 2, 31)]
    assert [p.method for p in pareto_front(points, lower_is_better=False)] == ["a", "d"]


def test_what_is_set_aside_beats_nobody() -> None:
    told = replace(point("told", 1, 40), aside="told the answer")
    points = (told, point("default", 2, 30))
    assert [p.method for p in pareto_front(points, lower_is_better=False)] == ["default"]
    standing = standing_of(points, lower_is_better=False)
    assert standing is not None
    assert standing.rival is None
    assert standing_of([told], lower_is_better=False) is None


# ---- where the default stands


def standing(default: Point, *others: Point) -> Standing:
    found = standing_of([default, *others], lower_is_better=False)
    assert found is not None
    return found


def test_the_default_on_the_front() -> None:
    found = standing(point("default", 2, 30), point("fast", 1, 29), point("good", 3, 31))
    assert found.rival is None
    assert found.sentence("dB").startswith("The default is on the Pareto front")
    assert found.headline("PSNR", "dB", "s") == "default: 30.00 dB in 2 s, on the Pareto front"
    assert found.headline("F1", "", "s").startswith("default: F1 30.0 in 2 s")


def test_the_default_behind_by_less_than_noise_and_by_more() -> None:
    default = point("default", 2, 30, a=30, b=30, c=30)
    scattered = point("fast", 1, 30.1, a=30.4, b=29.6, c=30.3)
    steady = replace(scattered, by_case={"a": 30.1, "b": 30.09, "c": 30.11})
    noisy, clear = standing(default, scattered), standing(default, steady)
    assert noisy.noise == pytest.approx(np.std([0.4, -0.4, 0.3], ddof=1) / np.sqrt(3))
    assert noisy.within_noise
    assert not clear.within_noise
    assert "0.1 dB behind the Pareto front (fast, at 0.50 of its cost): within" in noisy.sentence(
        "dB"
    )
    assert "more than noise, paired standard error 0.0058 dB over 3 cases" in clear.sentence("dB")
    assert "level with the Pareto front" in noisy.headline("PSNR", "dB", "s")
    assert "0.1 dB behind the Pareto front" in clear.headline("PSNR", "dB", "s")


def test_one_shared_case_says_nothing_of_noise_and_a_tie_is_level() -> None:
    default = point("default", 2, 30, a=30, b=31)
    alone = standing(default, point("fast", 1, 30.5, a=30.5))
    assert (alone.noise, alone.within_noise, alone.cases) == (None, False, 1)
    assert "fewer than two cases" in alone.sentence("dB")
    tie = standing(default, point("fast", 1, 30, a=30))
    assert tie.within_noise
    assert "as good: level with fast, at 0.50 of its cost" in tie.sentence("dB")


# ---- labels


@pytest.mark.parametrize("seed", range(4))
def test_labels_cover_neither_each_other_nor_a_marker(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = Box(0, 0, 900, 500)
    spots = np.concatenate([rng.normal((300, 250), 12, (14, 2)), rng.uniform(60, 440, (8, 2))])
    labels = [Label(float(x), float(y), 6, 110, 13) for x, y in spots]
    taken = [Box(700, 0, 900, 20)]
    boxes = place_labels(labels, room, taken=taken)
    for one, other in combinations([*boxes, *taken], 2):
        assert not one.overlaps(other)
    for box in boxes:
        assert room.holds(box)
        assert not any(box.overlaps(label.marker) for label in labels)


def test_a_lone_label_is_beside_its_point_and_off_the_line() -> None:
    label = Label(100, 100, 5, 50, 10)
    line = Box(100, 99, 300, 101)
    (box,) = place_labels([label], Box(0, 0, 300, 200), lines=[line])
    x, y = box.nearest(label.x, label.y)
    assert np.hypot(x - label.x, y - label.y) < 20
    assert not box.overlaps(line)


def test_a_line_crosses_a_box_or_passes_it() -> None:
    box = Box(10, 10, 20, 20)
    assert box.is_crossed((0, 0), (30, 30))
    assert box.is_crossed((15, 0), (15, 30))
    assert not box.is_crossed((0, 0), (9, 9))
    assert not box.is_crossed((25, 0), (25, 30))
    assert not box.is_crossed((0, 15), (30, 45))


@pytest.mark.parametrize("seed", range(2))
def test_names_in_a_drawn_chart_do_not_overlap(seed: int) -> None:
    figure = chart_figure(crowd(18, seed))
    figure.canvas.draw()  # puts every text where it belongs
    (axes,) = figure.axes
    named = [text for text in axes.texts if text.get_text().startswith(("default", "without"))]
    assert len(named) == 18
    extents = [Text.get_window_extent(text) for text in named]  # without leaders
    boxes = [Box(e.x0 + 1, e.y0 + 1, e.x1 - 1, e.y1 - 1) for e in extents]
    for one, other in combinations(boxes, 2):
        assert not one.overlaps(other)


# ---- pictures and tables


def test_png_and_svg_are_of_one_figure_and_repeat() -> None:
    shown = chart(point("default", 2, 30), point("fast", 1, 29), point("nothing", 0, 10))
    svg = draw_chart(shown, "svg")
    assert svg == draw_chart(shown, "svg")
    root = ElementTree.fromstring(svg)
    words = {
        "".join(element.itertext()).strip() for element in root.iter() if "text" in element.tag
    }
    assert {"default  30.00", "fast  29.00", shown.headline} <= words  # text, not outlines
    assert any("nothing, at no cost: 10.00 dB" in word for word in words)
    assert b"dc:date" not in svg
    png = Image.open(io.BytesIO(draw_chart(shown)))
    colors = np.asarray(png.convert("RGB")).reshape(-1, 3).astype(int)
    for color in ((0xD5, 0x5E, 0x00), (0x00, 0x72, 0xB2)):  # the default, the front
        assert (np.abs(colors - color).max(axis=1) < 8).sum() > 50
    assert draw_chart(chart(*shown.points[:2])) != draw_chart(shown)


def test_errors_of_zero_and_a_lone_free_method_can_be_drawn() -> None:
    zero = chart(point("default", 2, 0.0), point("slow", 3, 1.0), lower_is_better=True)
    alone = chart(point("nothing", 0, 10))
    for shown in (zero, alone):
        assert Image.open(io.BytesIO(draw_chart(shown))).width > 500
    assert alone.headline == "exact 150 px"


def test_the_csv_has_a_row_per_method_cheapest_first() -> None:
    sized = replace(point("default", 2, 30.5), parameters=700)
    told = replace(point("told", 1, 40), aside="told, all")
    rows = list(csv.DictReader(io.StringIO(chart(sized, told, point("slow", 3, 30)).csv())))
    assert [row["method"] for row in rows] == ["told", "default", "slow"]
    assert [row["on_front"] for row in rows] == ["False", "True", "False"]
    assert (rows[1]["cost"], rows[1]["merit"], rows[1]["parameters"]) == ("2", "30.5", "700")
    assert (rows[0]["parameters"], rows[0]["not_compared_because"]) == ("", "told, all")


# ---- from records


def test_fewer_cases_are_set_aside_where_the_default_says_that_they_would_be() -> None:
    records = [
        record("held-out PSNR", "default", {"easy": 34.0, "hard": 26.0}),
        record("CPU seconds", "default", {"easy": 4.0, "hard": 12.0}),
        record("held-out PSNR", "mlp", {"easy": 33.0}),
        record("CPU seconds", "mlp", {"easy": 40.0}),
        record("parameters", "mlp", {"easy": 80.0}),
        record("held-out PSNR", "unfinished", {"easy": 33.0}),
    ]
    default, mlp = points_of(records, PLOTS["train"])
    assert (default.cost, default.merit, default.aside) == (8, 30, "")
    assert (mlp.cost, mlp.merit) == (80, 29)  # ten times the default's, and 1 dB less
    assert (mlp.aside, mlp.parameters, mlp.n) == ("1 of 2 characters", 80, 1)


def test_methods_that_are_told_more_are_there_and_set_aside() -> None:
    assert set(PLOTS["calib"].told) <= {*CALIB_METHODS, *SFM_METHODS, *BASELINES}
    assert {name for name, m in CALIB_METHODS.items() if m.labels} <= set(PLOTS["calib"].told)
    assert set(SFM_METHODS) <= set(PLOTS["calib"].told)
    given = {name for name, m in TRAIN_METHODS.items() if m.palette == "hand-picked palette"}
    shown = {name for name, m in TRAIN_METHODS.items() if m.mannequin}
    assert set(PLOTS["train"].told) == given | shown
    assert set(PLOTS["palette"].told) == {m for m in PALETTE_METHODS if "true k" in m}


def test_colours_are_pooled_over_conditions_per_size_of_sheet() -> None:
    records = [
        record("F1 of colours", "default", {"a": 0.9, "b": 1.0}, "png"),
        record("F1 of colours", "default", {"a": 0.5, "b": 0.8}, "jpeg"),
        record("CPU seconds", "default", {"": 0.1}, "150 x 150"),
        record("CPU seconds", "default", {"": 0.4}, "1200 x 600"),
    ]
    small, large = charts_of("palette", records, "seed 0")
    assert (small.group, large.group) == ("150 x 150", "1200 x 600")
    (only,) = large.points
    assert (only.cost, only.n) == (0.4, 4)
    assert only.merit == pytest.approx(0.8)
    assert "n = 4 drawings of all sizes and kinds; seed 0" in large.caption


def test_captions_say_where_methods_have_fewer_trainings_than_the_default() -> None:
    def records(seeds: int) -> list[Record]:
        psnr = [
            record("held-out PSNR", name, {"a": 30.0, "b": 31.0}) for name in ("default", "mlp")
        ]
        seconds = [record("CPU seconds", name, {"a": 3.0, "b": 3.0}) for name in ("default", "mlp")]
        return [replace(psnr[0], n=2 * seeds), psnr[1], *seconds]

    (chart, *_) = charts_of("train", records(3), "seeds 0, 1, 2")
    assert "n = 6 trainings of 2 characters, 2 of some methods; seeds 0, 1, 2" in chart.caption
    (chart, *_) = charts_of("train", records(1), "seed 0")
    assert "n = 2 trainings of 2 characters; seed 0" in chart.caption


def test_a_second_chart_has_quality_against_model_size() -> None:
    of = {
        "default": (30.0, 600.0),
        "finest planes": (30.1, 900.0),
        "without palette": (29.0, 600.0),
    }
    records = [
        record(metric, method, {"a": value})
        for method, values in of.items()
        for metric, value in zip(("held-out PSNR", "model size"), values, strict=True)
    ]
    records += [record("CPU seconds", "default", {"a": 9.0})]
    first, second = charts_of("train", records, "seed 0")
    assert (first.group, second.group) == ("exact", "exact, model size")
    assert {p.method: (p.merit, p.cost) for p in second.points} == {
        name: of[name] for name in ("default", "finest planes")
    }
    assert second.cost_unit == "kB"
    assert set(SECOND["train"].only) <= set(TRAIN_METHODS)


def test_what_left_out_nothing_is_told_by_the_run_that_is_shared() -> None:
    figures = {"default": 30.2, "without symmetry": 30.0, "without both": 30.0, "voxel": 30.0}
    records = [record("held-out PSNR", name, {"a": psnr}) for name, psnr in figures.items()]
    records += [record("CPU seconds", name, {"a": 9.0}) for name in figures]
    chart = charts_of("train", records, "seeds 0, 1, 2")[0]
    assert chart.same == ("without symmetry", "without both")
    assert [p.method for p in chart.points] == ["default", "voxel"]


def test_what_left_out_nothing_is_named_and_not_drawn() -> None:
    figures = {"default": 30.0, "without symmetry": 30.0, "without fairing": 29.0, "voxel": 30.0}
    records = [record("held-out PSNR", name, {"a": psnr}) for name, psnr in figures.items()]
    records += [record("CPU seconds", name, {"a": 9.0}) for name in figures]
    chart = charts_of("train", records, "seed 0")[0]
    assert [p.method for p in chart.points] == ["default", "without fairing", "voxel"]
    assert (
        "The same runs as the default, with nothing to leave out: without symmetry." in chart.notes
    )
