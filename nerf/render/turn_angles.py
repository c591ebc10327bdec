"""Choose the directions of a turn: every drawing on the way is one of them.

Drawings are directions (yaw, elevation, roll). Those about as high as the sheet's median are its
ring; a turn follows the ring, straight from drawing to drawing in all three angles. Between two
drawings its steps are equal, and every further step goes where steps are widest: the widest step
is then as small as it can be, and drawings that lie on an even grid are met by even steps.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera

RING = math.radians(15)  # above or below the sheet's elevation: further ones are no part of a turn
SAME = math.radians(1)  # nearer drawings are one direction
FRONT = math.radians(22.5)  # a drawing within it is the front
SNAP = 0.25  # of a step: how far a view moves to a drawing where drawings outnumber views
TURN = 2 * math.pi

Angles = Float[np.ndarray, "n 3"]
Yaws = Float[np.ndarray, " n"]


def ring_of(cameras: Sequence[Camera]) -> Angles:
    """Return the directions on a sheet's ring by rising yaw from 0; of twins the first."""
    angles = [camera.angles for camera in cameras]
    level = statistics.median_low([elevation for _, elevation, _ in angles]) if angles else 0.0
    ring: list[tuple[float, float, float]] = []
    for yaw, elevation, roll in angles:
        alone = all(abs(math.remainder(yaw - other, TURN)) > SAME for other, _, _ in ring)
        if alone and abs(elevation - level) <= RING:
            ring.append((yaw % TURN, elevation, roll))
    return np.array(sorted(ring)).reshape(-1, 3)


def turn_angles(ring: Angles, count: int) -> Angles:
    """Return `count` directions all round, yaw rising from the front.

    Args:
        ring: the drawings, as `ring_of` returns them; none: equal turns at elevation 0.
        count: at least as many as drawings: each drawing is one of the directions. Fewer: equal
            turns, moved to drawings that are near.
    """
    if not len(ring):
        return at_yaws(ring, _even(0.0, count))
    yaws = ring[:, 0]
    if count >= len(ring):
        found = _between(yaws, _shares(_arcs(yaws), count), 0)
    else:
        found = _snapped(_even(_front(yaws), count), yaws)
    return at_yaws(ring, _from_front(found, _front(yaws)))


def angles_between(ring: Angles, count: int) -> Angles:
    """Return `count` directions as far from drawings as can be, yaw rising from the front.

    They lie half way between neighbours; those of a wide gap are several, and if there are more
    gaps than asked for, the directions are those that lie farthest apart.
    """
    if not len(ring):
        return at_yaws(ring, _even(TURN / count / 4, count))
    yaws = ring[:, 0]
    parts = _shares(_arcs(yaws), max(count + len(yaws), 2 * len(yaws)), least=2)
    return at_yaws(ring, _from_front(_farthest(_between(yaws, parts, 1), yaws, count), 0.0))


def at_yaws(ring: Angles, yaws: Yaws) -> Angles:
    """Return the ring's directions at yaws: elevation and roll are straight between drawings."""
    if not len(ring):
        return np.stack([yaws, np.zeros_like(yaws), np.zeros_like(yaws)], axis=1)
    tilts = [np.interp(yaws % TURN, ring[:, 0], ring[:, k], period=TURN) for k in (1, 2)]
    return np.stack([yaws, *tilts], axis=1)


def _arcs(yaws: Yaws) -> Yaws:
    """Return how far each drawing's successor lies from it."""
    return np.diff(yaws, append=yaws[0] + TURN)


def _shares(arcs: Yaws, count: int, least: int = 1) -> list[int]:
    """Return into how many steps each arc is cut, `count` in all, the widest step least."""
    parts = np.full(len(arcs), least)
    for _ in range(count - int(parts.sum())):
        parts[np.argmax(np.round(arcs / parts, 9))] += 1
    return [int(part) for part in parts]


def _between(yaws: Yaws, parts: Sequence[int], first: int) -> Yaws:
    """Return the ends of the steps that arcs are cut into; `first` 1 leaves the drawings out."""
    cut = zip(yaws, _arcs(yaws), parts, strict=True)
    return np.concatenate([yaw + arc * np.arange(first, n) / n for yaw, arc, n in cut])


def _farthest(found: Yaws, yaws: Yaws, count: int) -> Yaws:
    """Return `count` of some yaws: that farthest from drawings, then always farthest from those."""
    chosen, taken = yaws, found[:0]
    while len(taken) < count:
        apart = np.abs(_wrapped(found[:, None] - chosen)).min(axis=1)
        best = found[np.argmax(np.round(apart, 9))]
        chosen = taken = np.append(taken, best)
    return taken


def _snapped(even: Yaws, yaws: Yaws) -> Yaws:
    """Return yaws at equal steps, each moved to the drawing that is near."""
    apart = _wrapped(yaws - even[:, None])
    nearest = np.take_along_axis(apart, np.abs(apart).argmin(axis=1)[:, None], axis=1)[:, 0]
    return even + np.where(np.abs(nearest) <= SNAP * TURN / len(even), nearest, 0.0)


def _even(start: float, count: int) -> Yaws:
    return start + TURN * np.arange(count) / count


def _front(yaws: Yaws) -> float:
    """Return the yaw of the drawing that is the front, or 0 if there is none."""
    nearest = float(_wrapped(yaws)[np.abs(_wrapped(yaws)).argmin()])
    return nearest if abs(nearest) <= FRONT else 0.0


def _from_front(found: Yaws, front: float) -> Yaws:
    """Return yaws in the order of a turn that begins nearest to `front`."""
    start = float(found[np.abs(_wrapped(found - front)).argmin()])
    return math.remainder(start, TURN) + np.sort((found - start) % TURN)


def _wrapped(yaw: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return angles within half a turn of 0."""
    return (yaw + math.pi) % TURN - math.pi
