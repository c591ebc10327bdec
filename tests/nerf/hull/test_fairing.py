"""The fair surface: its parts beside torch's and scipy's, and what it does to a hull."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from scipy import ndimage
from torch import Tensor

from toonset.camera import Camera
from toonset.nerf.hull.fairing import UNKNOWN, fair_hull, sheets, signed_distance, squared_distance
from toonset.nerf.hull.fairing_fit import Contacts, Pyramid
from toonset.nerf.hull.hull import Hull, carve
from toonset.nerf.hull.tolerance import mask_iou
from toonset.nerf.kernels.volume import add_bending, inner, laplacian, trilinear


@pytest.mark.parametrize("seed", [0, 1])
def test_squared_distance_is_scipys_within_reach(seed: int) -> None:
    cells = np.random.default_rng(seed).random((14, 9, 20)) < 0.004
    cells[3, 4, 5] = True
    expected = np.square(np.asarray(ndimage.distance_transform_edt(~cells)))
    found = squared_distance(torch.as_tensor(cells), 6).numpy()
    assert (expected <= 36).mean() > 0.3
    np.testing.assert_allclose(found[expected <= 36], expected[expected <= 36], atol=1e-6)
    assert (found[expected > 36] > 36).all()
    assert (squared_distance(torch.zeros(3, 4, 5, dtype=torch.bool), 9) >= UNKNOWN).all()


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_signed_distance_of_a_ball(factor: int) -> None:
    places = torch.stack(torch.meshgrid(*[torch.arange(50) - 24.3] * 3, indexing="ij"))
    ball = Hull(np.zeros(3), 1.0, (0.5 + 13.2 - places.norm(dim=0)).clamp(0, 1))
    found = signed_distance(ball, factor)
    padded = F.pad(places.norm(dim=0) - 13.2, [0, -50 % factor] * 3, value=99)
    expected = F.avg_pool3d(padded[None] / factor, factor)[0]
    wrong = factor * (found - expected).abs()  # in voxels, which are as rough as that
    assert wrong[expected.abs() < 4].max() < 1
    assert wrong[expected.abs() < 0.25 / factor].max() < 0.25


def test_a_pyramid_is_the_sum_of_its_enlarged_levels() -> None:
    torch.manual_seed(0)
    shape = torch.Size([13, 8, 17])
    pyramid = Pyramid.over(shape)
    levels = [torch.randn_like(level).requires_grad_() for level in pyramid.zeros()]
    slow = torch.zeros(shape)
    for cell, level in zip((1, 2, 4, 8), levels, strict=True):
        wide = F.interpolate(level[None, None], scale_factor=cell, mode="trilinear")
        slow = slow + wide[0, 0, :13, :8, :17]
    torch.testing.assert_close(pyramid.spread(levels), slow)
    upstream = torch.randn(shape)
    pairs = zip(
        pyramid.gathered(upstream), torch.autograd.grad(slow, levels, upstream), strict=True
    )
    for gradient, expected in pairs:
        torch.testing.assert_close(gradient, expected, rtol=1e-4, atol=1e-4)


def test_bending_has_the_gradient_that_is_added() -> None:
    torch.manual_seed(1)
    f = torch.randn(5, 6, 7, dtype=torch.float64, requires_grad=True)
    weights = torch.rand_like(inner(f))
    (expected,) = torch.autograd.grad((weights * laplacian(f).square()).sum(), f)
    gradient = torch.zeros_like(f)
    add_bending(gradient, f.detach(), weights)
    torch.testing.assert_close(2 * gradient, expected)
    x, y, z = torch.meshgrid(*(torch.arange(n).double() for n in f.shape), indexing="ij")
    torch.testing.assert_close(laplacian(x**2 + 3 * y - z**2 / 2), torch.ones_like(weights))


def test_contacts_read_and_write_as_grid_sample_does() -> None:
    torch.manual_seed(2)
    volume = torch.randn(5, 4, 6, requires_grad=True)
    at = torch.rand(40, 3) * torch.tensor([7.0, 6.0, 8.0]) - 1  # beyond the border, too
    unit = (at + 0.5) * 2 / torch.tensor([5.0, 4.0, 6.0]) - 1
    grid = unit.flip(-1)[None, None, None]
    slow = F.grid_sample(volume[None, None], grid, padding_mode="border", align_corners=False)
    slow = slow[0, 0, 0, 0]
    contacts = Contacts(*trilinear(at, volume.shape), torch.arange(40) // 10, 4)
    torch.testing.assert_close(contacts.values(volume.detach()), slow)
    upstream, gradient = torch.randn(40), torch.zeros(5, 4, 6)
    contacts.add_to(gradient, upstream)
    torch.testing.assert_close(gradient, torch.autograd.grad(slow, volume, upstream)[0])
    lowest = contacts.lowest(volume.detach())
    torch.testing.assert_close(lowest.values(volume.detach()), slow.view(4, 10).amin(dim=1))


def test_fairing_removes_corners_but_no_outline() -> None:
    cameras = [
        Camera.looking_at(np.zeros(3), yaw, 0.0, 20.0, (64, 64)) for yaw in np.arange(8) * np.pi / 4
    ]
    u, v = np.moveaxis(cameras[0].pixel_grid() - 32, -1, 0) / 20.0
    alpha = np.clip(0.5 + 20 * np.minimum(1 - np.abs(u), 1.2 - np.abs(v)), 0, 1)  # upright cylinder
    alphas = [torch.as_tensor(alpha, dtype=torch.float32)] * 8
    hull = carve(cameras, alphas, 96, 0)
    smooth = fair_hull(hull, cameras, alphas)
    between = Camera.looking_at(np.zeros(3), np.pi / 8, 0.0, 20.0, (64, 64))
    assert mask_iou(smooth, cameras[1], alphas[1]) > 0.98
    assert mask_iou(smooth, between, alphas[0]) > mask_iou(hull, between, alphas[0]) + 0.02


def test_a_cape_is_a_sheet_and_a_body_with_its_corners_is_none() -> None:
    x, y, z = torch.meshgrid(*(torch.arange(40.0),) * 3, indexing="ij")
    body = ((x - 15).abs() + (y - 20).abs() < 11) & (z > 4) & (z < 36)  # a prism of sharp corners
    cape = (x > 32) & (x < 36) & (y > 8) & (y < 32) & (z > 4) & (z < 36)
    found = sheets(Hull(np.zeros(3), 1.0, (body | cape).float()), 3)
    assert bool(found[cape].all())
    assert not bool(found[~cape].any())


def test_fairing_leaves_no_hole_in_a_cape() -> None:
    x, y = np.meshgrid(np.linspace(-1, 1, 250), np.linspace(-1, 1, 250))
    cape = np.stack([0.8 * x, y, np.full_like(x, -0.8)], axis=-1)
    body = np.stack([0.5 * np.sin(np.pi * x), y, 0.5 * np.cos(np.pi * x)], axis=-1)
    figure = np.concatenate([cape.reshape(-1, 3), body.reshape(-1, 3)])

    def seen(yaw: float) -> tuple[Camera, Tensor]:
        camera = Camera.looking_at(np.zeros(3), yaw, 0.0, 50.0, (128, 128))
        alpha = torch.zeros(128, 128)
        column, row = np.floor(camera.project(figure)[0]).astype(int).T
        alpha[row, column] = 1.0
        return camera, alpha

    cameras, alphas = zip(*(seen(yaw) for yaw in np.arange(8) * np.pi / 4), strict=True)
    smooth = fair_hull(carve(cameras, alphas, 128, 0), cameras, alphas)
    for between in (3, 5):  # beside the body, through what was the cape
        assert mask_iou(smooth, *seen(between * np.pi / 8)) > 0.95
