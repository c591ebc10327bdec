"""What is written of a field and checked when it is read."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
import torch
from safetensors.torch import save

from toonset.errors import BundleError
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.run.tensors import packed, parameters_of, rows_near, unpack
from toonset.nerf.train.loop import store_in_half
from toonset.nerf.train.loss import Model


def figure(seed: int, voxel: float = 0.05, resolution: int = 24) -> TrainedField:
    """Return a field with random parameters in a hull of two balls in a box off the origin."""
    torch.manual_seed(seed)
    low, counts = np.array([3.0, -2.0, 0.5]), (30, 44, 23)
    grid = torch.cartesian_prod(*(torch.arange(n) + 0.5 for n in counts)) * voxel
    middles = torch.tensor([[0.6, 0.7, 0.5], [0.9, 1.6, 0.6]]) * (voxel / 0.05)
    distance = torch.cdist(grid, middles).amin(dim=1) / voxel
    support = ((10 - distance) / 3).clamp(0, 1).reshape(counts)
    hull = Hull(low, voxel, (support * 255).round() / 255)
    field = TriplaneField(hull.box, resolution, 16, 8)
    trained = TrainedField(
        field, hull, 0.05, 24, PaletteClassifier(3), np.zeros((3, 3), np.uint8), 0.0, 40
    )
    store_in_half(Model(field, trained.classifier))
    return trained


def planes_of(trained: TrainedField) -> TriplaneField:
    assert isinstance(trained.field, TriplaneField)
    return trained.field


def empty(trained: TrainedField) -> TrainedField:
    hull = Hull(trained.hull.low, trained.hull.voxel, torch.zeros_like(trained.hull.support))
    field = TriplaneField(hull.box, planes_of(trained).resolution, 16, 8)
    colors, k = trained.palette, trained.k
    return TrainedField(field, hull, 0.05, 24, PaletteClassifier(3), colors, k, 40)


@pytest.mark.parametrize(("voxel", "resolution"), [(0.05, 24), (0.05, 70), (7.0, 18)])
def test_what_is_loaded_is_what_was_trained_wherever_a_ray_can_look(
    voxel: float, resolution: int
) -> None:
    trained = figure(1, voxel, resolution)
    loaded = empty(trained)
    unpack(packed(trained), loaded, "model")
    assert torch.equal(trained.hull.support, loaded.hull.support)
    near = trained.hull.near.nonzero()
    assert 0 < len(near) < trained.hull.near.numel()
    generator = torch.Generator().manual_seed(0)
    low = torch.as_tensor(trained.hull.low, dtype=torch.float32)
    corners = torch.cartesian_prod(*[torch.tensor([0.0, 1.0])] * 3)
    inside = torch.cat([torch.rand(40, 3, generator=generator), corners])
    points = (near[:, None] + inside).reshape(-1, 3) * voxel + low
    for a, b in zip(trained.field(points), loaded.field(points), strict=True):
        assert torch.equal(a, b)
    used = rows_near(planes_of(trained), trained.hull)
    assert 0.2 < used.float().mean() < 0.95  # something is saved
    rows = planes_of(trained).taps(points)[0]
    assert bool(used[rows.long()].all())
    size = len(save(packed(trained)))
    plain = sum(v.numel() for v in parameters_of(trained).values()) * 4
    assert size < 0.6 * (plain + trained.hull.support.numel())


def test_a_tensor_file_claims_what_it_likes_and_is_refused() -> None:
    trained = figure(2)
    fine, target = packed(trained), empty(trained)

    def bytes_of(data: bytes) -> torch.Tensor:
        return torch.frombuffer(bytearray(data), dtype=torch.uint8)

    cells = trained.hull.support.numel()
    bad = {
        "hull is damaged": [
            {"hull": bytes_of(zlib.compress(bytes(200 * 2**20)))},  # a bomb
            {"hull": bytes_of(zlib.compress(bytes(cells - 1)))},
            {"hull": bytes_of(zlib.compress(bytes(cells))[:-5])},
            {"hull": bytes_of(b"nothing of the kind")},
            {"hull": fine["hull"].float()},
        ],
        "rows of another table": [{"field.planes.rows": fine["field.planes.rows"][:-1]}],
        "field.planes is": [
            {"field.planes": fine["field.planes"][1:]},
            {"field.planes": fine["field.planes"].float()},
            {"field.planes.rows": torch.zeros_like(fine["field.planes.rows"])},
        ],
        "not finite": [{"field.planes": fine["field.planes"] * float("inf")}],
        "missing or unknown: x": [{"x": fine["hull"]}],
    }
    for message, changes in bad.items():
        for change in changes:
            with pytest.raises(BundleError, match=message):
                unpack(fine | change, target, "model")
    unpack(fine, target, "model")


def test_half_precision_is_idempotent_and_never_overflows() -> None:
    trained = figure(3)
    model, field = Model(trained.field, trained.classifier), planes_of(trained)
    with torch.no_grad():
        field.planes[0, :2] = torch.tensor([1e9, -1e9])
        decoder = field.hidden.weight.clone()
    store_in_half(model)
    once = field.planes.detach().clone()
    assert bool(torch.isfinite(once).all())
    store_in_half(model)
    assert torch.equal(once, field.planes)
    assert torch.equal(once, once.half().float())
    assert torch.equal(decoder, field.hidden.weight)  # small parts stay as they are
