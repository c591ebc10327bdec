"""The bench of a step's parts: it runs, and its parts add up."""

from __future__ import annotations

import pytest

from bench.train import floor as train_floor
from toonset.nerf.options import TrainOptions


def test_a_steps_parts_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train_floor, "TRIALS", 1)
    *parts, whole = train_floor.step_parts(train_floor.scene_of(40), TrainOptions(device="cpu"))
    assert whole.operations == sum(part.operations for part in parts)
    assert whole.bytes == sum(part.bytes for part in parts)
    assert {part.name.removesuffix(", gradient") for part in parts} == {
        *("interpolation", "decoder", "compositing", "classifier", "total variation", "Adam")
    }
    assert all(part.operations > 0 and part.bytes > 0 for part in parts)
