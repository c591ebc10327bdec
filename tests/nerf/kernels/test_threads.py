"""Work side by side: results in order, errors told, the same bits with any number of threads."""

from __future__ import annotations

import threading
from functools import partial

import pytest
import torch

from lab.bench.cases.cases import train_cases
from toonset.nerf.kernels.threads import side_by_side, threads_in_use, working_threads
from toonset.nerf.options import TrainOptions
from toonset.nerf.train.fit_field import fit_field
from toonset.nerf.train.labelling import label_scene


def test_results_come_in_the_order_of_the_tasks_from_two_threads() -> None:
    with working_threads(2):
        assert (threads_in_use(), torch.get_num_threads()) == (2, 1)
        meet = threading.Barrier(2, timeout=20)  # broken unless two tasks wait at the same time

        def task(number: int) -> tuple[int, str]:
            if number < 2:
                meet.wait()
            return number, threading.current_thread().name

        found = side_by_side([partial(task, number) for number in range(5)])
        assert [number for number, _ in found] == [0, 1, 2, 3, 4]
        assert len({name for _, name in found}) == 2
        assert side_by_side([]) == []


def test_one_thread_does_all_itself() -> None:
    with working_threads(1):
        assert threads_in_use() == 1
        names = side_by_side([lambda: threading.current_thread().name] * 3)
        assert names == [threading.current_thread().name] * 3


def test_tasks_of_a_task_run_in_its_own_thread() -> None:
    with working_threads(2):

        def inner() -> list[str]:
            return side_by_side([lambda: threading.current_thread().name] * 3)

        assert [len(set(names)) for names in side_by_side([inner] * 4)] == [1, 1, 1, 1]
        assert len({names[0] for names in side_by_side([inner] * 2)}) == 2


@pytest.mark.parametrize("failing", [0, 1])
def test_an_error_in_either_thread_is_told_and_the_team_goes_on(failing: int) -> None:
    with working_threads(2):

        def task(number: int) -> int:
            if number == failing:
                raise ValueError(f"task {number}")
            return number

        with pytest.raises(ValueError, match=f"task {failing}"):
            side_by_side([partial(task, number) for number in range(2)])
        assert side_by_side([lambda: 1, lambda: 2]) == [1, 2]


def test_no_thread_computes_gradients_where_none_are_asked_for() -> None:
    with working_threads(2):
        with torch.no_grad():
            assert side_by_side([torch.is_grad_enabled] * 4) == [False] * 4
        assert side_by_side([torch.is_grad_enabled] * 4) == [True] * 4


@pytest.mark.parametrize("carve", [True, False])
def test_one_and_two_threads_give_the_same_bits(carve: bool) -> None:
    (case,) = train_cases(None, 0, 1, px=48)
    scene = label_scene(case.train)[0]
    steps = 130 if carve else 4  # enough for trials
    options = TrainOptions(steps=steps, carve=carve, device="cpu")
    found = []
    for count in (1, 2):
        with working_threads(count):
            training = fit_field(scene, options)
        assert training.result.classifier is not None
        parameters = [training.result.field, training.result.classifier]
        found.append((training, [p for part in parameters for p in part.parameters()]))
    (one, first), (two, second) = found
    assert one.choice is not None
    assert bool(one.choice.candidates) == carve
    assert one.choice == two.choice
    assert torch.equal(one.result.hull.support, two.result.hull.support)
    assert all(torch.equal(a, b) for a, b in zip(first, second, strict=True))
