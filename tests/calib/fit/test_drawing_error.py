"""The drawing's error: integrated out as the covariance form says, smooth told from white."""

import numpy as np
import pytest

from toonset.calib.fit.drawing_error import Noise, Residuals, error_modes, marginalise, next_noise
from toonset.calib.outline.correspondences import Drawing
from toonset.dataset.silhouettes.contour import Contour


def circle(count: int = 120) -> Drawing:
    turn = np.arange(count) * 2 * np.pi / count
    normals = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return drawn(50 + 40 * normals, normals)


def row_of_points(count: int) -> Drawing:
    points = np.stack([np.linspace(0, 4000, count), np.full(count, 50.0)], axis=1)
    return drawn(points, np.full((count, 2), np.sqrt(0.5)))


def drawn(points: np.ndarray, normals: np.ndarray) -> Drawing:
    whole = np.ones(len(points), bool)
    return Drawing(
        Contour(points, normals, (10.0, 10.0, 80.0, 80.0), 80.0, whole), 80.0, len(points)
    )


def problem(rng: np.random.Generator, drawing: Drawing):
    count = len(drawing.points)
    index = rng.integers(0, count, 2 * count)
    rows, residuals = rng.normal(size=(2 * count, 3)), rng.normal(size=2 * count)
    shares, robust = np.full(2 * count, 0.5 / count), rng.uniform(0.2, 1, 2 * count)
    return Residuals(residuals, rows, index, shares, robust)


@pytest.mark.parametrize("seed", [0, 1])
def test_integrating_out_equals_generalised_least_squares(seed):
    drawing, noise = circle(), Noise(0.01, 0.004)
    off = problem(np.random.default_rng(seed), drawing)
    modes = error_modes(drawing)
    found = marginalise(modes, noise, drawing.height, off, width=0.02, samples=80.0)
    white = (noise.white * drawing.height) ** 2 / (off.shares * off.robust * 80.0)
    spread = modes[off.target_index]
    covariance = noise.smooth**2 * spread @ spread.T + np.diag(white)
    normal = off.slopes.T @ np.linalg.solve(covariance, off.slopes)
    gradient = off.slopes.T @ np.linalg.solve(covariance, off.px)
    np.testing.assert_allclose(found.normal, normal, rtol=1e-6)
    np.testing.assert_allclose(found.gradient, gradient, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(("smooth", "white"), [(0.01, 0.002), (0.005, 0.003)])
def test_the_noise_is_read_from_residuals_that_have_it(smooth, white):
    drawing = circle()
    modes, count = error_modes(drawing), len(circle().points)
    rng = np.random.default_rng(3)
    index, shares = np.arange(count), np.full(count, 1 / count)
    estimate = Noise()
    for _ in range(20):
        views = []
        for view in range(6):
            rng = np.random.default_rng(view)
            residuals = modes @ rng.normal(0, smooth, modes.shape[1])
            residuals += rng.normal(0, white * drawing.height, count)
            rows = np.zeros((count, 0))
            off = Residuals(residuals, rows, index, shares, np.ones(count))
            views.append(marginalise(modes, estimate, drawing.height, off, 1.0, 80.0))
        estimate = next_noise(views, 0.0, 1.0)
    assert estimate.smooth == pytest.approx(smooth, rel=0.25)
    assert estimate.white == pytest.approx(white, rel=0.5)


def test_a_bent_drawing_costs_information():
    drawing = circle()
    off, modes = problem(np.random.default_rng(5), drawing), error_modes(drawing)
    rigid, bent = (
        marginalise(modes, Noise(s, 0.004), drawing.height, off, 0.02, 80.0).normal
        for s in (1e-5, 0.02)
    )
    assert (np.linalg.eigvalsh(rigid - bent) > -1e-9).all()


def test_modes_never_outnumber_the_points_and_keep_their_covariance():
    wide, dense = error_modes(row_of_points(801)), error_modes(row_of_points(4001))
    assert wide.shape[1] == len(wide) < dense.shape[1] < len(dense)
    np.testing.assert_allclose(wide @ wide.T, dense[::5] @ dense[::5].T, rtol=0.02, atol=0.1)
