"""Curves of held-out PSNR against CPU seconds: their mean, and the figure."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from bench.train.chart import draw_curves, mean_curve
from bench.train.plan import NEAREST
from bench.train.run import RunResult, Seen


def result(method: str, *curve: Seen) -> RunResult:
    """Return a training's result; its figures do not matter here."""
    end = curve[-1].seconds
    return RunResult("exact 150 px 8 views", method, "a", 0, {}, end, end, 0.1, 7, curve)


def test_mean_curves() -> None:
    slow = [Seen(5, 2, 10.0), Seen(9, 8, 30.0)]  # busy with other things at first
    fast = [Seen(1, 1, 20.0), Seen(70, 4, 40.0)]
    mean = mean_curve([slow, fast])
    assert mean[0] == pytest.approx((2, (10 + 30) / 2))  # from where both have begun
    assert mean[-1] == pytest.approx((8, (30 + 40) / 2))  # the faster one stays at its end
    assert dict(mean_curve([[Seen(0, 0, 5.0)]])) == {0.1: 5.0}
    rising = [psnr for _, psnr in mean]
    assert rising == sorted(rising)


def test_the_figure_has_a_panel_per_condition() -> None:
    one = [result(NEAREST, Seen(0, 0, 18.0)), result("default", Seen(1, 1, 20), Seen(4, 4, 30))]
    others = [replace(run, group=f"drawn {n}") for n in range(3) for run in one]
    small = Image.open(io.BytesIO(draw_curves(one, "n")))
    large = Image.open(io.BytesIO(draw_curves([*one, *others], "n")))
    assert large.width > small.width
    assert large.height > 1.5 * small.height
    line = np.asarray(small.convert("RGB")).reshape(-1, 3).astype(int)
    vermilion = np.abs(line - (0xD5, 0x5E, 0x00)).max(axis=1) < 60  # the default's curve
    assert vermilion.sum() > 200
