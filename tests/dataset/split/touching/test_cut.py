"""Touching figures: least-cost ways, evidence for a cut, and which cuts are announced."""

import cv2
import numpy as np
import pytest

from toonset.dataset.split.figures.blobs import find_blobs
from toonset.dataset.split.figures.rows import find_groups
from toonset.dataset.split.touching.costs import look_at
from toonset.dataset.split.touching.cut import Cut, part_touching
from toonset.dataset.split.touching.profiles import CAP, flanks, right_flank, unlikeness
from toonset.dataset.split.touching.seams import DETOUR, distinct_ways, least_costs
from toonset.dataset.split.touching.selection import best_option, find_options

RED, BLUE, SKIN, WHITE = (200, 30, 40), (20, 60, 180), (236, 188, 155), (255, 255, 255)


def person(picture: np.ndarray, x: int, left: int, right: int) -> None:
    """Draw a figure 160 high whose arms reach so far to each side."""
    cv2.circle(picture, (x, 30), 18, SKIN, -1)
    cv2.rectangle(picture, (x - 20, 48), (x + 20, 110), RED, -1)
    cv2.rectangle(picture, (x - left, 60), (x + right, 70), SKIN, -1)
    for end in (x - left, x + right):
        cv2.circle(picture, (end, 65), 9, SKIN, -1)
    for leg in (x - 16, x + 4):
        cv2.rectangle(picture, (leg, 110), (leg + 12, 172), BLUE, -1)


def row(width: int, *people: tuple[int, int, int]) -> np.ndarray:
    picture = np.full((190, width, 3), 255, dtype=np.uint8)
    for x, left, right in people:
        person(picture, x, left, right)
    return picture


def parted(rgb: np.ndarray) -> tuple[list[tuple[int, ...]], list[Cut]]:
    """Return the boxes of the patches from left to right, and the cuts."""
    painted = (rgb != 255).any(axis=-1)
    found = find_blobs(painted)
    bodies = [group.members for group in find_groups(found)[:1]] or [np.zeros(0, dtype=int)]
    blobs, cuts = part_touching(found, bodies[0], painted, rgb)
    return sorted(tuple(int(v) for v in box) for box in blobs.boxes), cuts


def slow_costs(price: np.ndarray) -> np.ndarray:
    """Return least costs by relaxing every step until nothing changes."""
    total = np.full(price.shape, np.inf)
    total[0] = price[0]
    while True:
        before = total.copy()
        for r in range(1, len(price)):
            for c in range(price.shape[1]):
                came = [total[r - 1, c]]
                came += [total[r, n] + DETOUR for n in (c - 1, c + 1) if 0 <= n < len(price[0])]
                total[r, c] = min(total[r, c], price[r, c] + min(came))
        if np.array_equal(total, before):
            return total


def test_least_costs_are_those_of_the_slow_way() -> None:
    prices = np.random.default_rng(0).random((2, 7, 9))
    prices[:, :, 4:6] = 0
    for price, total in zip(prices, least_costs(prices), strict=True):
        assert total == pytest.approx(slow_costs(price))


def test_ways_cost_what_was_promised_and_reach_both_ends() -> None:
    drawn = (np.random.default_rng(1).random((30, 40)) > 0.4).astype(float)
    rounds = list(distinct_ways(drawn[None], drawn, 1e9))
    cheapest = least_costs(drawn[None])[0][-1]
    first = rounds[0][0]
    steps = np.abs(np.diff(first.rows_met)) + np.abs(np.diff(first.columns_met))
    assert (steps == 1).all()
    assert (first.rows_met[0], first.rows_met[-1]) == (0, 29)
    aside = (np.diff(first.columns_met) != 0).sum()
    assert first.along(drawn).sum() + DETOUR * aside >= cheapest.min() - 1e-9
    assert len({seam.columns.tobytes() for ways in rounds for seam in ways}) > len(rounds[0])


