"""The bench of the verdict: sheets have the fault that they are named for, counts are right."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.verdict import sheets
from bench.verdict.curve import BAD, FINE, count, draw_curve, rank_correlation, table
from bench.verdict.measure import Judged, by_pixel
from bench.verdict.sheets import FAULTS, draw_sheet
from toonset.nerf.score.verdict import OK, WEAK

BY_NAME = {fault.name: fault for fault in FAULTS}


@pytest.fixture(autouse=True)
def small_sheets(monkeypatch):
    monkeypatch.setattr(sheets, "SHEET", replace(sheets.SHEET, cell_px=48, supersample=1))


def drawn(name: str) -> list[np.ndarray]:
    return [frame.rgba for frame in draw_sheet(BY_NAME[name], 3)[0].frames]


def test_held_out_views_are_true_whatever_is_wrong() -> None:
    _, test = draw_sheet(BY_NAME["warp 3"], 3)
    _, other = draw_sheet(BY_NAME["flipped"], 3)
    assert len(test.frames) == 12
    for a, b in zip(test.frames, other.frames, strict=True):
        np.testing.assert_array_equal(a.rgba, b.rgba)
    exact, _ = draw_sheet(BY_NAME["exact"], 3)
    for a, b in zip(exact.frames, test.frames, strict=False):  # from the drawn sides first
        np.testing.assert_allclose(a.camera.rotation, b.camera.rotation, atol=1e-9)
        assert (a.rgba != b.rgba).mean() < 0.05  # a hair of the scale apart


@pytest.mark.parametrize("name", ["flipped", "other colours"])
def test_one_drawing_is_odd(name: str) -> None:
    pairs = list(zip(drawn(name), drawn("warp 0.9"), strict=True))
    assert sum(a.shape != b.shape or bool((a != b).any()) for a, b in pairs) == 1


def test_cameras_are_turned_either_way_by_as_much() -> None:
    usual, turned = (draw_sheet(BY_NAME[name], 3)[0] for name in ("warp 0.9", "yaw 10 all"))
    angles = [
        b.camera.angles[0] - a.camera.angles[0]
        for a, b in zip(usual.frames, turned.frames, strict=True)
    ]
    angles = [(angle + math.pi) % (2 * math.pi) - math.pi for angle in angles]
    np.testing.assert_allclose(np.abs(angles), math.radians(10))
    assert sum(angles) == pytest.approx(0, abs=1e-9)


def test_a_shadow_is_darker_and_on_one_side() -> None:
    for lit, shaded in zip(drawn("exact"), drawn("shaded exact"), strict=True):
        change = lit[..., :3].astype(int).sum(axis=-1) - shaded[..., :3].astype(int).sum(axis=-1)
        assert change.min() >= -3
        assert 0.02 < (change > 30).mean() / (lit[..., 3] > 0).mean() < 0.6


def test_half_as_large_drawings_show_the_same() -> None:
    small, _ = draw_sheet(BY_NAME["60 px"], 3)
    usual, _ = draw_sheet(BY_NAME["warp 0.9"], 3)
    for a, b in zip(small.frames, usual.frames, strict=True):
        assert a.rgba.shape[0] == round(b.rgba.shape[0] / 2)
        pixels = [frame.camera.project(np.array([[0.1, 1.0, 0.0]]))[0] for frame in (a, b)]
        np.testing.assert_allclose(2 * pixels[0], pixels[1], atol=1.0)


def judged(name: str, verdict: str, off: float, look: float) -> Judged:
    return Judged(name, verdict, (), 0, {"a": off / 2, "b": off}, (0.05,), (look / 2, look))


def test_missed_and_false_alarms_are_counted_beside_what_is_neither() -> None:
    found = [
        judged("good", OK, 0.01, 0.5 * FINE),
        judged("alarm", WEAK, 0.03, 0.9 * FINE),
        judged("between", WEAK, 0.03, (FINE + BAD) / 2),
        judged("bad", WEAK, 0.03, 1.1 * BAD),
        judged("missed", OK, 0.01, 2 * BAD),
    ]
    counted = count(found)
    assert (counted.n, counted.bad, counted.missed) == (5, 2, 1)
    assert (counted.fine, counted.alarms) == (2, 1)
    text = table(found)
    assert "2 look bad" in text
    assert "1 missed" in text
    assert text.index("good") < text.index("alarm") < text.index("missed")
    assert draw_curve({"all": found}).startswith(b"\x89PNG")


def test_ranks_agree_or_do_not() -> None:
    rising = [judged(str(i), OK, 0.001 * i, 0.001 * i**2) for i in range(1, 6)]
    assert rank_correlation(rising) == pytest.approx(1)
    falling = [judged(str(i), OK, 0.001 * i, 0.001 / i) for i in range(1, 6)]
    assert rank_correlation(falling) == pytest.approx(-1)


def test_a_move_by_a_pixel_is_told_by_what_is_drawn() -> None:
    picture = np.ones((20, 20, 3), np.float32)
    picture[8:12, 8:12] = 0
    found = by_pixel(lambda a, b: np.abs(a - b).mean(axis=-1), picture)
    assert found.sum() == pytest.approx(8)  # four pixels on either side of either axis, halved
    assert by_pixel(lambda a, b: np.abs(a - b).mean(axis=-1), np.ones_like(picture)).sum() == 0
