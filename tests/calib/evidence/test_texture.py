"""Laws of the paint on a turning body: symmetries, and a slow reference."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ive
from scipy.stats import multivariate_normal

from toonset.calib.evidence import texture
from toonset.calib.evidence.cylinder import figure_height, read_sections
from toonset.calib.evidence.texture import (
    Paint,
    bessel,
    paint_evidence,
    paint_log_likelihood,
    read_paint,
)
from toonset.view import View

EIGHT = np.arange(8) * np.pi / 4
UNEVEN = np.array([0.1, 1.2, 2.9, 4.0])


def _cylinder(yaw: float, seed: int, size: tuple[int, int] = (160, 60)) -> View:
    """Return a drawing of an upright cylinder with bands of smooth, symmetric paint."""
    height, width = size
    rng = np.random.default_rng(seed)
    across = (np.arange(width) + 0.5) * 2 / width - 1
    longitude = yaw + np.arcsin(across)
    bands = [
        128
        + 50 * rng.uniform(-1, 1, 3) * np.cos(longitude)[:, None]
        + 30 * rng.uniform(-1, 1, 3) * np.cos(2 * longitude)[:, None]
        for _ in range(8)
    ]
    rgba = np.full((height + 4, width + 6, 4), 255, np.uint8)
    rgba[..., 3] = 0
    rgba[2:-2, 3:-3, 3] = 255
    rgba[2:-2, 3:-3, :3] = np.repeat(bands, height // 8, axis=0).round()
    return View(rgba, (0, 0, width + 6, height + 4), 0.0, "view")


def _read(yaws: np.ndarray, seed: int = 3) -> Paint:
    return read_paint([_cylinder(yaw, seed) for yaw in yaws])


@pytest.mark.parametrize("yaws", [EIGHT, EIGHT[[0, 1, 2]], UNEVEN])
def test_truth_beats_the_mirror_twin(yaws: np.ndarray) -> None:
    wrong = [np.pi - yaws, -yaws, np.roll(yaws, 1)]
    likelihood = paint_log_likelihood(_read(yaws), np.stack([yaws, *wrong]))
    assert likelihood[0] > likelihood[1:].max() + 3


def test_no_yaws_are_excluded() -> None:
    likelihood = paint_log_likelihood(_read(EIGHT), np.stack([EIGHT, np.pi - EIGHT]))
    assert likelihood[0] == pytest.approx(0)
    assert likelihood[1] >= np.log(texture.BROKEN)


def test_evidence_is_the_same_in_any_company() -> None:
    hypotheses = np.random.default_rng(4).uniform(0, 2 * np.pi, (6, 8))[[0, 1, 1, 2, 0]]
    alone = [paint_evidence(_read(EIGHT), row[None])[0] for row in hypotheses]
    np.testing.assert_allclose(paint_evidence(_read(EIGHT), hypotheses), alone)


def _all_turned(views, hypotheses):
    return views, hypotheses + np.pi


def _in_another_order(views, hypotheses):
    return [views[i] for i in (2, 0, 3, 1)], hypotheses[:, [2, 0, 3, 1]]


def _mirrored(views, hypotheses):
    return [replace(view, rgba=view.rgba[:, ::-1].copy()) for view in views], -hypotheses


@pytest.mark.parametrize(
    ("change", "within"), [(_all_turned, 1e-9), (_in_another_order, 1e-9), (_mirrored, 1e-6)]
)
def test_what_changes_nothing(change, within) -> None:
    views = [_cylinder(yaw, 3) for yaw in UNEVEN]
    hypotheses = np.random.default_rng(0).uniform(0, 2 * np.pi, (20, len(UNEVEN)))
    changed, turned = change(views, hypotheses)
    np.testing.assert_allclose(
        paint_log_likelihood(read_paint(changed), turned),
        paint_log_likelihood(read_paint(views), hypotheses),
        atol=within,
    )


@pytest.mark.parametrize(("width", "count"), [(60, 8), (3, 1)])  # 3: too thin for cells
def test_a_body_of_one_colour_says_nothing(width: int, count: int) -> None:
    rgba = np.full((160, width, 4), 255, np.uint8)
    rgba[..., :3] = 90
    views = [View(rgba, (0, 0, width, 160), 0.0, "view")] * count
    hypotheses = np.stack([EIGHT, np.pi - EIGHT, -EIGHT])[:, :count]
    np.testing.assert_allclose(paint_log_likelihood(read_paint(views), hypotheses), 0, atol=1e-9)


def test_evidence_is_that_of_a_gaussian_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the profiled noise, the closed form equals the dense marginal likelihood."""
    monkeypatch.setattr(texture, "FAINTEST", 0.0)
    read, yaws = _read(UNEVEN), UNEVEN + 0.3
    across = np.arcsin((np.arange(texture.CELLS) + 0.5) * 2 / texture.CELLS - 1)
    waves, variance = texture._series((yaws[:, None] + across).ravel())
    slow = []
    for lab, seen in zip(read.lab, read.seen > 0, strict=True):
        covariance = (waves[seen] * variance) @ waves[seen].T + np.eye(int(seen.sum()))
        profiled = np.sum(lab[seen] * np.linalg.solve(covariance, lab[seen])) / (3 * seen.sum())
        normal = multivariate_normal(cov=profiled * covariance)
        slow.append(normal.logpdf(lab[seen].T).sum() / (3 * seen.sum()))
    constant = -0.5 * (1 + np.log(2 * np.pi))
    assert texture._evidence(read, yaws) == pytest.approx(np.mean(slow) - constant, abs=1e-9)


def test_series_is_a_von_mises_kernel_without_asymmetry(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(texture, "ASYMMETRY", 1.0)
    monkeypatch.setattr(texture, "ORDER", 12)
    longitude = np.linspace(0, 6, 25)
    waves, variance = texture._series(longitude)
    kernel = (waves[:, 1:] * variance[1:]) @ waves[:, 1:].T * texture.NOISE
    apart = longitude[:, None] - longitude
    expected = np.exp(texture.SMOOTHNESS * (np.cos(apart) - 1))
    np.testing.assert_allclose(kernel - kernel[0, 0], expected - expected[0, 0], atol=1e-12)


@pytest.mark.parametrize("k", [0.0, 1.0, 30.0, 700.0])
def test_a_mean_over_the_circle_is_a_bessel_function(k: float) -> None:
    orders = np.arange(4)
    np.testing.assert_allclose(bessel(orders, k), ive(orders, k), rtol=1e-12, atol=1e-16)


def test_across_runs_from_edge_to_edge() -> None:
    view = _cylinder(0.0, 1)
    sections = read_sections(view, 1.0, 0.0, figure_height([view]))
    row = len(sections.widths) // 2
    assert sections.widths[row] == 60
    np.testing.assert_allclose(sections.across[row], (np.arange(60) + 0.5) / 30 - 1)
    assert sections.inside[row].sum() >= 58


def test_scale_of_the_drawing_hardly_matters() -> None:
    hypotheses = np.stack([EIGHT, np.pi - EIGHT, EIGHT + 0.5])
    large = [_cylinder(yaw, 3, (480, 180)) for yaw in EIGHT]
    np.testing.assert_allclose(
        paint_log_likelihood(read_paint(large), hypotheses),
        paint_log_likelihood(_read(EIGHT), hypotheses),
        atol=0.1,
    )
