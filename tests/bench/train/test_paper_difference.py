"""Palette minus no palette: what is paired, the interval, verdicts, what is said and drawn."""

from __future__ import annotations

import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from bench.paper.chart import draw_differences
from bench.paper.difference import (
    Difference,
    as_csv,
    as_table,
    claim,
    differences_of,
    student_interval,
)
from bench.train.run import RunResult

GROUP = "exact 150 px 8 views"


def run(palette: str, case: str, seed: int = 0, steps: int = 200, **figures: float) -> RunResult:
    method = f"paper, {palette}, {steps} steps"
    return RunResult(GROUP, method, case, seed, dict(figures), 1.0, 1.0, 0.1, 7, ())


def pair(case: str, gain: float, seed: int = 0, steps: int = 200) -> list[RunResult]:
    """Return trainings without and with a palette, this much better in all that is measured."""
    psnr, flip = 20.0 + len(case), 0.05
    better = {"psnr": psnr + gain, "flip": flip - gain / 100}
    after = {f"palette_{name}": value for name, value in better.items()}
    return [
        run("no palette", case, seed, steps, psnr=psnr, flip=flip),
        run("automatic palette", case, seed, steps, **better, **after),
    ]


def of(runs: list[RunResult], metric: str = "psnr", layer: str = "field") -> Difference:
    (one,) = (d for d in differences_of(runs) if (d.metric, d.layer) == (metric, layer))
    return one


def test_the_interval_is_students() -> None:
    interval = student_interval([1.0, 2.0, 3.0])
    assert interval == pytest.approx((2 - 2.4841377, 2 + 2.4841377))  # 4.3026527 / sqrt(3)
    assert student_interval([1.0]) is None
    assert student_interval([0.5, 0.5]) == (0.5, 0.5)


def test_the_interval_holds_the_true_mean_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    held = [
        low < 0.3 < high
        for samples in rng.normal(0.3, 2.0, (4000, 5))
        for low, high in [student_interval(samples.tolist()) or (0.0, 0.0)]
    ]
    assert np.mean(held) == pytest.approx(0.95, abs=0.012)


def test_characters_are_the_unit_and_seeds_are_averaged_first() -> None:
    runs = [*pair("a", 1.0), *pair("a", 3.0, seed=1), *pair("bb", 4.0)]
    found = of(runs)
    assert found.by_case == pytest.approx({"a": 2.0, "bb": 4.0})
    assert (found.n, found.seeds, found.mean) == (2, 1, pytest.approx(3.0))


def test_only_what_both_have_is_compared() -> None:
    alone = run("automatic palette", "a", 1, psnr=90.0)
    failed = [replace(one, figures={}, note="no") for one in pair("bb", 50.0)]
    other = [replace(one, group="drawn") for one in pair("a", 9.0)]
    found = differences_of([*pair("a", 1.0), alone, *failed, *other])
    first = [d for d in found if d.group == GROUP]
    assert all(d.by_case.keys() == {"a"} for d in first)
    assert of([*pair("a", 1.0), alone]).mean == pytest.approx(1.0)
    assert {d.mean for d in found if d.group == "drawn" and d.metric == "psnr"} == {9.0}
    assert differences_of([alone]) == []


@pytest.mark.parametrize(
    ("gains", "verdict"),
    [((1.0, 1.1), "better"), ((-1.0, -1.1), "worse"), ((1.0, -1.1), "undecided")],
)
def test_less_is_better_where_it_is_an_error(gains: tuple[float, float], verdict: str) -> None:
    runs = [*pair("a", gains[0]), *pair("bb", gains[1])]
    for metric in ("psnr", "flip"):
        for layer in ("field", "classifier"):
            assert of(runs, metric, layer).verdict == verdict


def test_one_character_decides_nothing() -> None:
    found = of(pair("a", 5.0))
    assert (found.interval, found.verdict) == (None, "undecided")


def test_the_answer_says_where_and_by_how_much() -> None:
    good, bad = [*pair("a", 1.0), *pair("bb", 1.1)], [*pair("a", -1.0), *pair("bb", -1.1)]
    text = claim(differences_of(good))
    assert "before the classifier: yes; 2 better, 0 worse, 0 undecided" in text
    assert "better: PSNR +1.05 (automatic, 200); FLIP -0.0105 (automatic, 200)" in text
    assert "worse:" not in text
    later = [replace(one, method=one.method.replace("200", "2000")) for one in bad]
    text = claim(differences_of([*good, *later]))
    assert "in part; 2 better, 2 worse, 0 undecided" in text
    assert "worse: PSNR -1.05 (automatic, 2000)" in text
    assert "classifier: no; 0 better, 2 worse" in claim(differences_of(bad))
    assert "classifier: undecided; 0 better, 0 worse" in claim(differences_of(pair("a", 5.0)))


def test_the_comparisons_are_tables_and_a_figure() -> None:
    found = differences_of([*pair("a", 1.0), *pair("bb", 1.1), *pair("a", 1.0, steps=2000)])
    read = list(csv.DictReader(io.StringIO(as_csv(found))))
    assert [float(row["mean"]) for row in read] == [d.mean for d in found]
    assert [row["low"] == "" for row in read] == [d.n < 2 for d in found]
    lines = as_table(found).splitlines()
    assert len(lines) == 2 + len(found)
    assert "automatic" in lines[2]
    assert lines[2].split()[-3:] == ["+1.05", "[+0.41,", "+1.69]"]
    drawn = draw_differences(found, "of the test", "svg")
    assert drawn == draw_differences(found, "of the test", "svg")
    for text in (b"after the classifier (n = 1)", b"PSNR, dB (higher is better)", b"of the test"):
        assert text in drawn
    assert b"SSIM" not in drawn
