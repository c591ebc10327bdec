"""Trainings that stop and go on, and what is kept of them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.errors import BundleError
from toonset.mesh import Mesh
from toonset.nerf.options import TrainOptions
from toonset.nerf.run.checkpoint import check_scene, read_checkpoint, scene_digest, write_checkpoint
from toonset.nerf.run.monitor import INTERRUPTED, Looking, Onlooker, held_out_psnr, sample_of
from toonset.nerf.train import loop
from toonset.nerf.train.carved_rays import PRUNE_AFTER
from toonset.nerf.train.loop import Moment
from toonset.nerf.train.progress import Status
from toonset.nerf.train.result import Training
from toonset.nerf.train.state import FitState
from toonset.nerf.train.train import fit_field

SIDE = 24
PALETTE = np.array([[220, 40, 30], [30, 60, 200]], dtype=np.uint8)
STEPS, CUT = PRUNE_AFTER + 10, PRUNE_AFTER + 3  # the rays have changed on the way
OPTIONS = TrainOptions(steps=STEPS, device="cpu", resolution=16, missing_views=0)


def ball(yaw: float, side: int = SIDE) -> Frame:
    """Return a drawn ball, red on its left and blue on its right, with labels."""
    camera = Camera.looking_at(np.zeros(3), yaw, 0.1, 0.4 * side, (side, side))
    origins, directions = camera.rays(camera.pixel_grid())
    along = -(origins * directions).sum(-1)
    nearest = origins + along[..., None] * directions
    inside = (nearest**2).sum(-1) <= 1
    depth = np.sqrt(np.maximum(1 - (nearest**2).sum(-1), 0))
    red = (nearest - depth[..., None] * directions)[..., 0] > 0
    labels = np.where(inside, np.where(red, 0, 1), 255).astype(np.uint8)
    rgba = np.zeros((side, side, 4), dtype=np.uint8)
    rgba[inside] = np.concatenate(
        [PALETTE[labels[inside]], np.full((inside.sum(), 1), 255)], axis=1
    )
    return Frame(f"{yaw:.2f}.png", camera, rgba, labels)


def balls(*yaws: float) -> Scene:
    return Scene(tuple(ball(yaw) for yaw in yaws), PALETTE, "balls")


SCENE, HELD_OUT = balls(0.0, 1.3, 2.6, 4.0, 5.2), balls(0.7, 3.0)


class Cut(Onlooker):
    """Ends a training after some steps, as Ctrl-C would, and keeps its state."""

    state: FitState

    def look(self, moment: Moment) -> str:
        if len(moment.history) == CUT:
            self.state = moment.state()
            return INTERRUPTED
        return super().look(moment)


def quiet(status: Status) -> None:
    assert status.steps <= status.of


def onlooker(folder: Path, kind: type[Onlooker] = Onlooker) -> Onlooker:
    looking = Looking(quiet, lambda: False, HELD_OUT, folder, preview_every_s=0.2)
    return kind(looking, SCENE, OPTIONS)


def bits(training: Training) -> list[torch.Tensor]:
    result = training.result
    assert result.classifier is not None
    return [*result.field.parameters(), *result.classifier.parameters()]


@pytest.fixture(scope="module")
def whole() -> Training:
    return fit_field(SCENE, OPTIONS)


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> tuple[Training, FitState]:
    watch = onlooker(tmp_path_factory.mktemp("cut"), Cut)
    assert isinstance(watch, Cut)
    return fit_field(SCENE, OPTIONS, watch=watch), watch.state


def test_looking_on_changes_no_bit(
    whole: Training, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("CHECKPOINT_S", "FIRST_LOOK_S"):
        monkeypatch.setattr(f"toonset.nerf.run.monitor.{name}", 0.05)
    watch = onlooker(tmp_path)
    watched = fit_field(SCENE, OPTIONS, watch=watch)
    assert {p.name for p in tmp_path.iterdir()} >= {"preview.png", "checkpoint.json"}
    assert watch.held_out
    assert 15 < held_out_psnr(whole.result, sample_of(HELD_OUT)) < 60
    first = watch.held_out[0]  # whenever it was: so few steps do not get better one by one
    assert 0 < first.step <= STEPS
    assert 10 < first.psnr < 60
    assert all(torch.equal(a, b) for a, b in zip(bits(whole), bits(watched), strict=True))


def test_a_resumed_training_ends_bit_identical(
    whole: Training, cut: tuple[Training, FitState], tmp_path: Path
) -> None:
    stopped, state = cut
    assert (stopped.stopped, len(stopped.history)) == ("interrupted", CUT)
    write_checkpoint(tmp_path, state, OPTIONS, SCENE)
    checkpoint = read_checkpoint(tmp_path)
    check_scene(checkpoint, SCENE, tmp_path)
    assert checkpoint.options == OPTIONS
    assert checkpoint.state.rays  # samples were dropped before the cut
    watch = onlooker(tmp_path)
    watch.start = checkpoint.state
    torch.rand(7)  # what else the process does with torch's generator
    resumed = fit_field(SCENE, OPTIONS, watch=watch)
    assert resumed.stopped == "steps"
    assert [s.loss for s in resumed.history] == [s.loss for s in whole.history]
    assert all(torch.equal(a, b) for a, b in zip(bits(whole), bits(resumed), strict=True))
    seconds = [s.seconds for s in resumed.history]
    assert seconds == sorted(seconds)
    # and every part of the state counts: without Adam's memory it ends elsewhere
    forgetful = {name: torch.zeros_like(values) for name, values in state.squares.items()}
    watch.start = replace(checkpoint.state, squares=forgetful)
    other = fit_field(SCENE, OPTIONS, watch=watch)
    assert not all(torch.equal(a, b) for a, b in zip(bits(whole), bits(other), strict=True))


def test_a_checkpoint_keeps_every_part_of_the_state(
    cut: tuple[Training, FitState], tmp_path: Path
) -> None:
    state = cut[1]
    write_checkpoint(tmp_path, state, OPTIONS, SCENE)
    loaded = read_checkpoint(tmp_path).state
    assert (loaded.history, loaded.queue) == (state.history, state.queue)
    for field in fields(FitState):
        a, b = getattr(state, field.name), getattr(loaded, field.name)
        if isinstance(a, torch.Tensor):
            assert torch.equal(a, b)
        elif isinstance(a, dict):
            assert a.keys() == b.keys()
            assert all(torch.equal(a[name], b[name]) for name in a)


def test_a_training_killed_while_it_writes_keeps_its_last_checkpoint(
    cut: tuple[Training, FitState], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = cut[1]
    earlier = replace(state, history=state.history[:-1])
    write_checkpoint(tmp_path, earlier, OPTIONS, SCENE)

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("toonset.nerf.run.checkpoint.write_json", killed)
        with pytest.raises(KeyboardInterrupt):
            write_checkpoint(tmp_path, state, OPTIONS, SCENE)
    assert read_checkpoint(tmp_path).state.steps == state.steps - 1
    write_checkpoint(tmp_path, state, OPTIONS, SCENE)
    assert len(list(tmp_path.iterdir())) == 2  # the earlier one is gone
    moved = shutil.move(tmp_path, tmp_path.with_name("moved"))
    assert read_checkpoint(Path(moved)).state.steps == state.steps


def flip_a_bit(folder: Path) -> None:
    file = next(folder.glob("*.safetensors"))
    data = bytearray(file.read_bytes())
    data[-9] ^= 1
    file.write_bytes(data)


def change(**values: object) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        content = json.loads((folder / "checkpoint.json").read_text())
        for name, value in values.items():
            part, _, key = name.rpartition("__")
            (content[part] if part else content)[key] = value
        (folder / "checkpoint.json").write_text(json.dumps(content))

    return edit


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (flip_a_bit, "another SHA-256"),
        (lambda folder: next(folder.glob("*.safetensors")).unlink(), "no such file"),
        (lambda folder: (folder / "checkpoint.json").unlink(), "no such file"),
        (lambda folder: (folder / "checkpoint.json").write_text("{"), "no valid JSON"),
        (change(schema="toonset-checkpoint/9"), "newer than this toonset"),
        (change(schema="toonset-checkpoint/1"), "begun by an earlier toonset"),
        (change(tensors__name="../x.safetensors"), "tensors.name"),
        (change(options__steps="many"), "steps"),
        (change(options__magic=1), "options magic are of another toonset"),
        (change(threads=0), "threads"),
    ],
)
def test_a_damaged_checkpoint_gets_one_clear_line(
    cut: tuple[Training, FitState], damage: Callable[[Path], object], message: str, tmp_path: Path
) -> None:
    write_checkpoint(tmp_path, cut[1], OPTIONS, SCENE)
    damage(tmp_path)
    with pytest.raises(BundleError, match=message) as refused:
        read_checkpoint(tmp_path)
    assert str(refused.value).count("\n") == 0


def test_a_checkpoint_goes_on_with_its_own_scene_only(
    cut: tuple[Training, FitState], tmp_path: Path
) -> None:
    write_checkpoint(tmp_path, cut[1], OPTIONS, SCENE)
    checkpoint = read_checkpoint(tmp_path)
    first, *others = SCENE.frames
    touched = first.rgba.copy()
    touched[SIDE // 2, SIDE // 2, 0] ^= 1
    for frame in (
        replace(first, rgba=touched),
        replace(first, camera=replace(first.camera, scale=first.camera.scale * (1 + 1e-12))),
        replace(first, labels=None),
        replace(first, yaw_sigma=0.01),
    ):
        changed = replace(SCENE, frames=(frame, *others))
        with pytest.raises(BundleError, match="other pictures, cameras, labels or mannequin"):
            check_scene(checkpoint, changed, tmp_path)
    body = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    with pytest.raises(BundleError, match="other pictures, cameras, labels or mannequin"):
        check_scene(checkpoint, replace(SCENE, mannequin=body), tmp_path)
    assert scene_digest(replace(SCENE, name="elsewhere")) == scene_digest(SCENE)
    watch = onlooker(tmp_path)
    watch.start = replace(checkpoint.state, parameters={})
    with pytest.raises(BundleError, match="of another field"):
        fit_field(SCENE, replace(OPTIONS, steps=1), watch=watch)


def test_a_training_whose_samples_move_resumes_bit_identical_too(tmp_path: Path) -> None:
    options = replace(OPTIONS, carve=False, steps=9)
    whole = fit_field(SCENE, options)
    states = []

    class After(Onlooker):
        def look(self, moment: Moment) -> str:
            states.append(moment.state())
            return INTERRUPTED if len(moment.history) == 4 else ""

    looking = Looking(quiet, lambda: False)
    fit_field(SCENE, options, watch=After(looking, SCENE, options))
    write_checkpoint(tmp_path, states[-1], options, SCENE)
    start = read_checkpoint(tmp_path).state
    resumed = fit_field(SCENE, options, watch=Onlooker(looking, SCENE, options, start))
    assert all(torch.equal(a, b) for a, b in zip(bits(whole), bits(resumed), strict=True))


def test_a_state_with_what_is_no_number_is_never_kept(
    cut: tuple[Training, FitState], tmp_path: Path
) -> None:
    state = cut[1]
    name, values = next(iter(state.parameters.items()))
    bad = replace(state, parameters=state.parameters | {name: values * float("nan")})
    for kept, expected in ((state, INTERRUPTED), (bad, "")):
        folder = tmp_path / (expected or "bad")
        watch = Onlooker(Looking(quiet, lambda: True, folder=folder), SCENE, OPTIONS)
        watch.begin(cut[0].result)
        assert (
            watch.look(Moment(list(kept.history), STEPS, 0.5, lambda kept=kept: kept)) == expected
        )
        assert folder.exists() == bool(expected)


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