def test_a_cleft_is_less_open_than_a_side() -> None:
    mask = np.zeros((200, 160), dtype=np.uint8)
    for x in (45, 115):
        cv2.circle(mask, (x, 100), 36, 1, -1)
    whole = mask.astype(bool)
    cut_costs = look_at(whole, whole, np.zeros((200, 160, 3), np.uint8))
    column = np.flatnonzero(whole[:, 80])
    side = np.flatnonzero(whole[100])[0]
    assert cut_costs.open[column[0], 80] < 0.3 < 0.7 < cut_costs.open[100, side]


def test_a_figure_is_like_its_mirror_image_at_any_size() -> None:
    rgb = row(200, (90, 30, 60))
    mask = (rgb != 255).any(axis=-1)
    large = cv2.resize(mask.view(np.uint8), None, fx=2, fy=2) > 0
    assert unlikeness(right_flank(mask), [flanks(mask[:, ::-1])[1]]) == 0
    assert unlikeness(right_flank(mask), [right_flank(large)]) < 0.004
    assert unlikeness(flanks(mask)[0], [flanks(mask)[1]]) > 0.005
    assert unlikeness(right_flank(mask), []) == CAP


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_hand_on_a_body_goes_with_its_arm(mirrored: bool) -> None:
    rgb = row(560, (70, 50, 50), (148, 0, 50), (330, 50, 50), (480, 0, 50))
    rgb = np.ascontiguousarray(rgb[:, ::-1]) if mirrored else rgb
    boxes, _ = parted(rgb)
    assert len(boxes) == 4
    reaching = boxes[3] if mirrored else boxes[0]
    assert reaching[2] == pytest.approx(118, abs=4)  # from hand to hand


def test_three_in_a_row_become_three() -> None:
    boxes, cuts = parted(row(420, (70, 50, 50), (189, 50, 50), (308, 50, 50)))
    assert [round(box[2] / 10) for box in boxes] == [12, 12, 12]
    assert len(cuts) == 2


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_figures_that_stand_alone_stay_whole(count: int) -> None:
    boxes, cuts = parted(row(150 * max(count, 1), *[(75 + 150 * i, 60, 60) for i in range(count)]))
    assert len(boxes) == count
    assert cuts == []


def test_the_chance_of_a_cut_is_one_if_it_has_no_rival() -> None:
    rgb = row(300, (70, 50, 50), (189, 50, 50))
    mask = (rgb != 255).any(axis=-1)
    cut_costs = look_at(mask, mask, rgb)
    options = find_options(cut_costs, rgb, [*flanks(mask)])
    best, sure = best_option(options, cut_costs.drawn > 0.5)
    assert 0 < sure <= 1
    assert best_option([best], cut_costs.drawn > 0.5) == (best, 1)
    assert all(best.badness <= option.badness for option in options)


def test_a_broad_figure_is_not_cut_where_another_has_its_outline() -> None:
    def broad(picture: np.ndarray, x: int, split: bool) -> None:
        """Draw a figure with spread legs; a groove runs down the middle of one of them."""
        for side in (-1, 1):
            corners = np.array([(8, 20), (60, 30), (70, 100), (60, 172), (24, 172), (4, 110)])
            cv2.fillPoly(picture, [corners * (side, 1) + (x, 0)], BLUE)
        cv2.rectangle(picture, (x - 10, 30), (x + 10, 60), BLUE, -1)
        if split:
            cv2.line(picture, (x, 25), (x, 65), (0, 0, 0), 1)
        else:
            cv2.rectangle(picture, (x - 12, 24), (x + 12, 130), RED, -1)

    rgb = np.full((190, 420, 3), 255, dtype=np.uint8)
    broad(rgb, 100, split=True)
    boxes, _ = parted(rgb[:, :210])
    assert len(boxes) == 2
    broad(rgb, 300, split=False)
    boxes, cuts = parted(rgb)
    assert len(boxes) == 2
    assert not any(cut.made for cut in cuts)
