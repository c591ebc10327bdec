"""What looks on at trainings: it changes nothing, and may end them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from tests.nerf.ellipsoids import first_hit
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.options import TrainOptions
from toonset.nerf.run.monitor import Monitor, MonitorOptions, held_out_psnr, sample_of
from toonset.nerf.train import loop
from toonset.nerf.train.carved_rays import PRUNE_AFTER
from toonset.nerf.train.fit_field import fit_field
from toonset.nerf.train.progress import Status
from toonset.nerf.train.result import Training

SIDE = 24
PALETTE = np.array([[220, 40, 30], [30, 60, 200]], dtype=np.uint8)
STEPS, CUT = PRUNE_AFTER + 10, 7
OPTIONS = TrainOptions(steps=STEPS, device="cpu", resolution=16, missing_views=0)


def ball(yaw: float, side: int = SIDE) -> Frame:
    """Return a drawn ball, red on its left and blue on its right, with labels."""
    camera = Camera.looking_at(np.zeros(3), yaw, 0.1, 0.4 * side, (side, side))
    which, points = first_hit(camera, [(np.zeros(3), np.ones(3))])
    labels = np.where(which == 0, points[..., 0] <= 0, 255).astype(np.uint8)
    table = np.zeros((256, 4), np.uint8)
    table[:2] = np.column_stack([PALETTE, [255, 255]])
    rgba = table[labels]
    return Frame(f"{yaw:.2f}.png", camera, rgba, labels)


def balls(*yaws: float) -> Scene:
    return Scene(tuple(ball(yaw) for yaw in yaws), PALETTE, "balls")


SCENE, HELD_OUT = balls(0.0, 1.3, 2.6, 4.0, 5.2), balls(0.7, 3.0)


def quiet(status: Status) -> None:
    assert status.steps <= status.of


def bits(training: Training) -> list[torch.Tensor]:
    result = training.result
    assert result.classifier is not None
    return [*result.field.parameters(), *result.classifier.parameters()]


@pytest.fixture(scope="module")
def whole() -> Training:
    return fit_field(SCENE, OPTIONS)


def test_looking_on_changes_no_bit(
    whole: Training, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("toonset.nerf.run.monitor.FIRST_LOOK_S", 0.05)
    watch = Monitor(MonitorOptions(quiet, lambda: False, HELD_OUT, tmp_path, preview_every_s=0.2))
    watched = fit_field(SCENE, OPTIONS, watch=watch)
    assert {p.name for p in tmp_path.iterdir()} == {"preview.png"}
    assert watch.held_out
    assert 15 < held_out_psnr(whole.result, sample_of(HELD_OUT)) < 60
    first = watch.held_out[0]  # whenever it was: so few steps do not get better one by one
    assert 0 < first.step <= STEPS
    assert 10 < first.psnr < 60
    assert all(torch.equal(a, b) for a, b in zip(bits(whole), bits(watched), strict=True))


def test_a_wish_to_stop_ends_a_training_with_what_it_has_learned(whole: Training) -> None:
    steps: list[int] = []
    watch = Monitor(
        MonitorOptions(lambda status: steps.append(status.steps), lambda: len(steps) == CUT)
    )
    cut = fit_field(SCENE, OPTIONS, watch=watch)
    assert (cut.stopped, cut.options.steps) == ("interrupted", STEPS)
    assert [s.loss for s in cut.history] == [s.loss for s in whole.history[: CUT + 1]]
    asked = Monitor(MonitorOptions(quiet, lambda: True))  # too late: nothing is left to do
    one = fit_field(SCENE, TrainOptions(steps=1, device="cpu", resolution=16), watch=asked)
    assert one.stopped == "steps"


def test_a_training_that_runs_away_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop, "TABLES_RATE", 1e6)
    training = fit_field(SCENE, OPTIONS)
    assert training.stopped.startswith(("diverged", "loss not finite", "parameters not finite"))
    assert "kept the state of step" in training.stopped
    assert all(bool(torch.isfinite(values).all()) for values in bits(training))


# ---- held-out views


def test_held_out_views_are_a_small_even_sample() -> None:
    many = balls(*np.linspace(0, 5, 9).tolist())
    chosen = sample_of(many)
    assert [f.name for f in chosen] == [many.frames[i].name for i in (0, 2, 4, 6)]
    large = Scene((ball(0.5, 601),), None, "large")
    small = sample_of(large)[0]
    assert small.rgba.shape[:2] == small.camera.size_wh[::-1] == (150, 150)
    exact = ball(0.5, 150)
    assert small.camera.project(np.eye(3))[0] == pytest.approx(
        large.frames[0].camera.project(np.eye(3))[0] / 4
    )
    assert np.abs(small.rgba[75, 75].astype(int) - exact.rgba[75, 75]).max() <= 2
    edge = small.rgba[(small.rgba[..., 3] > 20) & (small.rgba[..., 3] < 235)]
    assert len(edge)
    assert np.abs(edge[:, None, :3].astype(int) - PALETTE).max(-1).min(1).max() < 130
