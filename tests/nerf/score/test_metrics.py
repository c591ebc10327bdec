"""Figures of merit: laws, numbers by hand, and the values of the authors' and others' code."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from toonset.nerf.score import lpips as lpips_metric
from toonset.nerf.score.flip import load_flip
from toonset.nerf.score.labels import score_labels, shifted_miou
from toonset.nerf.score.lines import line_f1, line_pixels, tolerance_px
from toonset.nerf.score.metrics import (
    BEST_PSNR,
    compare,
    means,
    psnr_of,
    shifted_psnr,
    silhouette_iou,
    ssim,
)
from toonset.nerf.score.metrics_view import Judges, figures_of
from toonset.view import over_white

NO_JUDGES = Judges("no flip here", "no lpips here")


def pattern(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a picture with edges and waves, and a shifted, paler, streaked copy."""
    y, x = np.mgrid[:height, :width]
    checks = (x // 7 + y // 5) % 2 * 0.8 + 0.1
    a = np.stack([checks, np.sin(x / 6) ** 2, (x + y) / (height + width)], axis=-1)
    streaks = 0.05 * np.cos(y / 3)[..., None]
    return a, np.clip(np.roll(a, (1, 2), (0, 1)) * 0.9 + streaks, 0, 1)


def figure(outline: bool = True, at: int = 20) -> np.ndarray:
    """Return a red square of 40 px with its left edge at `at`, with a black line of 2 px."""
    rgba = np.zeros((80, 80, 4), dtype=np.uint8)
    rgba[20:60, at : at + 40] = (0, 0, 0, 255) if outline else (220, 90, 80, 255)
    rgba[22:58, at + 2 : at + 38] = (220, 90, 80, 255)
    return rgba


def test_ssim_of_alike_flat_and_masked_pictures() -> None:
    a, b = pattern(48, 40)
    everything, nothing = np.ones((48, 40), dtype=bool), np.zeros((48, 40), dtype=bool)
    assert ssim(a, a) == pytest.approx(1)
    assert ssim(a, b) == ssim(b, a) == pytest.approx(ssim(a, b, everything))
    assert ssim(a, b, nothing) is None
    dark, light = np.full((20, 20, 3), 0.2), np.full((20, 20, 3), 0.6)
    known = (2 * 0.2 * 0.6 + 1e-4) / (0.2**2 + 0.6**2 + 1e-4)  # no structure: means alone
    assert ssim(dark, light) == pytest.approx(known)
    half = np.where(np.arange(40)[None, :, None] < 20, b, a)  # wrong on the left alone
    assert ssim(a, half, everything & (np.arange(40) >= 25)) == pytest.approx(1)
    whole = ssim(a, half)
    assert whole is not None
    assert whole < 0.9


# flip-evaluator 1.7 (the authors'), 67 pixels per degree
@pytest.mark.parametrize(("size", "mean"), [((40, 52), 0.74913404), ((41, 37), 0.76616640)])
def test_flip(size: tuple[int, int], mean: float, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("flip_evaluator", reason="has no wheel for this machine")
    flip = load_flip()
    assert not isinstance(flip, str)
    a, b = pattern(*size)
    error = flip(a, b)
    assert error.shape == size
    assert error.mean() == pytest.approx(mean, abs=1e-5)
    assert flip(a, a).max() == 0
    worst = flip(np.zeros((64, 64, 3)), np.ones((64, 64, 3)))
    assert worst[32, 32] == pytest.approx(1, abs=0.05)  # black against white
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    assert load_flip() == "the package flip-evaluator is not installed"


class FakeLpips(torch.nn.Module):
    """The shape of the package's network: numbered layers in slices, distance from the trunk."""

    def __init__(self, *, net: str, pnet_rand: bool, verbose: bool) -> None:
        super().__init__()
        assert (net, pnet_rand, verbose) == ("alex", True, False)  # nothing is fetched like this
        self.net = torch.nn.Module()
        self.net.slice1 = torch.nn.Sequential()
        self.net.slice1.add_module("3", torch.nn.Conv2d(3, 2, 1))

    def forward(self, a: torch.Tensor, b: torch.Tensor, normalize: bool) -> torch.Tensor:
        assert normalize
        trunk = self.net.slice1
        assert isinstance(trunk, torch.nn.Module)
        return (trunk(a) - trunk(b)).square().mean()


def test_lpips_needs_its_package_and_weights_that_are_there(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path))
    monkeypatch.setitem(sys.modules, "lpips", None)
    assert lpips_metric.load_lpips() == "the package lpips is not installed"
    monkeypatch.setitem(sys.modules, "lpips", SimpleNamespace(LPIPS=FakeLpips))
    weights = tmp_path / "checkpoints" / lpips_metric.WEIGHTS
    assert lpips_metric.load_lpips() == f"{weights} does not exist; weights are never downloaded"
    weights.parent.mkdir()
    kernel = torch.tensor([[1.0, 0, 0], [0, 1, 0]]).reshape(2, 3, 1, 1)
    torch.save({"features.3.weight": kernel, "features.3.bias": torch.zeros(2)}, weights)
    reason = lpips_metric.load_lpips()
    assert isinstance(reason, str)
    assert "is damaged" in reason
    monkeypatch.setattr(lpips_metric, "SHA256_BEGINS", "")
    distance = lpips_metric.load_lpips()
    assert not isinstance(distance, str)
    a, b = pattern(40, 40)
    assert distance(a, b) == pytest.approx(((a - b)[..., :2] ** 2).mean(), rel=1e-5)
    assert distance(a[:31], b[:31]) is None


def test_a_shift_of_two_pixels_is_forgiven_and_of_three_is_not() -> None:
    drawn = over_white(figure())
    mask = figure()[..., 3] > 0
    for pixels, forgiven in ((0, True), (1, True), (2, True), (3, False)):
        moved = over_white(np.roll(figure(), (-pixels, pixels), (0, 1)))
        whole, inside = shifted_psnr(moved, drawn, mask)
        assert (whole == BEST_PSNR) is forgiven
        assert (inside == BEST_PSNR) is forgiven
        assert whole >= psnr_of(float(((moved - drawn) ** 2).mean()))
    assert shifted_psnr(drawn, drawn, np.zeros_like(mask))[1] is None


def test_a_shift_uncovers_white_and_wraps_nothing_round() -> None:
    edge = np.ones((20, 20, 3))
    edge[:, 18:] = 0  # two black columns at the right; moved out of the picture they are gone
    blank = np.ones((20, 20, 3))
    mask = np.ones((20, 20), dtype=bool)
    assert shifted_psnr(edge, blank, mask)[0] == BEST_PSNR
    left = np.roll(edge, 2, axis=1)  # what a wrapping shift would make of it
    assert shifted_psnr(edge, left, mask)[0] < 20


def test_silhouettes() -> None:
    assert silhouette_iou(figure(), figure()) == 1
    assert silhouette_iou(figure(at=40), figure()) == pytest.approx(20 / 60)
    faint = figure()
    faint[..., 3] //= 4
    assert silhouette_iou(faint, figure()) == 0
    assert silhouette_iou(faint, faint) is None


def test_labels_by_hand() -> None:
    true = np.array([[0, 0, 0, 1], [1, 2, 255, 255]], dtype=np.uint8)
    found = np.array([[0, 0, 1, 1], [255, 2, 0, 255]], dtype=np.uint8)
    score = score_labels(found, true)
    assert score is not None
    assert score.pixels == 5  # 255 in either is not counted
    assert score.accuracy == pytest.approx(4 / 5)
    assert score.miou == pytest.approx((2 / 3 + 1 / 2 + 1) / 3)
    assert score_labels(np.full_like(true, 255), true) is None
    strange = score_labels(np.full((2, 2), 9, np.uint8), np.zeros((2, 2), np.uint8))
    assert strange is not None
    assert (strange.accuracy, strange.miou) == (0, 0)
    square = np.full((12, 12), 255, dtype=np.uint8)
    square[3:9, 3:9] = 0
    square[5:7, 5:7] = 1
    for by, least, most in ((0, 1, 1), (2, 1, 1), (4, 0, 0.8)):  # a shift of 2 px is forgiven
        miou = shifted_miou(np.roll(square, (by, -by // 2), (0, 1)), square)
        assert miou is not None
        assert least <= miou <= most
    assert shifted_miou(np.full_like(square, 255), square) is None


def test_lines_may_lie_a_hundredth_of_the_height_off() -> None:
    assert line_f1(figure(), figure()) == 1
    assert line_f1(figure(at=21), figure()) == 1  # 1 px of any figure
    off = line_f1(figure(at=22), figure())
    assert off is not None
    assert off < 1
    large = np.zeros((300, 300, 4), dtype=np.uint8)
    large[20:280, 20:280] = (0, 0, 0, 255)
    large[23:277, 23:277] = (200, 60, 40, 255)
    moved = [line_f1(np.roll(large, by, axis=1), large) for by in (2, 3, 4)]
    assert moved[0] == 1
    assert moved == sorted(moved, reverse=True)  # type: ignore[type-var]
    assert tolerance_px(large) == 2
    far = line_f1(figure(at=28), figure())
    assert far is not None
    assert 0.3 < far < 0.75  # the horizontal lines lie right, those at the sides do not
    assert line_f1(figure(outline=False), figure()) == 0
    assert line_f1(figure(), figure(outline=False)) is None
    assert line_f1(figure(), np.zeros_like(figure())) is None
    ink = line_pixels(figure())
    np.testing.assert_array_equal(ink, (figure()[..., 0] == 0) & (figure()[..., 3] > 0))
    trousers = figure(outline=False)
    trousers[40:60, 20:60] = (10, 10, 10, 255)
    dark = (trousers[..., 3] > 0) & (trousers[..., 0] < 50)
    assert line_pixels(trousers)[dark].mean() < 0.03  # no disc fits into the very corners


def test_all_figures_of_a_view() -> None:
    figures, error = figures_of(figure(), figure(), NO_JUDGES)
    assert figures["psnr"] == figures["psnr_mask"] == figures["psnr_shift"] == BEST_PSNR
    assert figures["ssim"] == figures["ssim_mask"] == 1
    assert figures["flip"] is figures["flip_mask"] is figures["lpips"] is None
    assert error.shape == (80, 80)
    assert not error.any()
    assert NO_JUDGES.absent == {"flip": "no flip here", "lpips": "no lpips here"}
    blank = np.zeros_like(figure())
    nothing, _ = figures_of(figure(), blank, NO_JUDGES)
    assert [name for name, value in nothing.items() if value is None] == [
        *("psnr_mask", "ssim_mask", "psnr_shift_mask", "sharpness", "dirt", "flip", "flip_mask"),
        *("lpips", "ink_f1"),
    ]
    assert all(math.isfinite(value) for value in nothing.values() if value is not None)
    judged, error = figures_of(blank, figure(), Judges(lambda d, r: (d - r)[..., 2] * 0 + 0.25, ""))
    assert judged["flip"] == judged["flip_mask"] == 0.25
    assert (error == 0.25).all()
    apart, _ = figures_of(figure(at=25), figure(), NO_JUDGES)
    assert compare(figure(at=25), figure()).items() <= apart.items()
    dot = np.full((1, 1, 4), 200, dtype=np.uint8)
    single, _ = figures_of(dot, dot, NO_JUDGES)
    assert (single["psnr"], single["ssim"]) == (BEST_PSNR, None)


def test_means_leave_out_what_is_missing() -> None:
    rows = [{"a": 1.0, "b": None}, {"a": 3.0, "b": 5.0}, {"a": None, "b": None}]
    assert means(rows) == {"a": 2.0, "b": 5.0}
    assert means([{"a": None}]) == {"a": None}
    assert means([]) == {}
