"""What is written of a field and checked when it is read, and what memory a training may take."""

from __future__ import annotations

import json
import multiprocessing
import zlib
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save

from bench.cases.cases import train_cases
from toonset.camera import Camera
from toonset.cli.common.host import keep_freed_memory
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.errors import BundleError
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.kernels.threads import SIDES, use_threads
from toonset.nerf.options import TrainOptions
from toonset.nerf.run.manifest import check_manifest, write_manifest
from toonset.nerf.run.tensors import packed, parameters_of, rows_near, unpack
from toonset.nerf.train import memory
from toonset.nerf.train.carved_rays import PRUNE_AFTER
from toonset.nerf.train.loop import store_in_half
from toonset.nerf.train.loss import Model
from toonset.nerf.train.train import fit_field


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
    field = TriplaneField(hull.box, trained.field.spec.resolution, 16, 8)
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


def test_a_manifest_notices_every_file(tmp_path: Path) -> None:
    for name in ("a.json", "b.csv"):
        (tmp_path / name).write_text(f"content of {name}")
    write_manifest(tmp_path)
    check_manifest(tmp_path)
    for name in ("a.json", "b.csv"):
        kept = (tmp_path / name).read_text()
        (tmp_path / name).write_text(kept.replace("c", "k", 1))
        with pytest.raises(BundleError, match=f"{name}: is not the file"):
            check_manifest(tmp_path)
        (tmp_path / name).unlink()
        with pytest.raises(BundleError, match=f"{name}: no such file"):
            check_manifest(tmp_path)
        (tmp_path / name).write_text(kept)
    check_manifest(tmp_path)
    with pytest.raises(BundleError, match="is no file of a run"):
        check_manifest(tmp_path, ["c.json"])
    content = json.loads((tmp_path / "manifest.json").read_text())
    content["files"]["../x"] = content["files"]["a.json"]
    (tmp_path / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(BundleError, match=r"'\.\./x' is no file of a run"):
        check_manifest(tmp_path)


# ---- memory


def discs(side: int, views: int) -> Scene:
    camera = Camera.looking_at(np.zeros(3), 0.0, 0.0, side / 3, (side, side))
    away = np.hypot(*(camera.pixel_grid() - side / 2).transpose(2, 0, 1))
    rgba = np.full((side, side, 4), 255, np.uint8)
    rgba[away > side / 3, 3] = 0
    return Scene(tuple(Frame(f"{i}.png", camera, rgba) for i in range(views)), None, "discs")


def test_the_estimate_grows_with_pictures_and_is_held_against_what_is_free(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sizes = [
        memory.needed_bytes(discs(side, views), TrainOptions())
        for side, views in ((60, 4), (60, 8), (120, 8))
    ]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[1] < sizes[2] < 4e9
    cpu = torch.device("cpu")
    monkeypatch.setattr(memory, "free_bytes", lambda: sizes[0] - 1)
    with pytest.raises(BundleError, match=r"discs: training needs about .* GB of memory, .* free"):
        memory.check_memory(discs(60, 4), TrainOptions(), cpu)
    monkeypatch.setattr(memory, "free_bytes", lambda: sizes[0])
    assert "are free" in memory.check_memory(discs(60, 4), TrainOptions(), cpu)
    monkeypatch.setattr(memory, "free_bytes", lambda: None)
    assert "free" not in memory.check_memory(discs(60, 4), TrainOptions(), cpu)


def test_a_control_group_with_less_than_the_machine_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    group = tmp_path / "batch" / "job"
    group.mkdir(parents=True)
    for folder, limit in ((group, "max"), (group.parent, "3000000")):
        (folder / "memory.max").write_text(limit)
        (folder / "memory.current").write_text("2500000")
        (folder / "memory.stat").write_text("anon 1\ninactive_file 400000\n")
    monkeypatch.setattr(memory, "CGROUP", tmp_path)
    assert memory._cgroup_free(group) == []
    assert memory._cgroup_free(group.parent) == [900_000]
    monkeypatch.setattr(memory, "_cgroups_free", lambda: [900_000])
    assert memory.free_bytes() == 900_000


def test_running_out_of_memory_is_told_apart_from_other_errors() -> None:
    with pytest.raises(MemoryError, match="more than this machine has"), memory.memory_errors():
        torch.empty(2**60, dtype=torch.uint8)
    with pytest.raises(MemoryError, match="more than the GPU has"), memory.memory_errors():
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2.00 GiB")
    with pytest.raises(RuntimeError, match="mat1 and mat2"), memory.memory_errors():
        torch.mm(torch.ones(2, 3), torch.ones(2, 3))


def resident_bytes(which: str) -> int:
    """Return the memory in use now (VmRSS) or at most (VmHWM); Linux."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(which))


def trained_bytes(scene: Scene, options: TrainOptions) -> tuple[int, int]:
    """Train in this process; return its peak of memory over that before, and the estimate."""
    keep_freed_memory()
    use_threads(SIDES, SIDES)
    estimate, before = memory.needed_bytes(scene, options), resident_bytes("VmRSS")
    fit_field(scene, options)
    return resident_bytes("VmHWM") - before, estimate


@pytest.mark.slow
@pytest.mark.parametrize("carve", [True, False])
def test_the_estimate_is_near_the_real_peak(carve: bool) -> None:
    (case,) = train_cases(None, 0, 1)
    options = TrainOptions(steps=PRUNE_AFTER + 2, device="cpu", carve=carve)
    with multiprocessing.get_context("spawn").Pool(1) as pool:  # which has done nothing else
        peak, estimate = pool.apply(trained_bytes, (case.train, options))
    assert 0.7 * peak < estimate < 1.4 * peak
