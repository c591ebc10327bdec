"""How many CPU threads torch may use."""

from __future__ import annotations

import torch


def use_threads(count: int | None) -> None:
    """Let torch use `count` threads; None leaves its choice (all cores)."""
    if count is not None:
        torch.set_num_threads(count)
