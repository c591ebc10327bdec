"""The planes' size: short trainings without some drawings, and what is chosen on their evidence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from lab.bench.cases.cases import train_cases
from tests.cli.common.test_train_summary import metrics
from toonset.cli.common.train_summary import summary
from toonset.dataset.bundle.scene import Scene
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.options import TrainOptions
from toonset.nerf.run.folder import read_field
from toonset.nerf.run.report import write_run
from toonset.nerf.train import plane_search
from toonset.nerf.train.fit_field import finest_cells, fit_field
from toonset.nerf.train.labelling import drop_palette
from toonset.nerf.train.plane_choice import Candidate, FieldChoice, chosen, shares_for
from toonset.nerf.train.plane_search import left_out

FEW = 4  # steps of a trial
SHORT = TrainOptions(steps=2 * FEW, device="cpu", missing_views=0)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Return eight drawings of 60 px."""
    return drop_palette(next(iter(train_cases(None, 0, 1, px=60))).train)


@pytest.fixture(scope="module")
def few(scene: Scene) -> Scene:
    """Return four of them, so that trials are asked for."""
    return replace(scene, frames=scene.frames[::2])


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let trials take a few steps only."""
    monkeypatch.setattr(plane_search, "STEPS", FEW)


def candidates(*psnr: float) -> list[Candidate]:
    return [Candidate(90 - 30 * i, 1000, value) for i, value in enumerate(psnr)]


def test_the_coarsest_of_about_equals_is_chosen() -> None:
    assert chosen(candidates(20.0, 19.95)) == 60
    assert chosen(candidates(20.0, 19.85)) == 90
    assert chosen(candidates(20.0, 21.0)) == 60


def test_drawings_left_out_lie_half_a_turn_apart(scene: Scene) -> None:
    names = [frame.name for frame in left_out(scene.frames)]
    assert names == [scene.frames[1].name, scene.frames[5].name]
    assert left_out(scene.frames[:4]) == [scene.frames[1]]


@pytest.mark.parametrize(
    ("views", "agree", "finer"),
    [(8, True, 1.0), (6, True, 1.0), (8, False, 1.0), (4, False, 1.0), (5, True, 2 / 3)],
)
def test_few_drawings_that_agree_are_tried_on_coarser_planes(
    views: int, agree: bool, finer: float
) -> None:
    shares = shares_for(views, agree=agree)
    assert shares[0] == finer
    assert shares[1] < finer


@pytest.mark.parametrize(
    ("options", "views", "why"),
    [
        (replace(SHORT, steps=2 * FEW - 1), 4, "too short a training for trials"),
        (replace(SHORT, budget_s=60.0), 4, "too short a training for trials"),
        (replace(SHORT, carve=False), 4, "no hull to try them in"),
        (SHORT, 2, "too few drawings to leave one out"),
    ],
)
def test_some_trainings_try_nothing(
    few: Scene, quick: None, options: TrainOptions, views: int, why: str
) -> None:
    few = replace(few, frames=few.frames[:views])
    choice = fit_field(few, options).choice
    assert choice is not None
    assert (choice.untried, choice.candidates) == (why, ())
    assert choice.cells == round(2 / 3 * finest_cells(few))


def test_trials_see_the_other_drawings_only(
    few: Scene, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[set[str]] = []
    real = plane_search.make_batches

    def noted(part: Scene, *rest: object) -> object:
        seen.append({frame.name for frame in part.frames})
        return real(part, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(plane_search, "make_batches", noted)
    choice = fit_field(few, SHORT).choice
    assert choice is not None
    every, left = {frame.name for frame in few.frames}, set(choice.left_out)
    assert len(left) == 1
    assert seen == [every - left, left]


def test_the_choice_is_all_that_trials_change(few: Scene, quick: None, tmp_path: Path) -> None:
    auto = fit_field(few, SHORT)
    assert auto.choice is not None
    sizes = [(c.cells, c.parameters) for c in auto.choice.candidates]
    assert len(sizes) == 2
    assert sizes == sorted(sizes, reverse=True)
    assert auto.counts["parameters"] == dict(sizes)[auto.choice.cells]
    assert fit_field(few, SHORT).choice == auto.choice
    told = fit_field(few, replace(SHORT, resolution=auto.choice.cells))
    assert told.choice is None
    for name, values in auto.result.field.state_dict().items():
        assert torch.equal(values, told.result.field.state_dict()[name]), name
    written = write_run(tmp_path, auto, few)
    assert written["planes"]["cells"] == auto.choice.cells
    assert cells_of(read_field(tmp_path)) == auto.choice.cells


def test_many_drawings_that_agree_may_have_a_cell_per_pixel(scene: Scene, quick: None) -> None:
    training = fit_field(scene, SHORT)
    finest = fit_field(scene, replace(SHORT, field="triplane"))
    assert training.choice is not None
    cells = [candidate.cells for candidate in training.choice.candidates]
    assert cells == [finest_cells(scene), round(2 / 3 * finest_cells(scene))]
    assert finest.choice is None
    assert cells_of(finest.result) == cells[0]


def test_the_summary_has_the_evidence() -> None:
    choice = FieldChoice(60, "", tuple(candidates(20.1, 20.05)), ("001.png", "005.png"))
    text = summary_of(choice)
    assert "planes: 60 cells along the longest side, the fewest within 0.1 dB of the best" in text
    assert "(predicted 001.png and 005.png from the others; 90: 20.10 dB, 60: 20.05 dB)" in text
    said = summary_of(FieldChoice(90, "no hull to try them in"))
    assert "90 cells along the longest side, the usual two thirds" in said
    assert "(not tried: no hull to try them in)" in said


def summary_of(choice: FieldChoice) -> str:
    return summary(Path("run"), metrics() | {"planes": choice.to_json()}, verbose=True)


def cells_of(trained: TrainedField) -> int:
    assert isinstance(trained.field, TriplaneField)
    return trained.field.resolution
