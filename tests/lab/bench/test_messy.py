"""Messy synthetic sheets: the truth is what is drawn, the seed decides, difficulties are drawn."""

from __future__ import annotations

from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest

from lab.bench.messy.figure import tight_window
from lab.bench.messy.options import BESIDE, DIFFICULTIES, EXCLUSIVE, GROUNDS, MessyOptions, mixture
from lab.bench.messy.sheet import MessySheet, make_messy_sheet
from toonset.errors import SheetError

SMALL = MessyOptions(figure_px=(70, 90))
COLORS = ((230, 180, 150), (90, 50, 40), (200, 60, 50), (50, 80, 150), (60, 60, 70), (90, 150, 70))
TOUCH = {"touching", "overlap"}


@cache  # most tests look at the same few
def sheet(seed: int, *difficulties: str) -> MessySheet:
    return make_messy_sheet(seed, difficulties, SMALL)


def covered(made: MessySheet) -> np.ndarray:
    """Return the sum of all true alphas, 0 to 1, on the sheet."""
    total = np.zeros(made.rgba.shape[:2])
    for (x, y, w, h), alpha in zip(made.boxes, made.alphas, strict=True):
        total[y : y + h, x : x + w] += alpha / 255
    return total


def common_area(a: tuple[int, int, int, int], b: tuple[int, int, int, int]) -> int:
    width = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    height = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    return max(width, 0) * max(height, 0)


@pytest.mark.parametrize("difficulty", [None, *DIFFICULTIES])
def test_truth_is_consistent(difficulty: str | None) -> None:
    made = sheet(5, *([difficulty] if difficulty else []))
    height, width = made.rgba.shape[:2]
    assert len(made.boxes) == len(made.alphas)
    for (x, y, w, h), alpha in zip(made.boxes, made.alphas, strict=True):
        assert alpha.shape == (h, w)
        assert min(x, y) >= 0
        assert x + w <= width
        assert y + h <= height
        assert tight_window(alpha) == (slice(0, h), slice(0, w))
        assert alpha.max() == 255
    if not TOUCH & set(made.what):
        assert all(common_area(a, b) == 0 for a, b in combinations(made.boxes, 2))
    # neighbours' half-covered rims may add up to a little more than one
    assert covered(made).max() <= 1 + 2 / 255


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("difficulty", ["rows", "overlap", "floating", "sizes", "one"])
def test_on_a_transparent_sheet_alpha_is_the_truth(difficulty: str, seed: int) -> None:
    made = sheet(seed, "transparent", difficulty)
    np.testing.assert_allclose(made.rgba[..., 3] / 255, covered(made), atol=2 / 255)


@pytest.mark.parametrize("seed", range(2))
def test_on_a_plain_sheet_nothing_but_figures_differs_from_it(seed: int) -> None:
    made = sheet(seed, "tinted")
    ground = made.rgba[0, 0, :3].astype(int)
    away = np.abs(made.rgba[..., :3].astype(int) - ground).max(axis=-1)
    assert not away[covered(made) == 0].any()
    assert (away[covered(made) == 1] > 8).mean() > 0.5  # clothes may have the paper's colour


def test_what_is_no_figure_is_not_in_the_truth() -> None:
    plain = sheet(0, "plain")
    for extra in ("captions", "title", "arrows", "swatches", "guides", "props", "heads", "shadows"):
        made = sheet(0, extra)
        white = (made.rgba[..., :3] == 255).all(axis=-1)
        assert (~white & (covered(made) == 0)).sum() > 15, extra
        sizes = [alpha.shape for alpha in made.alphas]
        assert sizes == [alpha.shape for alpha in plain.alphas], extra


def test_reading_order_is_rows_from_the_top_each_from_the_left() -> None:
    for seed in range(3):
        boxes = sheet(seed, "rows", "heads", "props").boxes
        for (x, y, _, h), (next_x, next_y, _, next_h) in pairwise(boxes):
            same_row = abs((next_y + next_h) - (y + h)) <= 2
            assert next_x > x if same_row else next_y > y + h - 2


# ---- seeds and names


@pytest.mark.parametrize("difficulties", [(), ("paper", "jpeg", "heads")])
def test_same_seed_same_bytes_and_other_seeds_others(difficulties: tuple[str, ...]) -> None:
    first, other = sheet(1, *difficulties), sheet(2, *difficulties)
    again = make_messy_sheet(1, difficulties, SMALL)
    assert first.what == again.what
    assert first.boxes == again.boxes
    np.testing.assert_array_equal(first.rgba, again.rgba)
    assert all((a == b).all() for a, b in zip(first.alphas, again.alphas, strict=True))
    assert other.rgba.shape != first.rgba.shape or (other.rgba != first.rgba).any()


def test_mixtures_have_one_ground_and_hold_no_contradiction() -> None:
    rng = np.random.default_rng(0)
    seen: set[str] = set()
    for _ in range(300):
        chosen = mixture(MessyOptions(), rng)
        assert len(chosen & set(GROUNDS)) == 1
        assert 1 <= len(chosen - set(GROUNDS)) <= MessyOptions().mixed[1]
        assert not any({a, b} <= chosen for a, b in EXCLUSIVE)
        seen |= chosen
    assert seen == set(DIFFICULTIES) - set(BESIDE)


@pytest.mark.parametrize(
    ("asked", "match"),
    [
        (["fog"], "'fog'"),
        (["jpeg", "transparent"], "go together"),
        (["paper", "plain"], "go together"),
        (["one", "arrows"], "go together"),
    ],
)
def test_impossible_sheets_are_refused(asked: list[str], match: str) -> None:
    with pytest.raises(SheetError, match=match):
        make_messy_sheet(0, asked)
