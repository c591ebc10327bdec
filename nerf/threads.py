"""How many CPU threads torch may use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


def use_threads(count: int | None) -> None:
    """Let torch use `count` threads; None leaves its choice (all cores)."""
    if count is not None:
        torch.set_num_threads(count)


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
