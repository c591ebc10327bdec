"""Which sides no drawing shows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.prepare.symmetry import add_mirrored_views, find_symmetry
from toonset.nerf.prepare.view_coverage import FEW_OUTLINES, guesses, outline_gap, wide_gaps

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
        ((0, 120, 240), [("0", "120", 120), ("120", "240", 120), ("240", "0", 120)]),
        ((0, 115, 180, 270), []),
        ((350, 80, 170, 260), []),
        ((20,), [("20", "20", 360)]),
    ],
)
def test_turns_without_a_drawing(
    yaws: tuple[float, ...], gaps: list[tuple[str, str, float]]
) -> None:
    found = wide_gaps(scene(*yaws))
    assert {(gap.after, gap.before, round(math.degrees(gap.radians))) for gap in found} == set(gaps)


@pytest.mark.parametrize(
    ("yaws", "gap"),
    [
        ((0, 180), 180),
        ((10, 100, 190, 280), 90),
        ((0, 60, 120, 180, 240, 300), 60),
        ((0, 72, 144, 216, 288), 36),
        ((359.9, 0.1), 179.8),
    ],
)
def test_opposite_drawings_share_an_outline(yaws: tuple[float, ...], gap: float) -> None:
    assert math.degrees(outline_gap(scene(*yaws))) == pytest.approx(gap, abs=1e-6)
    assert (outline_gap(scene(*yaws)) > FEW_OUTLINES) == (gap > 75)


def test_what_mirror_images_may_show_is_no_guess_yet() -> None:
    drawn = np.full_like(NOTHING, 255)
    half, ends = (
        replace(some, frames=tuple(replace(frame, rgba=drawn) for frame in some.frames))
        for some in (scene(0, 45, 90, 135, 180), scene(0, 180))
    )
    assert guesses(half)
    assert not guesses(add_mirrored_views(half, find_symmetry(half)))
    assert find_symmetry(ends) is None


@pytest.mark.parametrize(
    ("yaws", "side"), [((270, 0, 90), "back"), ((90, 180, 270), "front"), ((0, 90, 180), "")]
)
def test_a_front_or_back_that_nobody_drew_is_named(yaws: tuple[float, ...], side: str) -> None:
    drawn = np.full_like(NOTHING, 255)
    some = scene(*yaws)
    whole = replace(some, frames=tuple(replace(frame, rgba=drawn) for frame in some.frames))
    said = "\n".join(guesses(whole))
    assert (f"nobody drew the {side}, " in said) == bool(side)
    assert "nobody drew" in said or not side
