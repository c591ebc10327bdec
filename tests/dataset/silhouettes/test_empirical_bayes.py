"""Numbers of a linear problem: what Gauss-Newton finds and is worth is known in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from toonset.dataset.silhouettes import empirical_bayes
from toonset.dataset.silhouettes.empirical_bayes import (
    Fit,
    Normal,
    Numbers,
    Prior,
    unmoved,
    weighed,
)

COVARIANCE = np.array([[1.0, 0.3, 0.0], [0.3, 0.5, 0.1], [0.0, 0.1, 2.0]])
TAU = 0.01


class Lines:
    """Residuals A c - y of one block or more, each with noise of deviation 1."""

    def __init__(self, tau: float, blocks: int, points: int = 400) -> None:
        rng = np.random.default_rng(0)
        self.slopes = rng.normal(size=(blocks, points, 3)) * 300
        self.truth = rng.multivariate_normal(np.zeros(3), tau**2 * COVARIANCE, blocks)
        self.seen = np.einsum("bnk,bk->bn", self.slopes, self.truth)
        self.seen += rng.normal(size=self.seen.shape)
        self.prior = Prior(np.linalg.inv(COVARIANCE))

    def at(self, numbers: Numbers, _: int = 0) -> list[Normal]:
        found = []
        for slope, seen, own in zip(self.slopes, self.seen, numbers, strict=True):
            off = slope @ own - seen
            squares = float(off @ off)
            found.append(Normal(slope.T @ slope, slope.T @ off, squares, squares, len(off)))
        return found

    def fit(self, rounds: int, **options: Any) -> Fit:
        first = self.at(np.zeros((len(self.seen), 3)))
        return empirical_bayes.fit(self.at, first, self.prior, TAU, rounds, **options)


def test_one_step_finds_the_posterior_mean() -> None:
    lines = Lines(TAU, 2)
    found = lines.fit(1)
    for slope, seen, own in zip(lines.slopes, lines.seen, found.numbers, strict=True):
        whole = slope.T @ slope + np.linalg.inv(COVARIANCE) / TAU**2
        np.testing.assert_allclose(own, np.linalg.solve(whole, slope.T @ seen), rtol=1e-9)


def test_the_gain_is_that_of_the_marginal_likelihood() -> None:
    lines = Lines(TAU, 2, points=40)
    wanted = 0.0
    for slope, seen in zip(lines.slopes, lines.seen, strict=True):
        with_errors = np.eye(40) + TAU**2 * slope @ COVARIANCE @ slope.T
        wanted -= float(seen @ np.linalg.solve(with_errors, seen)) / 2
        wanted -= np.linalg.slogdet(with_errors)[1] / 2
        wanted += float(seen @ seen) / 2
    assert lines.fit(2).gain_nats == pytest.approx(wanted, rel=1e-9)  # tau is not learned yet


@pytest.mark.parametrize("tau", [0.003, 0.015])
def test_the_size_of_errors_is_learned(tau: float) -> None:
    assert Lines(tau, 60).fit(30).tau == pytest.approx(tau, rel=0.15)


def test_drawings_without_error_stay_as_they_are() -> None:
    lines = Lines(0.0, 2)
    still = lines.at(np.zeros((2, 3)))
    small = [Normal(n.matrix, n.slope, 0.1, n.squares, n.points) for n in still]
    found = unmoved(small, lines.prior, TAU)
    assert found is not None
    assert not found.numbers.any()
    assert found.gain_nats < 0
    assert unmoved(still, lines.prior, TAU) is None


def test_numbers_of_known_size_do_not_tell_how_large_errors_are() -> None:
    """The last number is 100 times as large as tau says, which its own prior knows."""
    lines = Lines(0.005, 60)
    lines.seen += lines.slopes[..., 2] * 0.5
    scaled = np.diag([1.0, 2.0, 0.0])
    lines.prior = Prior(scaled, np.diag([0.0, 0.0, 4.0]))
    assert lines.prior.count == 2
    found = lines.fit(30)
    assert found.tau < 0.01
    np.testing.assert_allclose(found.numbers[:, 2], 0.5, atol=0.05)


def test_weights_are_the_slope_of_the_cost() -> None:
    residual, step = np.linspace(-9, 9, 19), 1e-5
    weight, _ = weighed(residual, 0.4, 100.0)
    for r, w in zip(residual, weight, strict=True):
        ahead, behind = (weighed(np.array([r + by]), 0.4, 100.0)[1] for by in (step, -step))
        assert (ahead - behind) / (4 * step) == pytest.approx(w * r, abs=1e-6)


def test_half_steps_go_half_the_way_and_a_gauge_is_taken_off_every_step() -> None:
    lines = Lines(TAU, 2)
    whole, half = lines.fit(1), lines.fit(1, length=0.5)
    np.testing.assert_allclose(half.numbers, whole.numbers / 2, rtol=1e-12)
    level = lines.fit(3, gauge=lambda numbers: numbers - numbers.mean(axis=0))
    np.testing.assert_allclose(level.numbers.mean(axis=0), 0, atol=1e-15)


def test_rounds_end_where_they_no_longer_help() -> None:
    lines = Lines(TAU, 2)
    rounds = list[int]()

    def at(numbers: Numbers, round_: int) -> list[Normal]:
        rounds.append(round_)
        return lines.at(numbers)

    first = lines.at(np.zeros((2, 3)))
    empirical_bayes.fit(at, first, lines.prior, TAU, 9, enough=0.99)
    assert max(rounds) < 9
    rounds.clear()
    empirical_bayes.fit(at, first, lines.prior, TAU, 9)
    assert max(rounds) == 9
