"""Labels beside points: every label in a place where it covers no point and no other label."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

DIRECTIONS = 16
FIRST_PX, STEP_PX, STEPS = 4.0, 9.0, 24  # distances of a label from its point's marker
SOFT_PX = 14.0  # pixels further away that a label goes, to cover no line
BESIDE_PX = 8.0  # no leader up to this distance


@dataclass(frozen=True)
class Box:
    """An upright rectangle in pixels; y grows upwards."""

    left: float
    bottom: float
    right: float
    top: float

    @classmethod
    def around(cls, x: float, y: float, half_width: float, half_height: float) -> Box:
        """Return the box of this centre."""
        return cls(x - half_width, y - half_height, x + half_width, y + half_height)

    def overlaps(self, other: Box) -> bool:
        """Return whether they share more than an edge."""
        beside = self.right <= other.left or other.right <= self.left
        return not (beside or self.top <= other.bottom or other.top <= self.bottom)

    def holds(self, other: Box) -> bool:
        """Return whether the other one lies inside."""
        across = self.left <= other.left and other.right <= self.right
        return across and self.bottom <= other.bottom and other.top <= self.top

    def nearest(self, x: float, y: float) -> tuple[float, float]:
        """Return the point of the box that is nearest."""
        return min(max(x, self.left), self.right), min(max(y, self.bottom), self.top)

    def is_crossed(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Return whether the straight line from start to end enters the box."""
        first, last = 0.0, 1.0
        sides = ((self.left, self.right), (self.bottom, self.top))
        for (low, high), a, b in zip(sides, start, end, strict=True):
            if a == b:
                if not low < a < high:
                    return False
                continue
            enters, leaves = sorted(((low - a) / (b - a), (high - a) / (b - a)))
            first, last = max(first, enters), min(last, leaves)
        return first < last


Line = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Label:
    """What needs a place: a text's size, and the point (x, y) and radius of its marker."""

    x: float
    y: float
    radius: float
    width: float
    height: float

    @property
    def marker(self) -> Box:
        """Return what the marker covers."""
        return Box.around(self.x, self.y, self.radius, self.radius)


def place_labels(
    labels: Sequence[Label], room: Box, *, taken: Sequence[Box] = (), lines: Sequence[Box] = ()
) -> list[Box]:
    """Return a box per label, inside the room and over no marker and no other label.

    Each goes to the nearest free place, the first labels first. Where nothing is free, it goes
    where it covers least.

    Args:
        labels: what matters most first.
        room: where labels may be.
        taken: what must not be covered, either.
        lines: what had better not be covered.
    """
    markers = [label.marker for label in labels]
    placed: list[Box] = []
    leaders: list[Line] = []
    for label in labels:
        obstacles = _Obstacles([*taken, *markers, *placed], lines, leaders, label.marker)
        best, least = None, (math.inf, math.inf)
        for distance, box in _candidates(label, room):
            if best is not None and least <= (0, distance):
                break  # all that follow are further away
            price = obstacles.price(box, (label.x, label.y), distance)
            if best is None or price < least:
                best, least = box, price
        assert best is not None
        placed.append(best)
        leaders.append(((label.x, label.y), best.nearest(label.x, label.y)))
    return placed


def needs_leader(label: Label, box: Box) -> bool:
    """Return whether a label is so far from its point that a line must lead there."""
    x, y = box.nearest(label.x, label.y)
    return math.hypot(x - label.x, y - label.y) > label.radius + BESIDE_PX


@dataclass(frozen=True)
class _Obstacles:
    """What a label must not cover, and what it and its leader had better not cross."""

    hard: Sequence[Box]
    soft: Sequence[Box]
    leaders: Sequence[Line]
    own: Box

    def price(self, box: Box, anchor: tuple[float, float], distance: float) -> tuple[float, float]:
        """Return how much a place covers, then how far it is, in pixels and their like."""
        leader = anchor, box.nearest(*anchor)
        covered = sum(box.overlaps(other) for other in self.hard)
        crossed = sum(other != self.own and other.is_crossed(*leader) for other in self.hard)
        crossed += sum(box.is_crossed(*other) for other in self.leaders)
        soft = sum(box.overlaps(line) for line in self.soft)
        return covered, distance + SOFT_PX * (soft + 2 * crossed)


def _candidates(label: Label, room: Box) -> Iterator[tuple[float, Box]]:
    """Yield places all round the point with their distance from its marker, nearest first."""
    inside = False
    for step in range(STEPS):
        distance = FIRST_PX + STEP_PX * step
        for number in range(DIRECTIONS):
            angle = 2 * math.pi * number / DIRECTIONS
            box = _beside(label, distance + label.radius, math.cos(angle), math.sin(angle))
            if room.holds(box):
                inside = True
                yield distance, box
    if not inside:  # a point at the edge of a small room
        x = min(max(label.x, room.left + label.width / 2), room.right - label.width / 2)
        y = min(max(label.y, room.bottom + label.height / 2), room.top - label.height / 2)
        yield math.inf, Box.around(x, y, label.width / 2, label.height / 2)


def _beside(label: Label, distance: float, right: float, up: float) -> Box:
    x = label.x + right * distance + label.width / 2 * max(-1.0, min(1.0, 1.5 * right))
    y = label.y + up * distance + label.height / 2 * max(-1.0, min(1.0, 1.5 * up))
    return Box.around(x, y, label.width / 2, label.height / 2)
