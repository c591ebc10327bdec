"""Independent jobs in processes of their own, one thread each, results in the order of the jobs.

Spawned, not forked: a fork of a process that has drawn with EGL hangs. This module imports nothing
heavy, so that `_start` runs before numerical libraries read how many threads they may use.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

MOST_WORKERS = 8  # each holds about 0.4 GB
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def in_order(
    function: Callable[[Job], Result], jobs: Sequence[Job], workers: int
) -> Iterator[Result]:
    """Yield `function(job)` for every job, in order; with one worker in this process."""
    if workers <= 1:
        yield from map(function, jobs)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_start) as pool:
        yield from pool.map(function, jobs)


def usable_workers() -> int:
    """Return how many processes may work at a time: one per usable core, at most eight."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return min(cores or 1, MOST_WORKERS)


def _start() -> None:
    threading.Thread(target=_leave_with_parent, daemon=True).start()
    os.environ.update(dict.fromkeys(THREADS, "1"))
    import cv2

    cv2.setNumThreads(1)


def _leave_with_parent() -> None:
    """End this process when its parent is gone: killed, it cannot say so, and we would wait on."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
