"""Laws of the plain method's rays: stratified samples through the box, and its preset."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from lab.bench.train.mlp import MlpField
from lab.bench.train.voxel import VoxelField
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.silhouettes.bounds import Box
from toonset.nerf.fields.base import Field, Places
from toonset.nerf.fields.triplane import PLANES, TriplaneField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.kernels.compositing import composite_even, composite_packed
from toonset.nerf.kernels.interpolation import apply_once
from toonset.nerf.kernels.loss_terms import photometric
from toonset.nerf.options import PRESETS, TrainOptions
from toonset.nerf.train.box_rays import (
    BINS,
    CLEARER,
    BoxRays,
    any_backdrop,
    nearest_labels,
    open_box,
    without_empty_space,
)
from toonset.nerf.train.loss import render_batch

SIDE = 24
PALETTE = np.array([[250, 0, 0], [0, 0, 250]], dtype=np.uint8)


def drum(k: float = 0.1) -> Scene:
    """Return four views of an upright square block, red where x > 0 and blue elsewhere."""
    frames = []
    for i in range(4):
        yaw = np.pi / 2 * i
        camera = Camera.looking_at(np.zeros(3), yaw, 0.0, 8.0, (SIDE, SIDE), k=k)
        rgba = np.zeros((SIDE, SIDE, 4), dtype=np.uint8)
        rgba[4:20, 6:18, 3] = 255
        right = camera.rotation[0][0]  # how much of world x points to the picture's right
        rgba[..., 2] = 250
        red = np.full(SIDE, i == 1) if abs(right) < 0.5 else (np.arange(SIDE) >= 12) == (right > 0)
        rgba[:, red, :3] = (250, 0, 0)
        frames.append(Frame(f"{i}.png", camera, rgba))
    return Scene(tuple(frames), PALETTE, "drum")


def rays_in_box(seed: int = 0) -> tuple[BoxRays, Hull]:
    hull = open_box(drum())
    return BoxRays(drum(), hull, seed, torch.Generator().manual_seed(seed)), hull


def test_every_bin_has_one_sample_and_samples_fill_the_ray() -> None:
    rays, hull = rays_in_box()
    batch = rays.batches(0, 7)[0]
    assert isinstance(batch.constants, Places)
    points = batch.constants.points.view(-1, BINS, 3).double()
    inside = (points - torch.as_tensor(hull.low)) / float(hull.box.size.max())
    assert bool(((inside > -1e-4) & (inside < 1 + 1e-4)).all())
    steps = (points[:, 1:] - points[:, :-1]).norm(dim=-1)
    lengths = batch.length.view(-1, BINS).double()
    torch.testing.assert_close(steps, lengths[:, :-1], atol=1e-4, rtol=1e-3)
    bins = lengths.sum(1, keepdim=True) / (BINS - 0.5)  # a bin's length, to within half of one
    assert bool((steps < 2.05 * bins).all())
    assert bool((lengths >= 0).all())


def test_samples_depend_on_seed_and_step_alone() -> None:
    rays, _ = rays_in_box()
    first = rays.batches(0, 3)[0].length
    rays.batches(0, 4)[0]
    assert torch.equal(rays.batches(0, 3)[0].length, first)
    assert not torch.equal(rays.batches(0, 4)[0].length, first)
    assert not torch.equal(rays_in_box(1)[0].batches(0, 3)[0].length, first)


@pytest.mark.parametrize("parts", [1, 2])
def test_batches_hold_every_ray_once_background_too(parts: int) -> None:
    rays = BoxRays(drum(), open_box(drum()), 0, torch.Generator().manual_seed(0), parts)
    batches = [batch for i in range(len(rays)) for batch in rays.batches(i, 0)]
    assert len(batches) == parts * len(rays)
    assert sum(len(batch.rgb) for batch in batches) == rays.rays
    alphas = torch.cat([batch.alpha for batch in batches])
    assert int((alphas == 1).sum()) == 4 * 16 * 12
    assert int((alphas == 0).sum()) > 100


def by_grid_sample(field: TriplaneField, points: Tensor) -> Tensor:
    """Return the field's features as torch has them."""
    at, total = (points - field.low) / field.cell, torch.zeros(())
    for image, (a, b) in zip(field.plane_images(), PLANES, strict=True):
        most = at.new_tensor([field.shape[b] - 1, field.shape[a] - 1])
        places = at[:, [b, a]] * (2 / most) - 1  # grid_sample names the last axis first
        found = F.grid_sample(
            image.permute(2, 0, 1)[None],
            places[None, None],
            padding_mode="border",
            align_corners=True,
        )
        total = total + found[0, :, 0].T
    return total


