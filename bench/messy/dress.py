"""What characters of messy sheets wear and hold, as closed shapes round a `random_body`."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

Part = tuple[str, Any]  # a name and a trimesh shape
EXTRAS = ("cape", "skirt", "ears", "tail")
FLOAT_GAPS = (0.07, 0.14)  # of a body 1.8 tall: a gap that is seen at 150 px
HAND_RADIUS = 0.085


def extra(name: str, middle: float, radius: float) -> list[Part]:
    """Return the shapes of one of EXTRAS, for a head at a height."""
    import trimesh

    if name == "ears":
        return [("ear", _ear(side, middle, radius)) for side in (-1, 1)]
    if name == "skirt":
        cone = trimesh.creation.cone(radius=0.36, height=0.9, sections=40)
        return [("skirt", _upright(cone, (0, 0.35, 0)))]
    if name == "cape":
        cape = trimesh.creation.icosphere(subdivisions=3)
        cape.apply_scale((0.3, 0.5, 0.06))
        cape.apply_translation((0, 0.72, -0.24))
        return [("cape", cape)]
    ends = [[0, 0.65, -0.1], [0.05, 0.5, -0.55]]
    return [("tail", trimesh.creation.cylinder(radius=0.05, segment=ends, sections=20))]


def hat(brim_y: float, radius: float) -> list[Part]:
    """Return a pointed hat, its brim at a height, for a head of a radius."""
    import trimesh

    brim = trimesh.creation.cylinder(radius=1.25 * radius, height=0.12 * radius, sections=40)
    top = trimesh.creation.cone(radius=0.8 * radius, height=1.3 * radius, sections=40)
    return [("hat", _upright(shape, (0, brim_y, 0))) for shape in (brim, top)]


def staff(arm: Float[np.ndarray, "points 3"]) -> list[Part]:
    """Return a staff at the outer end of the right arm."""
    import trimesh

    x, _, z = arm[np.argmin(arm[:, 0])]
    segment = [[x + 0.02, 0.02, z], [x + 0.02, 1.45, z]]
    return [("staff", trimesh.creation.cylinder(radius=0.025, segment=segment, sections=16))]


def hands(body: Float[np.ndarray, "points 3"], height: float, gap: float) -> list[Part]:
    """Return two hands beside the body, clear of it by a gap at their height."""
    import trimesh

    near = np.abs(body[:, 1] - height) < 2 * HAND_RADIUS
    out = float(np.abs(body[near, 0]).max()) + HAND_RADIUS + gap
    found = []
    for side in (-1, 1):
        hand = trimesh.creation.icosphere(subdivisions=3, radius=HAND_RADIUS)
        hand.apply_translation((side * out, height, 0.05))
        found.append(("hand", hand))
    return found


def _ear(side: int, middle: float, radius: float) -> Any:
    import trimesh

    ear = trimesh.creation.icosphere(subdivisions=3)
    ear.apply_scale((0.28 * radius, 0.75 * radius, 0.2 * radius))
    ear.apply_translation((side * 0.65 * radius, middle + 1.25 * radius, 0))
    return ear


def _upright(shape: Any, place: tuple[float, float, float]) -> Any:
    """Return a shape made along +Z, turned to stand along +Y at `place`."""
    import trimesh

    shape.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    shape.apply_translation(place)
    return shape
