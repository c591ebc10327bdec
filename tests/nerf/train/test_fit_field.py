"""Training end to end, on a figure whose pictures are computed exactly."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from lab.bench.train.mlp import network
from lab.bench.train.painted_hull import painted
from lab.bench.train.voxel import voxels
from tests.nerf.ellipsoids import QUICK, held_out, scene_of, train_scene
from toonset.dataset.bundle.scene import Scene
from toonset.errors import BundleError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import read_field
from toonset.nerf.run.report import write_run
from toonset.nerf.score.evaluate import evaluate
from toonset.nerf.score.metrics import compare
from toonset.nerf.train import fit_field as train_module
from toonset.nerf.train import gradients
from toonset.nerf.train import loss as loss_module
from toonset.nerf.train.batches import Batch
from toonset.nerf.train.fit_field import FieldOf, fit_field
from toonset.nerf.train.labelling import label_scene
from toonset.nerf.train.loop import LEAST_STEPS
from toonset.nerf.train.result import Training


def mean_psnr(field: TrainedField, test: Scene | None = None) -> float:
    value = evaluate(field, test or held_out())["rgb"]["psnr"]
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
    assert mean_psnr(training.result, held_out(k, unit)) > 23


def test_same_seed_same_bits_other_seed_other_bits() -> None:
    scene = label_scene(train_scene())[0]
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
    assert mean_psnr(training.result) > 15


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


def test_pictures_without_a_background_and_single_ones_are_refused() -> None:
    scene = train_scene()
    rgba = scene.frames[2].rgba.copy()
    rgba[..., 3] = 255
    frames = (*scene.frames[:2], replace(scene.frames[2], rgba=rgba), *scene.frames[3:])
    with pytest.raises(BundleError, match="no transparent background"):
        fit_field(replace(scene, frames=frames), QUICK)
    with pytest.raises(BundleError, match="at least two views"):
        fit_field(scene_of([0.0], 0.0, 0.0), QUICK)


def test_empty_pictures_are_passed_over() -> None:
    scene = train_scene()
    empty = replace(scene.frames[0], rgba=np.zeros_like(scene.frames[0].rgba))
    training = fit_field(replace(scene, frames=(*scene.frames, empty)), replace(QUICK, steps=2))
    assert len(training.history) == 2


@pytest.mark.parametrize(
    ("field_of", "steps", "least"), [(voxels, 60, 22.0), (painted, 0, 17.0), (network, 3, 5.0)]
)
def test_other_fields_are_trained_and_rendered(field_of: FieldOf, steps: int, least: float) -> None:
    training = fit_field(
        label_scene(train_scene())[0], replace(QUICK, steps=steps), field_of=field_of
    )
    assert mean_psnr(training.result) > least


def test_a_field_in_a_whole_box_is_trained_rendered_and_read_again(tmp_path: Path) -> None:
    scene = label_scene(train_scene())[0]
    training = fit_field(scene, replace(QUICK, carve=False, smoothness=0.0, steps=40))
    write_run(tmp_path, training, replace(scene, frames=scene.frames[:1]))
    loaded, camera = read_field(tmp_path), held_out().frames[0].camera
    np.testing.assert_array_equal(render(training.result, camera).rgb, render(loaded, camera).rgb)
    assert mean_psnr(loaded) > 15


def test_mirror_images_are_looked_at_and_do_not_carve() -> None:
    scene = scene_of([np.radians(yaw) for yaw in (0, 90, 135, 180, 270, 315)], 0.0, 0.15)
    options = replace(QUICK, steps=LEAST_STEPS, symmetric="on")
    mirrored, plain = (
        fit_field(scene, one) for one in (options, replace(options, symmetric="off"))
    )
    assert mirrored.symmetry is not None
    assert mirrored.symmetry.mirrored
    assert torch.equal(mirrored.result.hull.support, plain.result.hull.support)
