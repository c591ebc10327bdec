"""Pictures as arrays: what is counted is what sorting finds."""

import numpy as np
import pytest

from toonset.raster import median_inside


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("count", [1, 2, 99, 100])
def test_a_counted_median_is_the_sorted_one(kind: type, count: int) -> None:
    rng = np.random.default_rng(count)
    levels = rng.integers(0, np.iinfo(kind).max, (20, 30), dtype=kind)
    mask = np.zeros(600, dtype=bool)
    mask[rng.permutation(600)[:count]] = True
    mask = mask.reshape(20, 30)
    assert median_inside(levels, mask) == np.median(levels[mask])
