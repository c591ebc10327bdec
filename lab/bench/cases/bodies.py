"""Simple random figures for tests and benchmarks: many bodies, each known exactly.

A body is a set of overlapping closed primitives (head, trunk, limbs, feet, nose), coloured by part.
Feet and nose tell front from back; a bag at one side tells left from right.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from toonset.mesh import Mesh

# flat and far apart, so that a palette has an undisputed answer
SKIN, HAIR, SHIRT, TROUSERS, SHOES, BAG = (
    (242, 190, 150),
    (96, 56, 38),
    (206, 62, 54),
    (52, 84, 148),
    (60, 60, 66),
    (92, 150, 74),
)


@dataclass
class _Builder:
    vertices: list[np.ndarray] = field(default_factory=list)
    faces: list[np.ndarray] = field(default_factory=list)
    colors: list[np.ndarray] = field(default_factory=list)
    parts: list[np.ndarray] = field(default_factory=list)
    names: list[str] = field(default_factory=list)

    def add(self, name: str, shape: Any, color: tuple[int, int, int]) -> None:
        offset = sum(len(v) for v in self.vertices)
        self.vertices.append(np.asarray(shape.vertices))
        self.faces.append(np.asarray(shape.faces) + offset)
        self.colors.append(np.tile(np.array(color, np.uint8), (len(shape.faces), 1)))
        self.parts.append(np.full(len(shape.faces), len(self.names)))
        self.names.append(name)


def random_body(seed: int, *, symmetric: bool = False) -> Mesh:
    """Return a figure with random proportions, about 1.8 units tall, 3 to 6 heads.

    Args:
        seed: of the proportions.
        symmetric: leave the bag away and make left and right equal.
    """
    import trimesh

    rng = np.random.default_rng(seed)
    head = float(rng.uniform(0.15, 0.28))
    hip, shoulder = 0.75 * rng.uniform(0.8, 1.1), 1.25 * rng.uniform(0.95, 1.05)
    width, arm_angle = float(rng.uniform(0.13, 0.2)), float(rng.uniform(0.25, 0.9))
    builder = _Builder()

    def limb(name: str, a: Any, b: Any, radius: float, color: tuple[int, int, int]) -> None:
        segment = np.array([a, b], dtype=float)
        shape = trimesh.creation.cylinder(radius=radius, segment=segment, sections=18)
        builder.add(name, shape, color)
        for end in segment:
            ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
            ball.apply_translation(end)
            builder.add(name, ball, color)

    def ball(name: str, at: Any, radii: Any, color: tuple[int, int, int]) -> None:
        shape = trimesh.creation.icosphere(subdivisions=3)
        shape.apply_scale(radii)
        shape.apply_translation(at)
        builder.add(name, shape, color)

    top = shoulder + 0.02 + 0.9 * head
    limb("neck", [0, shoulder - 0.08, 0], [0, top, 0], 0.055, SKIN)
    ball("head", [0, top, 0.02], [head * 0.9, head, head * 0.95], SKIN)
    ball("hair", [0, top + 0.25 * head, -0.2 * head], [head * 0.97, head * 0.9, head * 0.95], HAIR)
    ball("nose", [0, top - 0.1 * head, head], [0.16 * head, 0.14 * head, 0.3 * head], SKIN)
    ball(
        "trunk", [0, (hip + shoulder) / 2, 0], [width, 0.6 * (shoulder - hip), 0.75 * width], SHIRT
    )
    for side, name in ((1, "left"), (-1, "right")):
        hand = shoulder - 0.5 * np.cos(arm_angle), 0.5 * np.sin(arm_angle)
        elbow = [side * (0.9 * width + hand[1]), hand[0], 0.06]
        limb(f"{name} arm", [side * 0.7 * width, shoulder - 0.09, 0], elbow, 0.055, SHIRT)
        limb(f"{name} leg", [side * 0.55 * width, hip, 0], [side * 0.12, 0.08, 0], 0.075, TROUSERS)
        ball(f"{name} foot", [side * 0.12, 0.06, 0.07], [0.075, 0.06, 0.16], SHOES)
    if not symmetric:
        bag = trimesh.creation.box([0.14, 0.26, 0.2])
        bag.apply_translation([1.3 * width, hip + 0.05, -0.05])
        builder.add("bag", bag, BAG)
    return Mesh(
        np.concatenate(builder.vertices),
        np.concatenate(builder.faces),
        np.concatenate(builder.colors),
        np.concatenate(builder.parts),
        tuple(builder.names),
        f"body {seed}",
    )