def test_a_step_renders_and_learns_what_torch_alone_would() -> None:
    rays, hull = rays_in_box()
    torch.manual_seed(1)
    field = TriplaneField(hull.box, 20, 5, 6).double()
    batch = rays.batches(0, 0)[0]
    assert isinstance(batch.constants, Places)
    assert batch.even
    points, length = batch.constants.points.double(), batch.length.double()
    density, rgb = field.decode(by_grid_sample(field, points))
    slow = composite_packed(density * length, rgb, batch.ray, len(batch.rgb))
    fast = render_batch(field, replace(batch, constants=Places(points), length=length))
    gradients = []
    for color, opacity in (slow, fast):
        field.zero_grad()
        torch.autograd.backward((color * batch.rgb.double()).sum() + opacity.square().sum())
        gradients.append([values.grad for values in field.parameters()])
    torch.testing.assert_close(fast, slow)
    torch.testing.assert_close(*gradients)
    assert all(bool(g.abs().max() > 1e-3) for g in gradients[0] if g is not None)


def test_gradients_of_a_product_taken_once_match_central_differences() -> None:
    generator = torch.Generator().manual_seed(2)
    rows = torch.randint(7, (9, 4), generator=generator, dtype=torch.int32)
    rows[0] = rows[0, 0]  # a row that a sample reads four times; some that none reads
    weights = torch.rand(9, 4, generator=generator, dtype=torch.float64)
    table = torch.randn(8, 3, generator=generator, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda t: apply_once(t, rows, weights), table)
    slow = (table[rows.long()] * weights[..., None]).sum(1)
    torch.testing.assert_close(apply_once(table, rows, weights), slow)


def test_even_compositing_survives_extreme_depths() -> None:
    depth = torch.tensor([[1e30, 1e30, 0.5], [0.0, 0.0, 0.5]], requires_grad=True)
    color, opacity = composite_even(depth, torch.tensor([[[0.7, 0.2, 1.0], [1.0, 1.0, 0.4]]]))
    torch.autograd.backward(color.sum() + opacity.sum())
    assert color[0, 0].item() == pytest.approx(0.7)
    assert opacity[1].item() == pytest.approx(1 - np.exp(-0.5))
    assert depth.grad is not None
    assert bool(torch.isfinite(depth.grad).all())


def test_labels_are_the_nearest_colours_by_l2_of_the_figure_alone() -> None:
    rgba = np.array([[[200, 30, 40, 255], [90, 0, 140, 255], [0, 0, 250, 90]]], dtype=np.uint8)
    assert nearest_labels(rgba, PALETTE).tolist() == [0, 1, 255]
    assert nearest_labels(rgba, None).tolist() == [255] * 3


def test_empty_space_is_skipped_and_no_other() -> None:
    field = VoxelField(Box(np.zeros(3), np.ones(3)), 8)
    with torch.no_grad():
        field.grid[:, 0] = -30.0
        field.grid.view(9, 9, 9, 4)[2, 2, 2, 0] = 30.0
    hull = without_empty_space(Hull(np.zeros(3), 1 / 32, torch.ones(32, 32, 32)), field)
    points = torch.rand(4000, 3, generator=torch.Generator().manual_seed(0))
    seen = field(points)[0] * hull.voxel > 0.02
    assert bool((hull.support_at(points)[seen] > 0.99).all())
    assert 0.001 < float(hull.support.mean()) < 0.1


def test_the_loss_is_the_mean_over_backdrops_of_all_colours() -> None:
    """Against pictures composited over uniformly random colours, three for every ray."""
    generator = torch.Generator().manual_seed(0)
    color, drawn = (torch.rand(50, 3, generator=generator) for _ in range(2))
    opacity, alpha = (torch.rand(50, generator=generator) for _ in range(2))
    weights = any_backdrop(0.0, 0.0)
    found = photometric(color, opacity, drawn, alpha, weights.backdrop, weights.opacity)
    over = torch.rand(4000, 50, 3, generator=generator)
    rendered = color + (1 - opacity[:, None]) * over
    picture = alpha[:, None] * drawn + (1 - alpha[:, None]) * over
    expected = (rendered - picture).square().sum(-1).mean()
    assert float(found) == pytest.approx(float(expected), rel=5e-3)


UNIT, CELLS = Box(np.zeros(3), np.ones(3)), 48


@pytest.mark.parametrize(
    "build",
    [
        lambda: TriplaneField(UNIT, CELLS, 4, 8),
        lambda: VoxelField(UNIT, CELLS),
        lambda: MlpField(UNIT, 4, 8),
    ],
    ids=["triplane", "voxel", "mlp"],
)
def test_rays_see_through_the_whole_box_at_first(build: Callable[[], Field]) -> None:
    torch.manual_seed(0)
    cells, made = CELLS, build()
    along = (torch.arange(cells) + 0.5) / cells
    points = torch.stack([along, torch.full_like(along, 0.4), torch.full_like(along, 0.6)], dim=1)

    def seen_through() -> float:
        with torch.no_grad():
            return float(torch.exp(-made(points)[0].sum() / cells))

    assert seen_through() < 0.1
    made.thin(CLEARER)
    assert seen_through() > 0.7


def test_presets_are_options() -> None:
    assert [made().carve for made in PRESETS.values()] == [True, False]
    assert PRESETS["fast"]() == TrainOptions()
