"""The planes' size: short trainings without some drawings, and what is chosen on their evidence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from tests.test_train_summary import metrics
from toonset.bench.cases import train_cases
from toonset.cli.train_summary import summary
from toonset.dataset.scene import Scene
from toonset.nerf import field_trials, training
from toonset.nerf.field_choice import Candidate, FieldChoice, chosen
from toonset.nerf.field_trials import asked_for, left_out
from toonset.nerf.labelling import without_palette
from toonset.nerf.options import TrainOptions
from toonset.nerf.report import write_run
from toonset.nerf.run_folder import read_field
from toonset.nerf.training import train

FEW = 4  # steps of a trial
SHORT = TrainOptions(steps=3 * FEW, device="cpu", missing_views=0)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Return eight drawings of 60 px."""
    return without_palette(next(iter(train_cases(None, 0, 1, px=60))).train)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let trials take a few steps only."""
    monkeypatch.setattr(field_trials, "STEPS", FEW)
    monkeypatch.setattr(field_trials, "WORTH_STEPS", 3 * FEW)


def candidates(*psnr: float) -> list[Candidate]:
    return [Candidate(90 - 30 * i, 1000, value) for i, value in enumerate(psnr)]


def test_the_coarsest_of_about_equals_is_chosen() -> None:
    assert chosen(candidates(20.0, 20.1, 20.05)) == 30
    assert chosen(candidates(20.5, 20.4, 20.0)) == 60
    assert chosen(candidates(20.5, 20.1, 20.0)) == 90
    assert chosen(candidates(20.0, 20.5, 20.1)) == 60


def test_drawings_left_out_lie_half_a_turn_apart(scene: Scene) -> None:
    names = [frame.name for frame in left_out(scene.frames)]
    assert names == [scene.frames[1].name, scene.frames[5].name]
    assert left_out(scene.frames[:4]) == [scene.frames[1]]


@pytest.mark.parametrize(
    "told",
    [
        {"field": "triplane"},
        {"resolution": 40},
        {"budget_s": 9.0},
        {"steps": 100},
        {"carve": False},
    ],
)
def test_trials_are_for_trainings_that_leave_the_planes_open(told: dict[str, object]) -> None:
    assert asked_for(TrainOptions())
    assert not asked_for(replace(TrainOptions(), **told))


def test_trials_see_the_other_drawings_only(
    scene: Scene, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[set[str]] = []
    real = field_trials.make_batches

    def noted(part: Scene, *rest: object) -> object:
        seen.append({frame.name for frame in part.frames})
        return real(part, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(field_trials, "make_batches", noted)
    choice = train(scene, SHORT).choice
    assert choice is not None
    every, left = {frame.name for frame in scene.frames}, set(choice.left_out)
    assert len(left) == 2
    assert seen == [every - left, left] * len(choice.candidates)


def test_the_choice_is_all_that_trials_change(scene: Scene, quick: None, tmp_path: Path) -> None:
    auto = train(scene, SHORT)
    assert auto.choice is not None
    sizes = [(c.cells, c.parameters) for c in auto.choice.candidates]
    assert len(sizes) == 3
    assert sizes == sorted(sizes, reverse=True)
    assert auto.counts["parameters"] == dict(sizes)[auto.choice.cells]
    again = train(scene, SHORT)
    assert again.choice == auto.choice
    told = train(scene, replace(SHORT, resolution=auto.choice.cells))
    assert told.choice is None
    for name, values in auto.result.field.state_dict().items():
        assert torch.equal(values, told.result.field.state_dict()[name]), name
    written = write_run(tmp_path, auto, scene)
    assert written["planes"]["cells"] == auto.choice.cells
    assert read_field(tmp_path).field.spec.resolution == auto.choice.cells


def test_the_finest_planes_are_one_cell_per_pixel(scene: Scene, quick: None) -> None:
    choice = train(scene, SHORT).choice
    finest = train(scene, replace(SHORT, field="triplane"))
    assert choice is not None
    assert choice.candidates[0].parameters == finest.counts["parameters"]
    assert finest.result.field.spec.resolution == choice.candidates[0].cells
    assert training.CELLS[0] <= choice.candidates[0].cells <= training.CELLS[1]


def test_two_drawings_say_nothing_of_planes(scene: Scene, quick: None) -> None:
    pair = replace(scene, frames=scene.frames[:3:2])
    choice = train(pair, SHORT).choice
    assert choice is not None
    assert choice.candidates == ()
    assert (
        choice.cells == train(pair, replace(SHORT, field="triplane")).result.field.spec.resolution
    )


def test_the_summary_has_the_evidence() -> None:
    choice = FieldChoice(60, tuple(candidates(20.1, 20.0, 19.0)), ("001.png", "005.png"))
    text = summary_of(choice)
    assert "planes: 60 cells along the longest side, the fewest within 0.15 dB of the best" in text
    assert "(predicted 001.png and 005.png; 90: 20.10 dB, 60: 20.00 dB, 30: 19.00 dB)" in text
    assert "too few drawings to leave one out" in summary_of(FieldChoice(90, (), ()))


def summary_of(choice: FieldChoice) -> str:
    return summary(Path("run"), metrics() | {"planes": choice.to_json()})
