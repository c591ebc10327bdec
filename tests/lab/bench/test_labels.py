"""The labels benchmark measures what it says: a perfect labeller scores 100, and truth is truth."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pytest

from lab.bench.palette import labels as bench
from lab.bench.palette.labels import bench_labels
from lab.bench.palette.labels_cases import LabelCase, label_cases
from toonset.palette.pixels.labels import UNLABELLED


@pytest.fixture(scope="module")
def cases() -> list[LabelCase]:
    return list(label_cases(None, 0, quick=True))


def test_truth_is_the_colour_of_every_pure_pixel(cases: list[LabelCase]) -> None:
    assert {case.group for case in cases} == {
        f"150 px, {lines}, {kind}"
        for lines in ("lines", "no lines")
        for kind in ("png", "jpeg 90", "jpeg 80")
    }
    for case in cases:
        pure = case.truth != UNLABELLED
        away = np.abs(case.rgba[pure][:, :3].astype(int) - case.palette[case.truth[pure]])
        assert away.max() == 0 if "png" in case.group else np.median(away) < 8


def _always(labels: np.ndarray) -> bench.Labeller:
    return lambda rgba, palette: labels


def test_a_perfect_labeller_scores_100(cases: list[LabelCase]) -> None:
    samples: bench.Samples = defaultdict(list)
    for case in cases:
        bench._score_labels(samples, case, "perfect", _always(case.truth))
        if case.outline_px:
            bench._score_contour(samples, case, "perfect", case.ink)
    assert any(metric == "contour recall" for _, _, metric in samples)
    for (_, _, metric), values in samples.items():
        assert all(value == 100 for value in values), metric


@pytest.mark.slow
def test_the_bars_of_clean_drawings() -> None:
    records, text = bench_labels(None, 7, quick=True)
    own = {r.metric: r.median for r in records if r.method == "default" and "png" in r.group}
    assert own["right"] >= 99.5
    assert own["mixed, recall"] >= 90
    assert own["mixed, precision"] >= 90
    assert "line precis" in text
