"""Choose from where a page shows a figure: rings of views, which pass through the drawings.

The first ring is as high as the sheet is drawn, see `toonset.nerf.render.turntable`. A further
one lies above it, and one below, where at least LEAST drawings stand so high: they are what its
look rests on. Drawings that no ring passes through have a view of their own.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toonset.camera import Camera
from toonset.nerf.render.turntable import RING, Angles, ring_of, turn_angles

VIEWS = 72  # of a ring: steps of 5 degrees
LEAST = 3  # drawings at another elevation that carry a ring
EVERY = 3  # so many views of a ring have one with further layers: 15 degrees
SAME = 1e-9  # radians


@dataclass(frozen=True, eq=False)
class Ring:
    """From where a figure is seen.

    Attributes:
        angles: (n, 3) yaw, elevation and roll, radians.
        level: of each the ring that it belongs to, from below; -1: only a drawing is seen so.
        elevations: of the rings, degrees, rising.
        start: the first view of the sheet's own ring.
        own: of each drawing the view that sees it as it is.
        layered: whether a view has the further layers.
    """

    angles: Angles
    level: list[int]
    elevations: list[float]
    start: int
    own: list[int]
    layered: list[bool]


def ring_through(cameras: Sequence[Camera], views: int = VIEWS) -> Ring:
    """Return the rings that drawings carry, from their cameras."""
    heights = [camera.angles[1] for camera in cameras]
    level = statistics.median_low(heights) if heights else 0.0
    groups = [
        [camera for camera in cameras if -math.pi <= camera.angles[1] - level < -RING],
        [camera for camera in cameras if abs(camera.angles[1] - level) <= RING],
        [camera for camera in cameras if camera.angles[1] - level > RING],
    ]
    rings = [group for i, group in enumerate(groups) if i == 1 or len(group) >= LEAST]
    turns = [turn_angles(ring_of(group), views) for group in rings]
    angles = [tuple(row) for turn in turns for row in turn.tolist()]
    of_ring = [number for number, turn in enumerate(turns) for _ in turn]
    layered = [i % EVERY == 0 for turn in turns for i in range(len(turn))]
    own = []
    for camera in cameras:
        off = [_apart(camera.angles, one) for one in angles]
        nearest = int(np.argmin(off))
        if off[nearest] > SAME:
            nearest = len(angles)
            angles.append(camera.angles)
            of_ring.append(-1)
            layered.append(True)
        layered[nearest] = True
        own.append(nearest)
    return Ring(
        np.array(angles),
        of_ring,
        [math.degrees(_height(group)) for group in rings],
        of_ring.index(rings.index(groups[1])),
        own,
        layered,
    )


def _apart(one: Sequence[float], other: Sequence[float]) -> float:
    return max(abs(math.remainder(a - b, 2 * math.pi)) for a, b in zip(one, other, strict=True))


def _height(group: Sequence[Camera]) -> float:
    return statistics.median_low([camera.angles[1] for camera in group]) if group else 0.0
