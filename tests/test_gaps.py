"""Which sides no drawing shows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from toonset.camera import Camera
from toonset.dataset.scene import Frame, Scene
from toonset.nerf.gaps import wide_gaps

NOTHING = np.zeros((8, 8, 4), dtype=np.uint8)


def scene(*yaws_deg: float) -> Scene:
    frames = [
        Frame(
            f"{yaw:g}", Camera.looking_at(np.zeros(3), math.radians(yaw), 0.3, 4.0, (8, 8)), NOTHING
        )
        for yaw in yaws_deg
    ]
    return Scene(tuple(frames), None, "turn")


@pytest.mark.parametrize(
    ("yaws", "gaps"),
    [
        ((0, 180), [("0", "180", 180), ("180", "0", 180)]),
        ((90, 0, 180), [("180", "0", 180)]),
        ((0, 135, 225), [("0", "135", 135), ("225", "0", 135)]),
        ((0, 90, 180, 270), []),
        ((350, 80, 170, 260), []),
        ((20,), [("20", "20", 360)]),
    ],
)
def test_turns_without_a_drawing(
    yaws: tuple[float, ...], gaps: list[tuple[str, str, float]]
) -> None:
    found = wide_gaps(scene(*yaws))
    assert {(gap.after, gap.before, round(math.degrees(gap.radians))) for gap in found} == set(gaps)
