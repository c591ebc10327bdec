"""Pictures as arrays: what is counted is what sorting finds."""

import numpy as np
import pytest

from toonset.raster import (
    LONG_REACH,
    connected_to,
    depth_inside,
    depth_near_edge,
    distance_to,
    from_nearest,
    in_rows,
    median_inside,
    nearest,
    quick_depth_inside,
    quick_distance_to,
    signed_distance,
    sized_parts,
    taken,
)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("count", [1, 2, 99, 100])
def test_a_counted_median_is_the_sorted_one(kind: type, count: int) -> None:
    rng = np.random.default_rng(count)
    levels = rng.integers(0, np.iinfo(kind).max, (20, 30), dtype=kind)
    mask = np.zeros(600, dtype=bool)
    mask[rng.permutation(600)[:count]] = True
    mask = mask.reshape(20, 30)
    assert median_inside(levels, mask) == np.median(levels[mask])


@pytest.mark.parametrize("reach", [1, 2, 7, LONG_REACH, LONG_REACH + 1])
@pytest.mark.parametrize("share", [0.0, 0.9, 0.99, 1.0])
def test_depth_near_an_edge_is_the_depth_inside(reach: int, share: float) -> None:
    mask = np.random.default_rng(reach).random((37, 52)) < share
    found, whole = depth_near_edge(mask, reach), depth_inside(mask)
    shallow = whole < reach - 0.5
    np.testing.assert_allclose(found[shallow], whole[shallow], atol=1e-6)
    assert (found[~shallow] >= reach - 0.5 - 1e-6).all()


@pytest.mark.parametrize("share", [0.5, 0.9, 0.999])
def test_quick_distances_are_those_to_2_percent(share: float) -> None:
    mask = np.random.default_rng(1).random((37, 52)) < share
    np.testing.assert_allclose(quick_distance_to(~mask), distance_to(~mask), rtol=0.02)
    np.testing.assert_allclose(quick_depth_inside(mask), depth_inside(mask) + 0.5, rtol=0.02)


def test_a_signed_distance_changes_its_sign_half_way_between_centres() -> None:
    mask = np.zeros((5, 6), dtype=bool)
    mask[:, 2:] = True
    assert signed_distance(mask)[0].tolist() == [-1.5, -0.5, 0.5, 1.5, 2.5, 3.5]
    assert (signed_distance(~mask) == -signed_distance(mask)).all()


@pytest.mark.parametrize("share", [0.0, 0.02, 1.0])
def test_areas_of_parts_are_counts(share: float) -> None:
    mask = np.random.default_rng(0).random((37, 52)) < share
    numbers, areas = sized_parts(mask)
    np.testing.assert_array_equal(areas, np.bincount(numbers.ravel()))
    lone = np.zeros((5, 6), dtype=bool)
    lone[1:3, 2:4] = True
    np.testing.assert_array_equal(sized_parts(lone)[1], [26, 4])


def test_values_come_from_the_nearest_known_pixel() -> None:
    known = np.zeros((40, 50), dtype=bool)
    known[5, 5] = known[30, 40] = True
    values = np.zeros((40, 50, 3), dtype=np.uint8)
    values[5, 5], values[30, 40] = 10, 200
    rows, columns = nearest(known)
    away = np.indices(known.shape)[:, None] - np.array([[5, 30], [5, 40]])[..., None, None]
    first, second = np.hypot(*away)
    clear = np.abs(first - second) > 1  # the distances are rough
    assert np.array_equal(from_nearest(values, known)[clear], values[rows, columns][clear])


def test_what_is_connected_to_a_seed_reaches_it_by_sides_not_by_corners() -> None:
    free = np.array([[1, 1, 0, 1], [0, 0, 1, 0], [0, 0, 1, 1]], dtype=bool)
    seeds = np.zeros_like(free)
    seeds[2, 3] = seeds[1, 0] = True  # the second one is not free
    found = connected_to(seeds, free)
    assert found.tolist() == [[False] * 4, [False, False, True, False], [False, False, True, True]]


def test_pixels_in_rows_are_all_of_them_and_the_last_again() -> None:
    assert in_rows(np.arange(0)).size == 0
    rows = in_rows(np.arange(100))
    assert rows.reshape(-1)[:100].tolist() == list(range(100))
    assert set(rows.reshape(-1)[100:].tolist()) == {99}
    many = in_rows(np.arange(64 * 40_000))  # OpenCV's `remap` takes no more than 32,766 rows
    assert len(many) <= 32_766
    assert many.size == 64 * 40_000 + -64 * 40_000 % many.shape[1]


def test_taken_is_what_rows_and_columns_index() -> None:
    rng = np.random.default_rng(0)
    at = (rng.integers(0, 7, (7, 5)), rng.integers(0, 5, (7, 5)))
    for picture in (rng.random((7, 5)), rng.random((7, 5, 3))):
        np.testing.assert_array_equal(taken(picture, at), picture[at])
