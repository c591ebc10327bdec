"""Laws that every kind of field keeps, and the slow specification of what a step renders."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from lab.bench.train.mlp import MlpField
from lab.bench.train.voxel import VoxelField
from toonset.dataset.silhouettes.bounds import Box
from toonset.nerf.fields.base import Field, Places
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.fields.triplane import PLANES, TriplaneField
from toonset.nerf.kernels.compositing import (
    composite_packed,
    compositing_weights,
    pad,
    transmittance_packed,
)
from toonset.nerf.train.batches import Batch
from toonset.nerf.train.carved_rays import PRUNE_AFTER, FixedRays, seen_samples
from toonset.nerf.train.gradients import gradients_of
from toonset.nerf.train.loss import Model, Weights, loss_terms, render_batch

BOX = Box(np.array([-3.0, 10.0, 0.5]), np.array([1.0, 18.0, 2.5]))
KINDS: dict[str, Callable[[], Field]] = {
    "triplane": lambda: TriplaneField(BOX, 9, 5, 6),
    "voxel": lambda: VoxelField(BOX, 7),
    "mlp": lambda: MlpField(BOX, 2, 8),
}


def made(kind: str) -> Field:
    """Return a field with random values everywhere."""
    torch.manual_seed(0)
    field = KINDS[kind]()
    for values in field.parameters():
        torch.nn.init.normal_(values, std=0.7)
    return field


def places(count: int, seed: int = 0) -> Tensor:
    """Return points in the box."""
    unit = np.random.default_rng(seed).random((count, 3))
    return torch.as_tensor(BOX.low + unit * BOX.size, dtype=torch.float32)


def batch_of(
    field: Field, counts: list[int], dtype: torch.dtype = torch.float32, *, placed: bool = False
) -> Batch:
    """Return a batch of rays with so many samples each, laid out or just at random places."""
    ray = torch.arange(len(counts)).repeat_interleave(torch.tensor(counts))
    rng = np.random.default_rng(5)
    numbers = [rng.random((len(ray),)) * 0.4, rng.random((len(counts), 3)), rng.random(len(counts))]
    length, rgb, alpha = (torch.as_tensor(n).to(dtype) for n in numbers)
    labels = torch.arange(len(counts)) % 3
    labels[0] = 255
    points = places(len(ray)).to(dtype)
    constants = Places(points) if placed else field.constants(points)
    return Batch(constants, ray, length, rgb, alpha, labels)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_precomputed_changes_nothing(kind: str) -> None:
    field, points = made(kind), places(300)
    plain = field(points)
    for constants in (field.constants(points), Places(points)):
        for fast, slow in zip(field.shade(constants), plain, strict=True):
            torch.testing.assert_close(fast, slow, atol=1e-4, rtol=1e-4)
    assert bool((plain[0] >= 0).all())
    assert bool(((plain[1] >= 0) & (plain[1] <= 1)).all())


def test_triplane_and_rays_equal_a_loop_over_every_sample() -> None:
    field = made("triplane")
    assert isinstance(field, TriplaneField)
    counts = [4, 1, 7]
    batch, points = batch_of(field, counts), places(sum(counts)).double().numpy()
    color, opacity = render_batch(field, batch)
    images = [image.detach().double().numpy() for image in field.plane_images()]
    weights = {name: v.detach().double().numpy() for name, v in field.named_parameters()}
    sample = 0
    for ray, count in enumerate(counts):
        left, seen = 1.0, np.zeros(3)
        for _ in range(count):
            at = (points[sample] - BOX.low) / field.cell
            features = np.zeros(5)
            for image, (a, b) in zip(images, PLANES, strict=True):
                i, j = int(at[a]), int(at[b])
                s, t = at[a] - i, at[b] - j
                features += (1 - s) * (1 - t) * image[i, j] + (1 - s) * t * image[i, j + 1]
                features += s * (1 - t) * image[i + 1, j] + s * t * image[i + 1, j + 1]
            hidden = np.maximum(weights["hidden.weight"] @ features + weights["hidden.bias"], 0)
            raw = weights["out.weight"] @ hidden + weights["out.bias"]
            density = math.log1p(math.exp(raw[0] + math.log(math.expm1(0.1)))) / field.cell
            alpha = 1 - math.exp(-density * float(batch.length[sample]))
            seen += left * alpha / (1 + np.exp(-raw[1:]))
            left *= 1 - alpha
            sample += 1
        np.testing.assert_allclose(color[ray].detach(), seen, atol=2e-5)
        assert float(opacity[ray].detach()) == pytest.approx(1 - left, abs=2e-5)


def test_packed_compositing_equals_the_padded_one() -> None:
    torch.manual_seed(3)
    counts = torch.tensor([3, 1, 6, 2])
    ray = torch.arange(4).repeat_interleave(counts)
    order = torch.cat([torch.arange(int(n)) for n in counts])
    depth, color = torch.rand(12, dtype=torch.float64), torch.rand(12, 3, dtype=torch.float64)
    table = pad(torch.cat([depth[:, None], color], 1), ray, order, 4, 6)
    weights = compositing_weights(table[..., 0])
    fast, opacity = composite_packed(depth, color, ray, 4)
    torch.testing.assert_close(fast, (weights[..., None] * table[..., 1:]).sum(dim=1))
    torch.testing.assert_close(opacity, weights.sum(dim=1))
    left = transmittance_packed(depth, ray)
    torch.testing.assert_close(left[:3], torch.exp(-torch.tensor([0, depth[0], depth[:2].sum()])))


def test_packed_compositing_survives_extreme_depths() -> None:
    depth = torch.tensor([1e30, 1e30, 0.5], requires_grad=True)
    color, opacity = composite_packed(
        depth, torch.tensor([[0.7], [0.2], [1.0]]), torch.tensor([0, 0, 1]), 2
    )
    torch.autograd.backward(color.sum() + opacity.sum())
    assert color[0, 0].item() == pytest.approx(0.7)
    assert opacity[1].item() == pytest.approx(1 - math.exp(-0.5))  # no neighbour's depth leaks in
    assert depth.grad is not None
    assert bool(torch.isfinite(depth.grad).all())


@pytest.mark.parametrize("placed", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_gradients_of_the_whole_loss_match_central_differences(kind: str, placed: bool) -> None:
    field = made(kind).double()
    model = Model(field, PaletteClassifier(3).double())
    batch = batch_of(field, [4, 2, 5, 3], torch.float64, placed=placed)
    weights = Weights(0.3, 0.02)
    torch.autograd.backward(torch.stack(loss_terms(model, batch, weights)).sum())
    generator = torch.Generator().manual_seed(0)
    for values in model.parameters():
        along = torch.randn(values.shape, generator=generator, dtype=torch.float64)
        assert values.grad is not None
        slope, found = float((values.grad * along).sum()), []
        for side in (1e-6, -1e-6):
            with torch.no_grad():
                values.add_(side * along)
                found.append(float(torch.stack(loss_terms(model, batch, weights)).sum()))
                values.sub_(side * along)
        assert (found[0] - found[1]) / 2e-6 == pytest.approx(slope, rel=1e-4, abs=1e-8)


def test_the_gradient_of_parts_is_that_of_their_mean_and_smoothness() -> None:
    field = made("triplane").double()
    model = Model(field, PaletteClassifier(3).double())
    parts = [batch_of(field, counts, torch.float64) for counts in ([4, 2, 5], [3])]
    weights = Weights(0.3, 0.02)
    terms, gradients = gradients_of(model, parts, weights)
    total = [torch.stack(loss_terms(model, part, weights)) for part in parts]
    mean = (3 * total[0] + total[1]) / 4
    torch.testing.assert_close(terms, mean.detach())
    torch.autograd.backward(mean.sum())
    for found, parameter in zip(gradients, model.parameters(), strict=True):
        assert found is not None
        torch.testing.assert_close(found, parameter.grad)


def test_only_hidden_samples_are_dropped() -> None:
    field = made("voxel")
    with torch.no_grad():
        field.tables()[0][:, 0] = 40.0  # opaque
    model, batch = Model(field, None), batch_of(field, [6, 8, 1, 7], placed=True)
    rays = FixedRays([(batch,)], field, 3 * PRUNE_AFTER)
    for step in range(PRUNE_AFTER):
        assert rays.batches(0, step)[0] is batch
        rays.after(step, model)
    (pruned,) = rays.batches(0, PRUNE_AFTER)
    assert len(pruned.ray) == int(seen_samples(model, batch).sum()) < 0.9 * len(batch.ray)
    assert set(pruned.ray.tolist()) == {0, 1, 2, 3}
    for few, all_samples in zip(
        render_batch(field, pruned), render_batch(field, batch), strict=True
    ):
        assert (few - all_samples).abs().max() < 0.011
