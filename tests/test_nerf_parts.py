"""Laws of the trainer's parts, each fast path beside its slow specification."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from toonset.camera import Camera
from toonset.errors import BundleError
from toonset.nerf import losses
from toonset.nerf.bounds import Box, box_of_masks
from toonset.nerf.evidence import choose_missing, mask_iou
from toonset.nerf.fairing import faired
from toonset.nerf.field import PLANES, TriplaneField
from toonset.nerf.hull import EDGE, LEVEL, Hull, carve, project
from toonset.nerf.interpolation import Operator
from toonset.nerf.march import march, pixels_near, rays_of
from toonset.nerf.metrics import BEST_PSNR, compare, ssim
from toonset.nerf.rendering import composite, compositing_weights, padded

BOX = Box(np.array([-3.0, 10.0, 0.5]), np.array([1.0, 18.0, 2.5]))


def test_every_pair_of_axes_has_one_plane() -> None:
    assert sorted(map(sorted, PLANES)) == [list(p) for p in itertools.combinations(range(3), 2)]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_every_axis_changes_the_features(axis: int) -> None:
    torch.manual_seed(axis)
    field = TriplaneField(BOX, 8, 4, 8)
    points = torch.tensor([[-1.0, 14.0, 1.5]])
    moved = points.clone()
    moved[0, axis] += 0.3
    assert (field(points)[1] - field(moved)[1]).abs().max() > 1e-5


def test_composite_equals_a_loop_over_samples() -> None:
    rng = np.random.default_rng(0)
    density, color = rng.gamma(1.0, 3.0, (5, 9)), rng.random((5, 9, 3))
    edges = np.cumsum(rng.random((5, 10)), axis=1)
    fast, opacity = composite(*(torch.as_tensor(a) for a in (density, color, edges)))
    for ray in range(5):
        left, slow = 1.0, np.zeros(3)
        for i in range(9):
            alpha = 1 - math.exp(-density[ray, i] * (edges[ray, i + 1] - edges[ray, i]))
            slow += left * alpha * color[ray, i]
            left *= 1 - alpha
        np.testing.assert_allclose(fast[ray], slow, atol=1e-12)
        np.testing.assert_allclose(opacity[ray], 1 - left, atol=1e-12)


def test_composite_survives_extreme_densities() -> None:
    density = torch.tensor([[0.0, 1e30, 1e30, 0.0]], requires_grad=True)
    color = torch.tensor([[[0.1], [0.7], [0.2], [0.9]]])
    rendered, opacity = composite(density, color, torch.arange(5.0)[None])
    rendered.sum().backward()
    assert rendered.item() == pytest.approx(0.7)
    assert opacity.item() == pytest.approx(1.0)
    assert density.grad is not None
    assert bool(torch.isfinite(density.grad).all())


def test_gradients_of_compositing_match_central_differences() -> None:
    torch.manual_seed(0)
    density = torch.rand(2, 5, dtype=torch.float64, requires_grad=True)
    color = torch.rand(2, 5, 3, dtype=torch.float64, requires_grad=True)
    edges = torch.rand(2, 6, dtype=torch.float64).cumsum(1)
    assert torch.autograd.gradcheck(lambda d, c: composite(d, c, edges), (density, color))


def test_padding_changes_no_rendering() -> None:
    depth = torch.tensor([0.5, 2.0, 0.1])
    table = padded(depth[:, None], torch.tensor([0, 0, 2]), torch.tensor([0, 1, 0]), 3, 4)[..., 0]
    weights = compositing_weights(table)
    torch.testing.assert_close(weights[0, :2], compositing_weights(depth[:2]))
    assert weights[1].abs().sum() == 0
    assert weights[0, 2:].abs().sum() == 0


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


@pytest.mark.parametrize("k", [0.0, 0.15])
def test_projection_equals_the_cameras(k: float) -> None:
    camera = Camera.looking_at(np.array([1.0, 2, 3]), 0.7, -0.3, 40.0, (64, 48), roll=0.2, k=k)
    points = np.random.default_rng(0).normal(size=(50, 3)) + np.array([1.0, 2, 3])
    pixels, in_front = project(torch.as_tensor(points), camera)
    np.testing.assert_allclose(pixels, camera.project(points)[0], atol=1e-9)
    assert bool(in_front.all())


def ball_views(
    middle: np.ndarray, radius: float, count: int, k: float
) -> tuple[list[Camera], list[torch.Tensor]]:
    """Return cameras round a ball and its exact (orthographic: disc) masks."""
    cameras, alphas = [], []
    for i in range(count):
        camera = Camera.looking_at(
            middle, 2 * np.pi * i / count, 0.35 * (-1) ** i, 20 / radius, (64, 64), k=k / radius
        )
        origins, directions = camera.rays(camera.pixel_grid())
        offset = origins - middle
        along = (offset * directions).sum(-1, keepdims=True)
        distance = np.linalg.norm(offset - along * directions, axis=-1)
        soft = np.clip(0.5 + (radius - distance) * 20 / radius, 0, 1)
        cameras.append(camera)
        alphas.append(torch.as_tensor(soft, dtype=torch.float32))
    return cameras, alphas


@pytest.mark.parametrize("k", [0.0, 0.2])
@pytest.mark.parametrize("radius", [0.01, 1.0, 500.0])
def test_hull_of_a_ball_has_its_place_and_size(radius: float, k: float) -> None:
    middle = np.array([3.0, -2.0, 5.0]) * radius
    cameras, alphas = ball_views(middle, radius, 16, k)
    hull = carve(cameras, alphas, 64, 0)
    cells = np.argwhere(hull.inside.numpy())
    points = hull.low + hull.voxel * (cells + 0.5)
    np.testing.assert_allclose(points.mean(axis=0), middle, atol=0.05 * radius)
    volume = len(cells) * hull.voxel**3 / (4 / 3 * np.pi * radius**3)
    assert 0.99 < volume < 1.2  # a hull holds the body, and 16 views leave little more


def test_hull_of_a_box_is_the_box() -> None:
    half = np.array([0.5, 1.0, 0.25])
    cameras = [Camera.looking_at(np.zeros(3), yaw, 0.0, 24.0, (64, 64)) for yaw in (0, np.pi / 2)]
    alphas = []
    for width in (half[0], half[2]):
        u, v = np.moveaxis(cameras[0].pixel_grid() - 32, -1, 0) / 24.0
        mask = (np.abs(u) < width) & (np.abs(v) < half[1])
        alphas.append(torch.as_tensor(mask.astype(np.float32)))
    hull = carve(cameras, alphas, 96, 0)
    cells = np.argwhere(hull.inside.numpy())
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    np.testing.assert_allclose(hull.low + hull.voxel * low, -half, atol=0.05)
    np.testing.assert_allclose(hull.low + hull.voxel * high, half, atol=0.05)


def test_fairing_removes_corners_but_no_outline() -> None:
    cameras = [
        Camera.looking_at(np.zeros(3), yaw, 0.0, 20.0, (64, 64)) for yaw in np.arange(8) * np.pi / 4
    ]
    u, v = np.moveaxis(cameras[0].pixel_grid() - 32, -1, 0) / 20.0
    alpha = np.clip(0.5 + 20 * np.minimum(1 - np.abs(u), 1.2 - np.abs(v)), 0, 1)  # upright cylinder
    alphas = [torch.as_tensor(alpha, dtype=torch.float32)] * 8
    hull = carve(cameras, alphas, 96, 0)
    smooth = faired(hull, cameras, alphas)
    between = Camera.looking_at(np.zeros(3), np.pi / 8, 0.0, 20.0, (64, 64))
    assert mask_iou(smooth, cameras[1], alphas[1]) > 0.98
    assert mask_iou(smooth, between, alphas[0]) > mask_iou(hull, between, alphas[0]) + 0.02


def test_evidence_tolerates_one_wrong_view_only_where_there_is_one() -> None:
    cameras, alphas = ball_views(np.zeros(3), 1.0, 12, 0.0)
    assert choose_missing(cameras, alphas).missing == 0
    wrong = [torch.roll(alphas[0], 24, dims=1), *alphas[1:]]
    assert choose_missing(cameras, wrong).missing == 1


def test_cameras_along_one_line_are_refused() -> None:
    cameras, alphas = ball_views(np.zeros(3), 1.0, 4, 0.0)
    with pytest.raises(BundleError, match="one line"):
        box_of_masks([cameras[0]] * 3, [alphas[0].numpy() > 0.5] * 3)


def test_masks_that_share_nothing_are_refused() -> None:
    cameras, alphas = ball_views(np.zeros(3), 1.0, 6, 0.0)
    apart = [a.clone() for a in alphas]
    for i, alpha in enumerate(apart):  # heads here, feet there
        alpha[slice(20, None) if i % 2 else slice(None, 44)] = 0
    with pytest.raises(BundleError, match="share no volume"):
        carve(cameras, apart, 32, 0)


@pytest.mark.parametrize("level", [EDGE, LEVEL])
@pytest.mark.parametrize("k", [0.0, 0.2])
def test_march_finds_the_same_samples_as_testing_every_step(k: float, level: float) -> None:
    cameras, alphas = ball_views(np.array([0.0, 4.0, 0.0]), 1.0, 6, k)
    hull = carve(cameras, alphas, 40, 0)
    camera = cameras[1]
    rays = rays_of(camera, camera.pixel_grid().reshape(-1, 2)[::7], hull)
    step = hull.voxel * 0.8
    samples = march(rays, hull, step, 1000, level)
    reach = float(np.linalg.norm(hull.box.size))
    steps = torch.arange(-reach, reach, step / 8)
    points = rays.origins[:, None] + rays.directions[:, None] * steps[:, None]
    support = hull.support_at(points.reshape(-1, 3))
    length = (support >= level).view(len(rays.origins), -1).sum(1)
    counts = torch.bincount(samples.ray, minlength=samples.rays)
    assert (counts * 8 - length).abs().max() <= 20  # rounding at each entry and exit
    assert bool((samples.support >= level).all())
    torch.testing.assert_close(samples.support, hull.support_at(samples.points))
    assert bool((samples.distance.diff()[samples.ray.diff() == 0] > 0).all())


def test_rays_that_all_miss_have_no_samples() -> None:
    cameras, alphas = ball_views(np.zeros(3), 1.0, 6, 0.0)
    hull = carve(cameras, alphas, 40, 0)
    rays = rays_of(cameras[0], np.zeros((0, 2)), hull)
    samples = march(rays, hull, hull.voxel, 8)
    assert len(samples.ray) == len(samples.points) == samples.rays == 0


def test_pixels_left_out_certainly_miss() -> None:
    cameras, alphas = ball_views(np.zeros(3), 1.0, 6, 0.1)
    hull = carve(cameras, alphas, 40, 0)
    camera = Camera.looking_at(np.array([0.6, 0.2, 0]), 0.4, 0.3, 12.0, (90, 60), k=0.2)
    near = pixels_near(camera, hull)
    samples = march(rays_of(camera, camera.pixel_grid().reshape(-1, 2), hull), hull, hull.voxel, 1)
    hit = np.zeros(near.size, dtype=bool)
    hit[samples.ray.numpy()] = True
    assert hit.any()
    assert near.reshape(-1)[hit].all()
    assert near.mean() < 0.6  # else the test above proves nothing


def test_support_is_zero_outside_and_exact_at_centres() -> None:
    values = torch.rand(4, 5, 6)
    hull = Hull(np.array([1.0, 2.0, 3.0]), 0.5, values)
    index = torch.cartesian_prod(torch.arange(4), torch.arange(5), torch.arange(6))
    centres = torch.tensor([1.0, 2.0, 3.0]) + 0.5 * (index + 0.5)
    torch.testing.assert_close(hull.support_at(centres), values.reshape(-1))
    assert hull.support_at(torch.tensor([[0.0, 0, 0], [9.0, 9, 9]])).abs().max() == 0


def test_losses_are_zero_only_where_they_should() -> None:
    drawn = torch.rand(6, 3)
    full, half = torch.ones(6), torch.full((6,), 0.5)
    assert losses.photometric(drawn, full, drawn, full) == 0
    assert losses.photometric(drawn * 0.5, half, drawn, half) == 0
    assert losses.photometric(drawn * 0.5, half, drawn, full) > 0
    assert losses.photometric(drawn, full, drawn, half) > 0
    assert losses.total_variation([torch.ones(4, 5, 2)]) == 0
    assert losses.total_variation([torch.eye(4)[..., None]]) > 0
    logits = torch.randn(4, 3)
    unlabelled = torch.full((4,), 255)
    assert losses.cross_entropy(logits, unlabelled) == 0
    some = torch.tensor([0, 255, 255, 255])
    torch.testing.assert_close(
        losses.cross_entropy(logits, some), F.cross_entropy(logits[:1], some[:1])
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
