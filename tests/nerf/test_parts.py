"""Laws of the trainer's parts, each fast path beside its slow specification."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from torch import nn

from toonset.dataset.silhouettes.bounds import Box
from toonset.nerf.fields.triplane import PLANES, TriplaneField
from toonset.nerf.kernels import decoder
from toonset.nerf.kernels import loss_terms as terms
from toonset.nerf.kernels.compositing import compositing_weights
from toonset.nerf.kernels.interpolation import Operator
from toonset.nerf.score.metrics import BEST_PSNR, compare, ssim

BOX = Box(np.array([-3.0, 10.0, 0.5]), np.array([1.0, 18.0, 2.5]))


def test_every_pair_of_axes_has_one_plane() -> None:
    assert sorted(map(sorted, PLANES)) == [list(p) for p in itertools.combinations(range(3), 2)]


def test_total_variation_is_the_mean_step_and_its_gradient() -> None:
    torch.manual_seed(3)
    shapes = [(4, 5), (3, 4, 2)]
    table = torch.randn(44, 3, dtype=torch.float64, requires_grad=True)
    grids = [g.view(*s, 3) for g, s in zip(table.split([20, 24]), shapes, strict=True)]
    steps = [g.diff(dim=axis).abs().sum() for g in grids for axis in range(g.ndim - 1)]
    slow = torch.stack(steps).sum() / 44
    fast = terms.total_variation(table, shapes)
    torch.testing.assert_close(fast, slow)
    (expected,) = torch.autograd.grad(2 * slow, table)
    (gradient,) = torch.autograd.grad(2 * fast, table)
    torch.testing.assert_close(gradient, expected)
    assert terms.total_variation(torch.ones(20, 2), [(4, 5)]) == 0


@pytest.mark.parametrize("samples", [1, 7, 20])
def test_two_layers_are_those_of_torch(samples: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decoder, "PART", 8)
    torch.manual_seed(samples)
    hidden, out = nn.Linear(5, 6).double(), nn.Linear(6, 4).double()
    features = torch.randn(samples, 5, dtype=torch.float64, requires_grad=True)
    inputs = [features, *hidden.parameters(), *out.parameters()]
    fast, slow = decoder.two_layers(features, hidden, out), out(F.relu(hidden(features))).T
    torch.testing.assert_close(fast, slow)
    upstream = torch.randn_like(slow)
    pairs = zip(*(torch.autograd.grad(y, inputs, upstream) for y in (fast, slow)), strict=True)
    for gradient, expected in pairs:
        torch.testing.assert_close(gradient, expected)


def test_compositing_weights_equal_a_loop_over_samples() -> None:
    depth = np.random.default_rng(0).gamma(1.0, 1.5, (5, 9))
    fast = compositing_weights(torch.as_tensor(depth))
    for ray in range(5):
        left = 1.0
        for i in range(9):
            alpha = 1 - math.exp(-depth[ray, i])
            assert float(fast[ray, i]) == pytest.approx(left * alpha, abs=1e-12)
            left *= 1 - alpha


def test_taps_equal_grid_sample() -> None:
    torch.manual_seed(1)
    field = TriplaneField(BOX, 16, 5, 8)
    unit = torch.rand(200, 3)
    extent = torch.tensor([n - 1 for n in field.shape]) * field.cell
    rows, weights = field.taps(field.low + unit * extent)
    fast = F.embedding_bag(rows, field.planes, per_sample_weights=weights, mode="sum")
    slow = torch.zeros_like(fast)
    for plane, (a, b) in zip(field.plane_images(), PLANES, strict=True):
        grid = (2 * unit[:, [b, a]] - 1)[None, None]
        image = plane.permute(2, 0, 1)[None]
        slow = slow + F.grid_sample(image, grid, align_corners=True)[0, :, 0].T
    torch.testing.assert_close(fast, slow, atol=1e-5, rtol=1e-4)


def test_operator_backward_is_the_transpose() -> None:
    torch.manual_seed(2)
    rows, weights = torch.randint(0, 30, (50, 12)), torch.rand(50, 12, dtype=torch.float64)
    table = torch.rand(30, 4, dtype=torch.float64, requires_grad=True)
    operator = Operator.of(rows, weights, 30)
    matrix = torch.zeros(50, 30, dtype=torch.float64)
    for sample in range(50):
        for tap in range(12):
            matrix[sample, rows[sample, tap]] += weights[sample, tap]
    torch.testing.assert_close(operator(table), matrix @ table)
    upstream = torch.rand(50, 4, dtype=torch.float64)
    (gradient,) = torch.autograd.grad(operator(table), table, upstream)
    torch.testing.assert_close(gradient, matrix.T @ upstream)
    assert torch.autograd.gradcheck(operator, table)


def test_losses_are_zero_only_where_they_should() -> None:
    drawn = torch.rand(6, 3)
    full, half = torch.ones(6), torch.full((6,), 0.5)
    assert terms.photometric(drawn, full, drawn, full) == 0
    assert terms.photometric(drawn * 0.5, half, drawn, half) == 0
    assert terms.photometric(drawn * 0.5, half, drawn, full) > 0
    assert terms.photometric(drawn, full, drawn, half) > 0
    logits = torch.randn(4, 3)
    unlabelled = torch.full((4,), 255)
    assert terms.cross_entropy(logits, unlabelled) == 0
    some = torch.tensor([0, 255, 255, 255])
    torch.testing.assert_close(
        terms.cross_entropy(logits, some), F.cross_entropy(logits[:1], some[:1])
    )


def test_metrics_against_numbers_by_hand() -> None:
    drawn = np.zeros((20, 20, 4), dtype=np.uint8)
    drawn[5:15, 5:15] = (255, 0, 0, 255)
    assert compare(drawn, drawn) == {"psnr": BEST_PSNR, "psnr_mask": BEST_PSNR, "ssim": 1.0}
    blank = np.zeros_like(drawn)
    found = compare(blank, drawn)  # a quarter of the pixels is wrong by 1 in two of three channels
    assert found["psnr"] == pytest.approx(-10 * math.log10(2 / 3 / 4))
    assert found["psnr_mask"] == pytest.approx(-10 * math.log10(2 / 3))
    assert compare(drawn, blank)["psnr_mask"] is None
    assert ssim(np.zeros((5, 5, 3)), np.zeros((5, 5, 3))) is None
