"""Run training's work on two threads side by side.

Torch shares single operations among threads, and a step's are too short for that: two threads are
slower than one. So two threads work side by side instead, each on its own half of a step, of the
rays, of the trials. What a half is does not depend on how many threads there are: one and two give
the same bits. Further threads share torch's operations.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

import torch

Result = TypeVar("Result")

SIDES = 2  # threads that work side by side, the calling one included


class _Team(threading.local):
    """Worker beside the calling thread, if any; the others of a team have none."""

    pool: ThreadPoolExecutor | None = None


_TEAM = _Team()


@contextmanager
def working_threads(count: int | None = None) -> Iterator[int]:
    """Let so many threads work within the block, side by side where there are two; yield how many.

    Afterwards torch has as many as before.

    Args:
        count: of threads; None: two, or one if torch is set to use no more.
    """
    before, pool = torch.get_num_threads(), _TEAM.pool
    count = count or min(SIDES, before)
    sides = min(SIDES, count)
    torch.set_num_threads(count // sides)
    _TEAM.pool = ThreadPoolExecutor(sides - 1) if sides > 1 else None
    try:
        yield count
    finally:
        if _TEAM.pool is not None:
            _TEAM.pool.shutdown()
        _TEAM.pool = pool
        torch.set_num_threads(before)


def threads_in_use() -> int:
    """Return how many threads work for the calling one."""
    return torch.get_num_threads() * (1 if _TEAM.pool is None else SIDES)


def side_by_side(tasks: Sequence[Callable[[], Result]]) -> list[Result]:
    """Return what the tasks return, in their order; every other one runs in the other thread.

    Tasks must not write what another one reads. A task's own tasks run one after the other.
    """
    pool = _TEAM.pool
    if pool is None or len(tasks) < 2:
        return [task() for task in tasks]
    _TEAM.pool = None  # the other thread is taken
    follows = torch.is_grad_enabled()  # each thread has its own
    future = pool.submit(_in_a_row, tasks[1::2], follows)
    try:
        mine = _in_a_row(tasks[::2], follows)
    finally:
        failed = future.exception()  # waits: nothing goes on behind an error's back
        _TEAM.pool = pool
    if failed is not None:
        raise failed
    results: list[Result] = [mine[0]] * len(tasks)
    results[::2], results[1::2] = mine, future.result()
    return results


def _in_a_row(tasks: Sequence[Callable[[], Result]], gradients: bool) -> list[Result]:
    with torch.set_grad_enabled(gradients):
        return [task() for task in tasks]


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch use one thread: short operations would wait for others longer than they take.

    Sums do not depend on how many threads shared them, either.
    """
    count = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(count)
