"""Training end to end on a figure whose pictures are computed exactly: coloured ellipsoids."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.errors import BundleError, PaletteError
from toonset.nerf.options import TrainOptions
from toonset.nerf.render.animation import encode_gif
from toonset.nerf.render.layers import alpha_picture, color_picture, depth_picture, palette_picture
from toonset.nerf.render.recolor import recolored
from toonset.nerf.render.turntable import turntable
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import read_field
from toonset.nerf.run.report import write_run
from toonset.nerf.score.evaluate import evaluate
from toonset.nerf.score.metrics import compare
from toonset.nerf.train import gradients
from toonset.nerf.train import loss as loss_module
from toonset.nerf.train import train as train_module
from toonset.nerf.train.batches import Batch
from toonset.nerf.train.labelling import labelled
from toonset.nerf.train.loop import LEAST_STEPS
from toonset.nerf.train.result import Training
from toonset.nerf.train.train import fit_field
from toonset.palette.names import name_of

SIDE, FINE = 48, 3
PARTS = (  # middle, half axes, colour: body, head, a pack on one side of the back
    ((0.0, 0.0, 0.0), (0.45, 0.7, 0.35), (200, 40, 40)),
    ((0.0, 0.9, 0.05), (0.4, 0.4, 0.4), (240, 200, 160)),
    ((0.3, 0.1, -0.4), (0.25, 0.35, 0.25), (40, 80, 200)),
)
QUICK = TrainOptions(steps=60, device="cpu", missing_views=0)


def draw(camera: Camera) -> np.ndarray:
    """Return the RGBA picture of the ellipsoids, area-averaged."""
    fine = camera.resized(FINE)
    origins, directions = fine.rays(fine.pixel_grid())
    best = np.full(origins.shape[:2], np.inf)
    color = np.zeros((*best.shape, 4))
    for middle, axes, rgb in PARTS:
        o, d = (origins - middle) / axes, directions / axes
        a, b, c = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
        inside = b * b - a * c
        t = (-b - np.sqrt(np.maximum(inside, 0))) / a
        nearer = (inside > 0) & (t < best)
        best[nearer] = t[nearer]
        color[nearer] = (*np.array(rgb) / 255, 1)
    mean = color.reshape(SIDE, FINE, SIDE, FINE, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], 1e-9)
    return (mean * 255 + 0.5).astype(np.uint8)


def scene_of(yaws: list[float], elevation: float, k: float, unit: float = 1.0) -> Scene:
    """Return the drawn scene in a world of `unit` times the size (drawn in the world of 1)."""
    frames = []
    for i, yaw in enumerate(yaws):
        camera = Camera.looking_at(np.array([0, 0.3, 0]), yaw, elevation, 19.0, (SIDE, SIDE), k=k)
        moved = replace(
            camera, target=camera.target * unit, scale=camera.scale / unit, k=camera.k / unit
        )
        frames.append(Frame(f"{i:03d}.png", moved, draw(camera)))
    return Scene(tuple(frames), None, "ellipsoids")


def train_scene(k: float = 0.15, unit: float = 1.0) -> Scene:
    return scene_of([2 * np.pi * i / 8 for i in range(8)], 0.1, k, unit)


def held_out(k: float = 0.15, unit: float = 1.0) -> Scene:
    return scene_of([0.3, 1.9, 4.1], 0.2, k, unit)


@pytest.fixture(scope="module")
def training() -> Training:
    return fit_field(labelled(train_scene())[0], QUICK)


def mean_psnr(training: Training, test: Scene) -> float:
    value = evaluate(training.result, test)["rgb"]["psnr"]
    assert isinstance(value, float)
    return value


def test_new_views_are_predicted(training: Training) -> None:
    test = held_out()
    found = evaluate(training.result, test)
    # What wrong fields reach: nothing, and the picture of a neighbouring training view.
    blank = [compare(np.zeros_like(f.rgba), f.rgba)["psnr"] or 0 for f in test.frames]
    copied = [
        max(compare(t.rgba, f.rgba)["psnr"] or 0 for t in train_scene().frames) for f in test.frames
    ]
    assert found["rgb"]["psnr"] > 24
    assert found["rgb"]["psnr"] > np.mean(blank) + 10
    assert found["rgb"]["psnr"] > np.mean(copied) + 3
    assert found["palette"]["psnr"] > 22
    assert found["rgb"]["ssim"] > 0.9


@pytest.mark.parametrize(("k", "unit"), [(0.0, 1.0), (0.15, 1000.0), (0.15, 0.001)])
def test_orthographic_views_and_worlds_of_any_size(k: float, unit: float) -> None:
    training = fit_field(train_scene(k, unit), QUICK)
    assert mean_psnr(training, held_out(k, unit)) > 23


def test_same_seed_same_bits_other_seed_other_bits() -> None:
    scene = labelled(train_scene())[0]
    few = replace(QUICK, steps=5)
    states = []
    for options in (few, few, replace(few, seed=1)):
        result = fit_field(scene, options).result
        assert result.classifier is not None
        states.append([*result.field.parameters(), *result.classifier.parameters()])
    assert all(torch.equal(a, b) for a, b in zip(states[0], states[1], strict=True))
    assert not torch.equal(states[0][0], states[2][0])


def test_a_loss_that_is_no_number_keeps_the_last_good_state(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    real = loss_module.loss_terms
    calls = iter(range(1000))  # two a step: its rays are in two parts

    def poisoned(
        model: loss_module.Model, batch: Batch, weights: loss_module.Weights
    ) -> tuple[torch.Tensor, ...]:
        first, *rest = real(model, batch, weights)
        return (first * (float("nan") if next(calls) == 51 else 1.0), *rest)

    monkeypatch.setattr(gradients, "loss_terms", poisoned)
    training = fit_field(train_scene(), QUICK)
    assert training.stopped == "loss not finite at step 25, kept the state of step 20"
    assert len(training.history) == 25
    assert all(bool(torch.isfinite(p).all()) for p in training.result.field.parameters())
    assert mean_psnr(training, held_out()) > 15


def test_a_budget_ends_training() -> None:
    training = fit_field(train_scene(), replace(QUICK, steps=100_000, budget_s=0.5))
    assert training.stopped == "budget"
    assert LEAST_STEPS <= len(training.history) < 100_000


def test_a_budget_counts_what_comes_before_the_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    real = train_module.hull_of

    def slow(*given: Any) -> Any:
        time.sleep(1.0)
        return real(*given)

    monkeypatch.setattr(train_module, "hull_of", slow)
    training = fit_field(train_scene(), replace(QUICK, steps=100_000, budget_s=0.9))
    assert training.stopped == "budget"
    assert len(training.history) == LEAST_STEPS  # none of it was left


def test_pictures_without_a_background_are_refused() -> None:
    scene = train_scene()
    rgba = scene.frames[2].rgba.copy()
    rgba[..., 3] = 255
    frames = (*scene.frames[:2], replace(scene.frames[2], rgba=rgba), *scene.frames[3:])
    with pytest.raises(BundleError, match="no transparent background"):
        fit_field(replace(scene, frames=frames), QUICK)


def test_one_view_is_refused() -> None:
    with pytest.raises(BundleError, match="at least two views"):
        fit_field(scene_of([0.0], 0.0, 0.0), QUICK)


def test_empty_pictures_are_passed_over() -> None:
    scene = train_scene()
    empty = replace(scene.frames[0], rgba=np.zeros_like(scene.frames[0].rgba))
    training = fit_field(replace(scene, frames=(*scene.frames, empty)), replace(QUICK, steps=2))
    assert len(training.history) == 2


def test_layers_agree_with_the_geometry(training: Training) -> None:
    camera = train_scene().frames[0].camera
    view = render(training.result, camera)
    truth = draw(camera)
    alpha = alpha_picture(view)
    assert (np.abs(alpha[..., 0].astype(int) - truth[..., 3]) > 128).mean() < 0.01
    assert (alpha[..., 3] == 255).all()
    assert view.labels is not None
    palette = training.result.palette
    assert palette is not None
    body = view.labels[36, 24]
    assert np.abs(palette[body].astype(int) - [200, 40, 40]).max() < 12
    assert view.labels[0, 0] == 255
    # The body's front is 0.35 before its middle, the target lies in the middle.
    assert view.depth[30, 24] == pytest.approx(-0.35, abs=0.12)
    assert np.isnan(view.depth[0, 0])
    grey = depth_picture(view)
    assert grey[0, 0, 3] == 0
    assert grey[..., 0][grey[..., 3] >= 128].min() == 0
    assert grey[..., 0].max() == 255
    straight = color_picture(view.rgb, view.alpha)
    edge = (straight[..., 3] > 60) & (straight[..., 3] < 200)
    assert edge.any()
    near = np.abs(straight[edge][:, None, :3].astype(int) - [c for *_, c in PARTS]).max(-1).min(1)
    assert np.median(near) < 40  # straight colour: no halo of white or black on soft edges


def test_recolor_replaces_one_colour_and_nothing_else(training: Training) -> None:
    palette = training.result.palette
    assert palette is not None
    index = int(np.abs(palette.astype(int) - [40, 80, 200]).sum(1).argmin())
    old = "#{:02x}{:02x}{:02x}".format(*palette[index].tolist())
    changed = recolored(training.result, [f"{old}=#00ff00"])
    camera = train_scene().frames[4].camera
    before, after = render(training.result, camera), render(changed, camera)
    a = palette_picture(before, training.result.palette)
    b = palette_picture(after, changed.palette)
    assert before.shares is not None
    untouched = before.shares[..., index] == 0
    np.testing.assert_array_equal(a[untouched], b[untouched])
    full = (before.shares[..., index] > 0.99 * before.alpha) & (before.alpha > 0.5)
    assert full.sum() > 20
    assert np.abs(b[full][:, :3].astype(int) - [0, 255, 0]).max() <= 3
    with pytest.raises(PaletteError, match="choose one of them"):
        recolored(training.result, ["#123456=#000000"])
    by_name = recolored(training.result, [f"{name_of(tuple(palette[index].tolist()))}=#00ff00"])
    assert by_name.palette is not None
    assert changed.palette is not None
    assert (by_name.palette == changed.palette).all()
    with pytest.raises(PaletteError, match="OLD=NEW"):
        recolored(training.result, ["#123456"])
    with pytest.raises(PaletteError, match="without palette"):
        recolored(replace(training.result, palette=None), [f"{old}=#00ff00"])


def test_turntable_frames_the_figure(training: Training) -> None:
    cameras = turntable(training.result, 4, 0.2, 40)
    pictures = []
    for camera in cameras:
        view = render(training.result, camera)
        pictures.append(color_picture(view.rgb, view.alpha))
        assert view.alpha[[0, -1]].max() == 0
        assert view.alpha[:, [0, -1]].max() == 0
        assert np.ptp(np.flatnonzero((view.alpha > 0.5).any(axis=1))) > 20
    assert cameras[0].angles[0] == pytest.approx(0)
    assert cameras[1].angles[0] == pytest.approx(np.pi / 2)
    assert encode_gif(pictures)[:6] == b"GIF89a"


@pytest.mark.parametrize(
    ("options", "least"),
    [
        (replace(QUICK, field="voxel"), 22.0),
        (replace(QUICK, field="hull"), 17.0),
        (replace(QUICK, field="mlp", steps=3), 5.0),
        (replace(QUICK, carve=False, smoothness=0.0, steps=40), 15.0),
    ],
    ids=["voxel", "hull", "mlp", "box"],
)
def test_other_fields_are_trained_rendered_and_read_again(
    tmp_path: Path, options: TrainOptions, least: float
) -> None:
    scene, test = labelled(train_scene())[0], held_out()
    training = fit_field(scene, options)
    write_run(tmp_path, training, replace(scene, frames=scene.frames[:1]))
    loaded, camera = read_field(tmp_path), test.frames[0].camera
    first, again = render(training.result, camera), render(loaded, camera)
    np.testing.assert_array_equal(first.rgb, again.rgb)
    found = compare(color_picture(first.rgb, first.alpha), test.frames[0].rgba)["psnr"]
    assert found is not None
    assert found > least


@pytest.fixture
def run_folder(tmp_path: Path, training: Training) -> Path:
    write_run(tmp_path, training, labelled(train_scene())[0])
    return tmp_path


def test_a_run_folder_renders_the_same_after_loading(run_folder: Path, training: Training) -> None:
    loaded = read_field(run_folder)
    for camera in (held_out().frames[0].camera, turntable(loaded, 3, 0.1)[1]):
        a, b = render(training.result, camera), render(loaded, camera)
        np.testing.assert_array_equal(a.rgb, b.rgb)
        np.testing.assert_array_equal(a.depth, b.depth)
        np.testing.assert_array_equal(a.labels, b.labels)
    names = {"model.safetensors", "config.json", "metrics.json", "history.csv", "preview.png"}
    assert {file.name for file in run_folder.iterdir()} == {*names, "manifest.json"}
    assert len((run_folder / "history.csv").read_text().splitlines()) == QUICK.steps + 1
    assert json.loads((run_folder / "metrics.json").read_text())["train"]["psnr"] > 24


def truncate(folder: Path) -> None:
    file = folder / "model.safetensors"
    file.write_bytes(file.read_bytes()[:-1000])


def not_a_model(folder: Path) -> None:
    (folder / "model.safetensors").write_bytes(b"PK\x03\x04 nothing of the kind")


def drop_tensor(folder: Path) -> None:
    tensors = load_file(folder / "model.safetensors")
    del tensors["field.out.bias"]
    save_file(tensors, folder / "model.safetensors")


def wrong_shape(folder: Path) -> None:
    tensors = load_file(folder / "model.safetensors")
    tensors["field.planes"] = tensors["field.planes"][:-1].clone()
    save_file(tensors, folder / "model.safetensors")


def wrong_type(folder: Path) -> None:
    tensors = load_file(folder / "model.safetensors")
    tensors["field.planes"] = tensors["field.planes"].double()
    save_file(tensors, folder / "model.safetensors")


def not_a_number(folder: Path) -> None:
    tensors = load_file(folder / "model.safetensors")
    tensors["field.planes"][3, 2] = float("nan")
    save_file(tensors, folder / "model.safetensors")


def change_config(**changes: object) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        config = json.loads((folder / "config.json").read_text())
        config["field"].update(changes)
        (folder / "config.json").write_text(json.dumps(config))

    return change


def other_format(folder: Path) -> None:
    config = json.loads((folder / "config.json").read_text())
    config["format"] = 99
    (folder / "config.json").write_text(json.dumps(config))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (truncate, "damaged"),
        (not_a_model, "damaged"),
        (drop_tensor, "field.out.bias"),
        (wrong_shape, "field.planes is"),
        (wrong_type, "float64"),
        (not_a_number, "not finite"),
        (other_format, "format 99"),
        (change_config(hull_voxel=-1.0), "hull_voxel"),
        (change_config(hull_shape=[100000, 100000, 100000]), "hull_shape"),
        (change_config(hull_shape=[0, 3, 3]), "hull_shape"),
        (change_config(resolution=10**9), "resolution"),
        (change_config(palette=[[300, 0, 0]]), "palette"),
        (change_config(surprise=1), "surprise"),
        (lambda folder: (folder / "config.json").unlink(), "does not exist"),
        (lambda folder: (folder / "config.json").write_text("{"), "no valid JSON"),
    ],
)
def test_a_damaged_run_gets_one_clear_line(
    run_folder: Path, damage: Callable[[Path], object], message: str
) -> None:
    damage(run_folder)
    with pytest.raises(BundleError, match=message):
        read_field(run_folder)
