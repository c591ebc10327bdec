"""Which sides of a character no drawing shows: shape and colours there are a guess."""

from __future__ import annotations

import math
from dataclasses import dataclass

from toonset.camera import Camera
from toonset.dataset.scene import Scene

WIDE = math.radians(100)  # between neighbouring drawings: more than a quarter of the turn


@dataclass(frozen=True)
class Gap:
    """A turn between neighbouring drawings in which there is no other.

    Attributes:
        after: the drawing at which it begins, seen from above counterclockwise.
        before: the drawing at which it ends.
        radians: its size.
    """

    after: str
    before: str
    radians: float


def wide_gaps(scene: Scene) -> list[Gap]:
    """Return the turns of more than WIDE that no drawing looks from, about the upright axis."""
    turns = sorted((_yaw(frame.camera), frame.name) for frame in scene.frames)
    following = [*turns[1:], (turns[0][0] + 2 * math.pi, turns[0][1])]
    gaps = [
        Gap(after, before, end - begin)
        for (begin, after), (end, before) in zip(turns, following, strict=True)
    ]
    return [gap for gap in gaps if gap.radians > WIDE]


def _yaw(camera: Camera) -> float:
    """Return where a camera stands, counterclockwise from +Z."""
    x, _, z = camera.rotation[2].tolist()
    return math.atan2(-x, -z)
