"""What training asks of its process: CPU threads, and that freed memory is kept.

Threads are as told, or as many as make it faster here and now.

Two threads that work side by side are faster than one even where other programs keep two cores
busy. More share torch's operations, and wait for each other where others run: these are tried.
"""

from __future__ import annotations

import ctypes
import os
import time
from statistics import median

import typer

AUTO = "auto"
MOST_ASKED = 1024
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # of glibc's <malloc.h>
LARGEST_KEPT = 1 << 25  # bytes; glibc takes no more
FREE_KEPT = 1 << 29  # bytes at the heap's end
MOST = 8  # a step's work is too small for more
TRIALS, TRIAL_S = 5, 0.03  # in turns with the other number: what else runs here comes and goes
WORTH = 1.15  # how much faster twice the threads must be


def checked(text: str) -> str:
    """Return what was asked for if it is "auto" or a number.

    Raises:
        typer.BadParameter: it is neither.
    """
    number = text.isascii() and text.isdigit() and 1 <= int(text) <= MOST_ASKED
    if text != AUTO and not number:
        raise typer.BadParameter(f"{text!r} is neither auto nor a number", param_hint="--threads")
    return text


def threads_of(text: str) -> int:
    """Return the number of threads that "auto" or a number stands for."""
    return measured(most_threads()) if text == AUTO else int(text)


def most_threads() -> int:
    """Return how many threads may run at once here."""
    try:
        return min(MOST, len(os.sched_getaffinity(0)))
    except AttributeError:  # not on every system
        return min(MOST, os.cpu_count() or 1)


def measured(most: int) -> int:
    """Return how many threads do a training step's kind of work fastest; other programs count.

    From one per side on, numbers are doubled as long as that pays.
    """
    from toonset.nerf.kernels.threads import SIDES, use_threads

    best = min(SIDES, most)
    while 2 * best <= most and _gain(best) > WORTH:
        best *= 2
    use_threads(best, SIDES)
    return best


def _gain(threads: int) -> float:
    """Return how many times faster twice the threads are, the median of some comparisons."""
    return median(_rate(2 * threads) / _rate(threads) for _ in range(TRIALS))


def _rate(threads: int) -> float:
    """Return rounds per second of half a step's lookups and its decoder, forwards and backwards.

    The decoder's many small products are what threads wait for each other at: lookups alone would
    promise a speed that no step reaches.
    """
    import torch
    import torch.nn.functional as F
    from torch import nn

    from toonset.nerf.kernels.decoder import two_layers
    from toonset.nerf.kernels.threads import SIDES, side_by_side, use_threads

    use_threads(threads, SIDES)
    generator = torch.Generator().manual_seed(0)
    rows = torch.randint(0, 16_384, (8192, 12), generator=generator, dtype=torch.int32)
    weights = torch.rand(8192, 12, generator=generator)
    table = torch.rand(16_384, 16, generator=generator)
    hidden, out = nn.Linear(16, 32), nn.Linear(32, 4)

    def work() -> None:
        features = F.embedding_bag(rows, table, per_sample_weights=weights, mode="sum")
        total = two_layers(features.requires_grad_(), hidden, out).sum()
        torch.autograd.grad(total, [features, *hidden.parameters(), *out.parameters()])

    halves = [work] * SIDES
    side_by_side(halves)  # starts the threads
    began, rounds = time.perf_counter(), 0
    while time.perf_counter() - began < TRIAL_S:
        side_by_side(halves)
        rounds += 1
    return rounds / (time.perf_counter() - began)


def keep_freed_memory() -> None:
    """Let this process keep blocks that it frees, instead of handing them back to the system.

    A training takes and frees the same megabytes a thousand times. Handed back, every page is
    cleared and mapped anew: a tenth of a training's time. Only glibc can be told.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError, TypeError):
        return
    mallopt(MMAP_THRESHOLD, LARGEST_KEPT)
    mallopt(TRIM_THRESHOLD, FREE_KEPT)
