"""Charts of cost against merit: the front, where the default loses, the files, the table."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from lab.bench.calib.baselines import BASELINES
from lab.bench.calib.measure import METHODS as CALIB_METHODS
from lab.bench.look.measure import LOOKS
from lab.bench.palette.labels import CONTOURS, LABELLERS
from lab.bench.palette.methods import METHODS as PALETTE_METHODS
from lab.bench.records.chart import PLOTS, Chart, Point, charts_of, points_of
from lab.bench.records.drawing import Panel, draw_chart, draw_panels, draw_scatter
from lab.bench.records.methods import METHODS
from lab.bench.split.methods import METHODS as SPLIT_METHODS
from lab.bench.train.plan import METHODS as TRAIN_METHODS
from tests.lab.bench.records import record


def point(method: str, cost: float, merit: float, **given: float) -> Point:
    """Return a point; further arguments are the merit by case."""
    return Point(method, cost, merit, merit, 2, by_case=given)


def chart(*points: Point, lower_is_better: bool = False) -> Chart:
    unit = "deg" if lower_is_better else "dB"
    names = ("train", "exact 150 px", points, "PSNR", unit, "CPU seconds", "CPU s")
    return Chart(*names, "Mean; n = 2; seed 0; a machine.", lower_is_better)


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
    front = chart(*points, lower_is_better=lower_is_better).front
    assert {(p.cost, sign * p.merit) for p in front} == best
    assert len(front) == len(best)  # of equals, one
    assert [p.cost for p in front] == sorted(p.cost for p in front)


def test_of_equals_the_first_is_on_the_front_and_the_dearer_is_not() -> None:
    points = [point("a", 1, 30), point("b", 1, 30), point("c", 2, 30), point("d", 2, 31)]
    assert [p.method for p in chart(*points).front] == ["a", "d"]


def test_what_is_set_aside_beats_nobody() -> None:
    told = replace(point("told", 1, 40), aside="told the answer")
    shown = chart(told, point("default", 2, 30))
    assert [p.method for p in shown.front] == ["default"]
    assert shown.losses == []
    assert chart(told).default is None
    assert chart(told).headline == "exact 150 px"


# ---- where the default loses


def test_a_default_that_nothing_dominates_loses_to_nobody() -> None:
    shown = chart(point("default", 2, 30), point("fast", 1, 29), point("good", 3, 31))
    assert shown.losses == []
    assert shown.headline == "default: 30.00 dB in 2 CPU s, on the Pareto front"


def test_a_default_that_loses_says_to_what_by_how_much_and_why() -> None:
    default = point("default", 2, 30, a=30, b=30, c=30)
    steady = point("without smoothing", 1, 30.1, a=30.1, b=30.09, c=30.11)
    noisy = point("unheard of", 1.5, 30.2, a=31.4, b=28.6, c=30.6)
    shown = chart(default, steady, noisy)
    assert shown.headline.endswith("loses to unheard of")
    unknown, known = shown.losses
    assert unknown.startswith(
        "unheard of: 0.200 dB better at 0.75 of the cost, within its standard"
    )
    assert unknown.endswith("over 3 cases. No reason is known.")
    assert "more than its standard error of 0.00577 dB over 3 cases. Ahead on plain" in known
    assert known.endswith(f"{METHODS['train']['without smoothing'].why[1:]}.")
    alone = chart(replace(default, by_case={"a": 30.0}), replace(steady, by_case={"a": 30.1}))
    assert "standard error" not in alone.losses[0]


def test_every_method_that_is_known_is_run_somewhere() -> None:
    run = {
        "calib": {*CALIB_METHODS, *BASELINES},
        "train": set(TRAIN_METHODS),
        "look": set(LOOKS),
        "palette": set(PALETTE_METHODS),
        "labels": {*LABELLERS, *CONTOURS},
        "split": set(SPLIT_METHODS),
    }
    assert run.keys() == METHODS.keys() == PLOTS.keys()
    for subject, known in METHODS.items():
        assert set(known) <= run[subject], subject
    told = {name for known in METHODS.values() for name, entry in known.items() if entry.told}
    assert {name for name in BASELINES if name.startswith("PnP")} < told
    assert {name for name, method in CALIB_METHODS.items() if method.labels} < told
    given = {n for n, method in TRAIN_METHODS.items() if method.palette == "hand-picked palette"}
    assert given < told
    assert {name for name in PALETTE_METHODS if "true k" in name} < told


# ---- pictures and tables


def test_png_and_svg_are_of_one_figure_and_repeat() -> None:
    shown = chart(point("default", 2, 30), point("fast", 1, 29), point("nothing", 0, 10))
    svg = draw_chart(shown, "svg")
    assert svg == draw_chart(shown, "svg")
    root = ElementTree.fromstring(svg)
    words = {
        "".join(element.itertext()).strip() for element in root.iter() if "text" in element.tag
    }
    assert {"default  30.00", "fast  29.00", "nothing  10.00, no cost", shown.headline} <= words
    assert b"dc:date" not in svg
    png = Image.open(io.BytesIO(draw_chart(shown)))
    colors = np.asarray(png.convert("RGB")).reshape(-1, 3).astype(int)
    assert (np.abs(colors - (0xD5, 0x5E, 0x00)).max(axis=1) < 8).sum() > 50  # the default
    assert draw_chart(chart(*shown.points[:2])) != draw_chart(shown)
    zero = chart(point("default", 2, 0.0), point("slow", 3, 1.0), lower_is_better=True)
    for lone in (zero, chart(point("nothing", 0, 10))):  # logarithms of neither
        assert Image.open(io.BytesIO(draw_chart(lone))).width > 500


def test_panels_and_scatters_have_a_legend_of_all() -> None:
    panels = [
        Panel("FLIP", {"default": [(1, 0.2)], "field": [(2, 0.3)], "nothing": [(0.0, 0.5)]}),
        Panel("curves", {"default": [(1, 20), (2, 30)]}, ideal=31),
    ]
    svg = draw_panels(panels, ("seconds", ""), 2, "svg").decode()
    assert all(word in svg for word in ("FLIP", "curves", "default", "field", "nothing"))
    scatter = draw_scatter({"a": [(1, 2)], "b": [(2, 1)]}, ("x", "y"), (1.5, "ok | weak"), (1, 2))
    assert scatter.startswith(b"\x89PNG")


# ---- from records


def test_fewer_cases_are_set_aside() -> None:
    records = [
        record("held-out PSNR", "default", {"easy": 34.0, "hard": 26.0}),
        record("CPU seconds", "default", {"easy": 4.0, "hard": 12.0}),
        record("held-out PSNR", "mlp", {"easy": 33.0}),
        record("CPU seconds", "mlp", {"easy": 40.0}),
        record("held-out PSNR", "unfinished", {"easy": 33.0}),
    ]
    default, mlp = points_of(records, PLOTS["train"])
    assert (default.cost, default.merit, default.aside) == (8, 30, "")
    assert (mlp.cost, mlp.merit, mlp.aside, mlp.n) == (40, 33, "1 of 2 characters", 1)


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
