"""Laws of the visual hull and of marching through it, each fast path beside its specification."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from toonset.camera import Camera
from toonset.dataset.silhouettes.bounds import box_of_masks
from toonset.errors import BundleError
from toonset.nerf.hull.hull import EDGE, LEVEL, Hull, carve, grow
from toonset.nerf.hull.march import march, pixels_near, rays_of
from toonset.nerf.hull.support import agreement, project
from toonset.nerf.hull.tolerance import choose_missing


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


@pytest.mark.parametrize("missing", [0, 1, 2])
@pytest.mark.parametrize("k", [0.0, 0.2])
def test_carving_by_blocks_equals_asking_every_voxel(k: float, missing: int) -> None:
    cameras, alphas = ball_views(np.array([0.0, 4.0, 0.0]), 1.0, 7, k)
    alphas[2] = torch.roll(alphas[2], 9, dims=1)  # views that disagree, a figure cut off
    alphas[4] = alphas[4].roll(25, dims=0)
    hull = carve(cameras, alphas, 53, missing)
    every = agreement(hull.centres(), cameras, alphas, missing).view(hull.support.shape)
    assert 0 < (every > 0).float().mean() < 0.9
    torch.testing.assert_close(hull.support, every, atol=1e-4, rtol=0)


def test_carving_survives_a_camera_inside_the_box() -> None:
    cameras, alphas = ball_views(np.zeros(3), 1.0, 6, 0.0)
    cameras[0] = Camera.looking_at(np.zeros(3), 0.0, 0.0, 20.0, (64, 64), k=0.9)
    hull = carve(cameras, alphas, 40, 1)
    every = agreement(hull.centres(), cameras, alphas, 1).view(hull.support.shape)
    torch.testing.assert_close(hull.support, every, atol=1e-4, rtol=0)


@pytest.mark.parametrize("by", [0, 1, 3])
def test_growing_is_pooling_the_largest(by: int) -> None:
    volume = torch.rand(7, 2, 9, generator=torch.Generator().manual_seed(by))
    pooled = F.max_pool3d(volume[None, None], 2 * by + 1, stride=1, padding=by)[0, 0]
    torch.testing.assert_close(grow(volume, by), pooled)
    torch.testing.assert_close(grow(volume > 0.9, by), grow((volume > 0.9).float(), by) > 0)


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


def test_evidence_tolerates_one_wrong_view_only_where_there_is_one() -> None:
    cameras, alphas = ball_views(np.zeros(3), 1.0, 12, 0.0)
    assert choose_missing(cameras, alphas).missing == 0
    wrong = [torch.roll(alphas[0], 24, dims=1), *alphas[1:]]
    assert choose_missing(cameras, wrong).missing == 1


def test_masks_that_share_nothing_and_cameras_along_one_line_are_refused() -> None:
    cameras, alphas = ball_views(np.zeros(3), 1.0, 6, 0.0)
    apart = [a.clone() for a in alphas]
    for i, alpha in enumerate(apart):  # heads here, feet there
        alpha[slice(20, None) if i % 2 else slice(None, 44)] = 0
    with pytest.raises(BundleError, match="share no volume"):
        carve(cameras, apart, 32, 0)
    with pytest.raises(BundleError, match="one line"):
        box_of_masks([cameras[0]] * 3, [alphas[0].numpy() > 0.5] * 3)


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


@pytest.mark.parametrize("most", [1, 5, 24])
def test_the_first_samples_are_those_of_the_whole_ray(most: int) -> None:
    x, y, z = torch.meshgrid(*(torch.arange(n) * 0.06 - 1.17 for n in (40, 40, 100)), indexing="ij")
    along = torch.minimum(z.square(), (3.6 - z).square())  # two balls, one behind another
    apart = 1.2 - (x**2 + y**2 + along)
    both = Hull(np.full(3, -1.2), 0.06, apart.clamp(0, 1))
    camera = Camera.looking_at(np.array([0.0, 0.0, 1.8]), 0.05, 0.02, 12.0, (48, 48), k=0.05)
    rays = rays_of(camera, camera.pixel_grid().reshape(-1, 2), both)
    every, few = march(rays, both, 0.05, 1 << 20), march(rays, both, 0.05, most)
    kept = every.order < most
    assert 0 < int(kept.sum()) < len(every.ray)
    for name in ("points", "ray", "order", "distance", "support"):
        torch.testing.assert_close(getattr(few, name), getattr(every, name)[kept])


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
    nothing = march(rays_of(camera, np.zeros((0, 2)), hull), hull, hull.voxel, 8)
    assert len(nothing.ray) == len(nothing.points) == nothing.rays == 0


def test_support_is_zero_outside_and_exact_at_centres() -> None:
    values = torch.rand(4, 5, 6)
    hull = Hull(np.array([1.0, 2.0, 3.0]), 0.5, values)
    index = torch.cartesian_prod(torch.arange(4), torch.arange(5), torch.arange(6))
    centres = torch.tensor([1.0, 2.0, 3.0]) + 0.5 * (index + 0.5)
    torch.testing.assert_close(hull.support_at(centres), values.reshape(-1))
    assert hull.support_at(torch.tensor([[0.0, 0, 0], [9.0, 9, 9]])).abs().max() == 0
