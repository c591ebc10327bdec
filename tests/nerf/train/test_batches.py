"""Batches of rays: how many go through a pixel, and what a pixel is that several go through."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from lab.bench.cases.cases import train_cases
from toonset.dataset.bundle.scene import Scene
from toonset.nerf.fields.base import Places
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.hull.scene_hull import hull_of
from toonset.nerf.kernels.compositing import composite_packed
from toonset.nerf.options import TrainOptions
from toonset.nerf.train.batches import QUARTERS, Batch, make_batches
from toonset.nerf.train.loss import render_batch


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Return three drawings of 40 px."""
    whole = next(iter(train_cases(None, 0, 1, px=40))).train
    return replace(whole, frames=whole.frames[::3])


@pytest.fixture(scope="module")
def hull(scene: Scene) -> Hull:
    """Return their hull."""
    return hull_of(scene, TrainOptions(fairing=False, missing_views=0))[0]


def batches(scene: Scene, hull: Hull, parts: int = 2) -> list[Batch]:
    generator = torch.Generator().manual_seed(0)
    steps = make_batches(scene, hull, hull.voxel, 30, generator, parts=parts)
    return [batch for step in steps for batch in step]


def test_each_quarter_of_a_pixel_that_is_covered_in_part_has_a_ray(
    scene: Scene, hull: Hull
) -> None:
    for batch in batches(scene, hull):
        assert batch.pixel is not None
        assert batch.share is not None
        partly = (batch.alpha > 0) & (batch.alpha < 1)
        rays = torch.bincount(batch.pixel, minlength=len(batch.alpha))
        assert bool((rays[~partly] == 1).all())
        assert bool(((rays[partly] >= 1) & (rays[partly] <= len(QUARTERS))).all())
        assert bool((rays[partly] == len(QUARTERS)).any())
        expected = torch.where(partly, 1 / len(QUARTERS), 1.0)
        assert torch.equal(batch.share, expected[batch.pixel])


def test_every_pixel_lies_in_one_batch_however_they_are_cut(scene: Scene, hull: Hull) -> None:
    def alphas(parts: int) -> torch.Tensor:
        return torch.cat([batch.alpha for batch in batches(scene, hull, parts)])

    assert len(batches(scene, hull, 3)) == 3 * len(batches(scene, hull, 1))
    assert torch.equal(alphas(3), alphas(1))


@torch.no_grad()
def test_a_pixel_shows_the_mean_of_its_rays(scene: Scene, hull: Hull) -> None:
    torch.manual_seed(0)
    field = TriplaneField(hull.box, 12, 4, 8)
    batch = batches(scene, hull)[0]
    assert batch.pixel is not None
    assert batch.share is not None
    assert isinstance(batch.constants, Places)
    density, rgb = field(batch.constants.points)
    each = composite_packed(density * batch.length, rgb, batch.ray, batch.rays)
    color, opacity = render_batch(field, batch)
    for pixel in range(0, len(batch.alpha), 5):
        rays = (batch.pixel == pixel).nonzero()[:, 0].tolist()
        of_rays = [float(batch.share[ray]) * each[0][ray] for ray in rays]
        torch.testing.assert_close(color[pixel], torch.stack(of_rays).sum(dim=0))
        covered = sum(float(batch.share[ray]) * float(each[1][ray]) for ray in rays)
        assert float(opacity[pixel]) == pytest.approx(covered, abs=1e-6)
