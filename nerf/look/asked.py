"""Which drawings a view asks for its paint, and how they see its places.

Two drawings flank a view; what neither shows is looked up in further ones. Near a drawing's own
camera the view becomes that drawing.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from toonset.camera import Camera
from toonset.nerf.look.choose import OTHER, Look
from toonset.nerf.look.drawings import STEP, Drawings
from toonset.nerf.look.paint_flow import NEIGHBOURS
from toonset.nerf.look.texture import CRUMB, look_up

SIDE = 1.4  # radians: a drawing farther off the view shows too little of it
THIRDS = 2  # further drawings that are asked
SAME = 1e-9  # radians: seen from one side
# Radians off a drawing's own camera, in which the view becomes the drawing; where the others were
# made to agree and it was bent or moved for that, the less, the steadier
OWN, OWN_BENT = 0.12, 0.04


def flanking(cameras: list[Camera], camera: Camera) -> tuple[int, int, float]:
    """Return the two drawings beside a view, and the first one's share.

    The first is the nearest, the second the nearest of those towards which the view lies from it;
    shares are linear in the angle along the arc between them. Where the view lies towards none,
    both are the same.
    """
    forward = camera.rotation[2]
    theirs = np.stack([own.rotation[2] for own in cameras])
    angles = np.arccos(np.clip(theirs @ forward, -1, 1))
    first = int(angles.argmin())
    start = theirs[first]
    turns = theirs - (theirs @ start)[:, None] * start
    whole = np.arctan2(np.linalg.norm(turns, axis=1), theirs @ start)
    turns /= np.maximum(np.linalg.norm(turns, axis=1, keepdims=True), 1e-12)
    along = np.arctan2(turns @ forward, start @ forward)
    towards = (along > SAME) & (whole > SAME) & (whole < NEIGHBOURS)
    if not towards.any():
        return first, first, 1.0
    second = int(np.where(towards, angles, np.inf).argmin())
    return first, second, 1 - min(1.0, float(along[second] / whole[second]))


def own_part(drawings: Drawings, camera: Camera) -> tuple[int, np.float32]:
    """Return the drawing nearest to a view, and how far the view is that drawing itself, 0 to 1."""
    forward = np.stack([view.camera.rotation[2] for view in drawings.views])
    turns = np.arccos(np.clip(forward @ camera.rotation[2], -1, 1))
    nearest_one = int(turns.argmin())
    reach = OWN if drawings.views[nearest_one].original is None else OWN_BENT
    return nearest_one, np.float32(_eased(max(0.0, 1 - float(turns[nearest_one]) / reach)))


def looks_of(
    drawings: Drawings,
    camera: Camera,
    points: Float[np.ndarray, "h w 3"],
    flank: tuple[int, int, float],
) -> tuple[list[int], list[Look]]:
    """Return the drawings that a view asks, the nearest first, and how they see its places."""
    first, second, share = flank
    figure_px = drawings.height * camera.scale
    found = drawings.flow(first, second) if first != second else None
    flow = None if found is None else np.float32(found[1]) * found[0].at(points)
    sides = [(first, -(1 - share), share)]
    if second != first:
        sides.append((second, share, 1 - share))
    forward = camera.rotation[2]
    for number in _others(drawings, camera, (first, second)):
        facing = float(drawings.textures[number].camera.rotation[2] @ forward)
        sides.append((number, 0.0, OTHER * facing))
    looks = []
    for number, part, weight in sides:
        texture = drawings.textures[number]
        slack, least_px = STEP * drawings.height, CRUMB * figure_px**2
        seen = look_up(texture, points, slack, least_px, faces=drawings.shape is None)
        x, y = seen.moved(flow, part)
        scale = camera.scale / texture.camera.scale
        looks.append(Look(texture, x, y, seen.mask, weight, scale))
    return [number for number, _, _ in sides], looks


def _others(drawings: Drawings, camera: Camera, used: tuple[int, int]) -> list[int]:
    forward = np.stack([view.camera.rotation[2] for view in drawings.views])
    angles = np.arccos(np.clip(forward @ camera.rotation[2], -1, 1))
    order = [int(i) for i in np.argsort(angles) if i not in used and angles[i] < SIDE]
    return order[:THIRDS]


def _eased(part: float) -> float:
    return part * part * (3 - 2 * part)
