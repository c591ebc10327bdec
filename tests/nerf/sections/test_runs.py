"""Runs of masks against slow references."""

from __future__ import annotations

import numpy as np
import pytest

from toonset.nerf.sections.runs import TOUCHING_PX, median_along, parted, runs_of, smoothed


def mask_with_gaps(seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    mask = np.kron(generator.random((6, 8)) < 0.5, np.ones((4, 3))) > 0
    mask[8:12] = False  # rows without a run
    mask[0, 0] = True
    return mask


@pytest.mark.parametrize("seed", range(4))
def test_every_pixel_knows_its_nearest_run(seed: int) -> None:
    mask = mask_with_gaps(seed)
    runs = runs_of(mask)
    rows = np.flatnonzero(mask.any(axis=1))
    for row in range(len(mask)):
        there = rows[np.abs(rows - row).argmin()]
        own = np.flatnonzero(runs.row == there)
        for column in range(mask.shape[1]):
            away = np.maximum(runs.start[own] - column - 0.5, column + 0.5 - runs.end[own])
            number = runs.number[row, column]
            assert away[own == number][0] == away.min()
    assert sum(runs.end - runs.start) == mask.sum()


def test_means_are_those_of_the_pixels() -> None:
    generator, mask = np.random.default_rng(0), mask_with_gaps(1)
    runs, picture = runs_of(mask), generator.random((*mask.shape, 3))
    weight = generator.random(mask.shape)
    for number, mean in enumerate(runs.means(picture, weight)):
        own = (runs.row[number], slice(runs.start[number], runs.end[number]))
        expected = np.average(picture[own], weights=weight[own], axis=0)
        np.testing.assert_allclose(mean, expected, atol=1e-9)


def test_links_lead_along_a_limb_and_never_across() -> None:
    mask = np.zeros((20, 12), bool)
    mask[:, 1:4] = mask[5:, 7:10] = True
    runs = runs_of(mask)
    above, below = runs.links(np.ones(len(runs.row), bool))
    assert ((runs.start[above] == runs.start) & (runs.start[below] == runs.start)).all()
    assert (runs.row[above] >= runs.row - 1).all()
    first = np.flatnonzero((runs.row == 5) & (runs.start == 7))
    assert above[first] == first  # the second limb begins there


@pytest.mark.parametrize(("rows", "beside", "parts"), [(6, 6, 2), (TOUCHING_PX, 0, 2), (6, 9, 1)])
def test_a_limb_is_parted_where_it_touches_between_two_gaps(
    rows: int, beside: int, parts: int
) -> None:
    mask = np.ones((80, 40), bool)
    mask[:20, 10:13] = mask[20 + rows :, 10 + beside : 13 + beside] = False
    touching = np.bincount(runs_of(parted(mask)).row)[20 : 20 + rows]
    assert (touching == parts).all()


def test_a_body_is_left_whole_where_no_gap_goes_on() -> None:
    mask = np.ones((120, 40), bool)
    mask[40:60, 10:13] = False
    assert (parted(mask) == mask).all()
    mask[60 + TOUCHING_PX + 1 :, 10:13] = False
    assert (parted(mask) == mask).all()
    assert not parted(np.zeros((5, 5), bool)).any()


def test_blur_keeps_constants_and_has_the_width_that_it_says() -> None:
    mask = np.ones((101, 4), bool)
    runs = runs_of(mask)
    links = runs.links(np.ones(101, bool))
    np.testing.assert_allclose(smoothed(np.full((101, 2), 3.0), links, 4.0), 3.0)
    spread = smoothed(np.eye(101)[50], links, 4.0)
    assert np.sqrt(((np.arange(101) - 50) ** 2 * spread).sum()) == pytest.approx(4.0, rel=0.01)
    values = np.arange(101.0)
    values[50] = 1e3
    assert median_along(values, links, 3)[50] == 51
