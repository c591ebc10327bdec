"""Rendering views: the fast path against a slow one, and where more rays go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from jaxtyping import Float
from torch import Tensor, nn

from toonset.camera import Camera
from toonset.errors import PaletteError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import EDGE, Hull, occupancy
from toonset.nerf.hull.march import clip, rays_of
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.cast import OPAQUE_FROM, ViewRays, cast
from toonset.nerf.render.depth import normal_picture, normals_of
from toonset.nerf.render.recolor import repaint_run
from toonset.nerf.render.views import borders, places_within, render

SHAPE, VOXEL = (20, 28, 16), 0.1
LOW = np.array([-1.0, -1.4, -0.8])


class Smooth(nn.Module):
    """A field without parameters: density and colour that vary slowly, as trained ones do."""

    def forward(self, points: Float[Tensor, "n 3"]) -> tuple[Tensor, Tensor]:
        density = 3 + 1.5 * torch.sin(2 * points[:, 0]) + points[:, 1]
        return density, 0.5 + 0.3 * torch.sin(points * 2)


def ball(density: float = 1.0) -> TrainedField:
    """Return a ball of radius 0.7 whose border falls off over two voxels."""
    axes = [torch.as_tensor(LOW[i] + VOXEL * (np.arange(SHAPE[i]) + 0.5)) for i in range(3)]
    away = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).norm(dim=-1)
    support = (0.5 + (0.7 - away) / (2 * VOXEL)).clamp(0, 1).float()

    class Field(Smooth):
        def forward(self, points: Float[Tensor, "n 3"]) -> tuple[Tensor, Tensor]:
            thin, rgb = super().forward(points)
            return density * thin, rgb

    return TrainedField(Field(), Hull(LOW, VOXEL, support), 0.07, 24, None, None, 0.2, 40)  # type: ignore[arg-type]


def fast(trained: TrainedField, camera: Camera) -> np.ndarray:
    """Return what is cast through every pixel."""
    pixels = torch.as_tensor(camera.pixel_grid().reshape(-1, 2).T, dtype=torch.float32)
    return cast(ViewRays.of(Baked.of(trained), camera), pixels).T.numpy()


def slow(trained: TrainedField, camera: Camera) -> np.ndarray:
    """Return colour, opacity and weighted depth, one ray and one sample at a time."""
    rays = rays_of(camera, camera.pixel_grid().reshape(-1, 2), trained.hull)
    near, far = clip(rays, trained.hull)
    rows = []
    for i in range(len(near)):
        row, left, at = np.zeros(5), 1.0, float(near[i]) + trained.step / 2
        while at < float(far[i]) + trained.step:
            point = (rays.origins[i] + at * rays.directions[i])[None]
            density, rgb = trained.field(point)
            support = trained.hull.support_at(point)
            counted = float(occupancy(support)) if float(support) >= EDGE else 0.0
            alpha = 1 - np.exp(-float(density) * counted * trained.step)
            depth = float((point[0].numpy() - camera.target) @ camera.rotation[2])
            row += left * alpha * np.array([*rgb[0].tolist(), 1, depth])
            left *= 1 - alpha
            at += trained.step
        rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("k", [0.0, 0.3])
@pytest.mark.parametrize(("yaw", "elevation"), [(0.0, 0.0), (0.7, 0.4)])
def test_cast_rays_are_those_of_a_slow_loop(k: float, yaw: float, elevation: float) -> None:
    trained = ball()
    camera = Camera.looking_at(np.zeros(3), yaw, elevation, 9.0, (18, 18), k=k)
    found, truth = fast(trained, camera), slow(trained, camera)
    assert (truth[:, 3] > 0.3).sum() > 80
    # a ray that ends early counts as opaque; else voxels are interpolated
    assert np.abs(found[:, :4] - truth[:, :4]).max() < 1 - OPAQUE_FROM + 0.002
    assert np.abs(found - truth).mean() < 0.002


def test_a_ray_that_is_opaque_ends_and_counts_as_opaque() -> None:
    trained = ball(density=8)
    camera = Camera.looking_at(np.zeros(3), 0.3, 0.1, 9.0, (18, 18))
    found, truth = fast(trained, camera), slow(trained, camera)
    opaque = truth[:, 3] > 0.999
    assert opaque.sum() > 60
    np.testing.assert_allclose(found[opaque, 3], 1, atol=1e-6)
    assert np.abs(found[opaque, :3] - truth[opaque, :3]).max() < 1.5 * (1 - OPAQUE_FROM)


def test_a_baked_field_gives_the_view_of_the_field() -> None:
    trained = ball()
    camera = Camera.looking_at(np.zeros(3), 1.0, 0.2, 12.0, (24, 20), k=0.1)
    a, b = render(trained, camera), render(Baked.of(trained), camera)
    np.testing.assert_array_equal(a.rgb, b.rgb)
    np.testing.assert_array_equal(a.depth, b.depth)
    away = render(trained, Camera.looking_at(np.array([50.0, 0, 0]), 0.0, 0.0, 9.0, (12, 8)))
    assert away.alpha.shape == (8, 12)
    assert not away.alpha.any()
    assert np.isnan(away.depth).all()


def test_outlines_are_as_soft_as_pictures_of_many_rays() -> None:
    trained = ball(density=40)
    camera = Camera.looking_at(np.zeros(3), 0.5, 0.2, 9.0, (20, 20))
    fine = render(trained, camera.resized(8))
    truth = fine.alpha.reshape(20, 8, 20, 8).mean(axis=(1, 3))
    found = render(trained, camera).alpha
    soft = (truth > 0.1) & (truth < 0.9)
    assert soft.sum() > 20
    one = fast(trained, camera)
    error = np.abs(found - truth)[soft].mean()
    assert error < 0.06
    assert error < 0.7 * np.abs(one[:, 3].reshape(20, 20) - truth)[soft].mean()


def test_borders_are_where_neighbours_differ() -> None:
    values, labels = np.zeros((2, 6, 9), dtype=np.float32), np.zeros((6, 9), dtype=int)
    values[1, 2, 3] = 0.5
    values[0, 5, 6] = 0.01
    labels[4, 8] = 1
    expected = np.zeros((6, 9), dtype=bool)
    expected[1:4, 3] = expected[2, 2:5] = expected[3:6, 8] = expected[4, 7] = True
    np.testing.assert_array_equal(borders(values, labels), expected)


def test_rays_leap_over_what_lies_between_two_balls_and_miss_none() -> None:
    trained = ball(density=0.2)
    support = torch.cat([trained.hull.support, torch.zeros(20, 28, 30), trained.hull.support], 2)
    trained = replace(trained, hull=Hull(LOW, VOXEL, support))
    camera = Camera.looking_at(np.array([0, 0, 1.5]), 0.05, 0.03, 9.0, (18, 18))
    found, truth = fast(trained, camera), slow(trained, camera)
    away = truth[:, 4] / np.maximum(truth[:, 3], 1e-6)
    assert (np.abs(away[truth[:, 3] > 0.5]) < 1.5).sum() > 20  # rays that meet both
    np.testing.assert_allclose(found, truth, atol=0.02)


def test_places_share_a_pixel_evenly() -> None:
    chosen = np.zeros((3, 4), dtype=bool)
    chosen[1, 2] = True
    places = places_within(chosen, 2)
    assert places.tolist() == [[[2.25, 1.25], [2.75, 1.25], [2.25, 1.75], [2.75, 1.75]]]
    np.testing.assert_allclose(places_within(chosen, 5).mean(axis=1), [[2.5, 1.5]])


@pytest.mark.parametrize("k", [0.0, 0.3])
def test_normals_of_a_ball_point_away_from_its_middle(k: float) -> None:
    camera = Camera.looking_at(np.zeros(3), 0.6, 0.3, 40.0, (70, 70), k=k)
    view = render(ball(density=8), camera)
    normals = normals_of(view.depth, camera)
    points = camera.unproject(camera.pixel_grid(), view.depth)
    away = points / np.linalg.norm(points, axis=-1, keepdims=True)
    cosine = (normals * away).sum(axis=-1)
    middle = np.hypot(*(camera.pixel_grid() - 35).transpose(2, 0, 1)) < 18
    assert np.median(cosine[middle]) > 0.97
    assert np.isnan(normals[0, 0]).all()
    picture = normal_picture(view.depth, view.alpha, camera, in_camera=True)
    assert np.abs(picture[35, 35, :3].astype(int) - [128, 128, 255]).max() < 40
    assert picture[0, 0, 3] == 0


def test_a_whole_palette_is_matched_by_order_or_by_nearest() -> None:
    run = replace(ball(), palette=np.array([[250, 0, 0], [0, 0, 250]], dtype=np.uint8))
    assert run.palette is not None
    by_order = repaint_run(run, "#0000ff,#ff0000").palette
    by_nearest = repaint_run(run, "#0000ff,#ff0000,#00ff00", nearest=True).palette
    assert by_order is not None
    assert by_nearest is not None
    assert by_order.tolist() == [[0, 0, 255], [255, 0, 0]]
    assert by_nearest.tolist() == [[255, 0, 0], [0, 0, 255]]
    with pytest.raises(PaletteError, match=r"3 colours, the run has 2; .* or pass --nearest"):
        repaint_run(run, "#0000ff,#ff0000,#00ff00")
    with pytest.raises(PaletteError, match="without palette"):
        repaint_run(ball(), "#0000ff")
