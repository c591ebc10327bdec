"""The projection benchmark compares ways that agree."""

from bench.calib.projection import compare


def test_the_compared_ways_give_the_same_pixels():
    plain, double, single = compare(views=2, starts=2, repeats=1)
    assert plain.off_px == 0
    assert double.off_px < 1e-9
    assert single.off_px < 1e-3
    assert min(double.fold_ends_ms, double.derivatives_ms) > 0
