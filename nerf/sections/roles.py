"""Say what each drawing is for: from the front, from the side, from between.

Seen without distance, drawings from opposite sides have one silhouette, so that directions count
modulo half a turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from toonset.camera import Camera
from toonset.nerf.sections.drawing import Drawing, mirrored, yaw_of

FACING = math.radians(22)  # from front or back
ASIDE = math.radians(25)  # from a right angle with the front
SAME = math.radians(20)  # drawings this near have one silhouette
# Between outlines, of half a turn: where they leave more a hull is square; of a sheet that leaves a
# side undrawn less is enough, since each of its outlines was drawn but once
GAP, GAP_OF_HALF = math.radians(55), math.radians(40)
UNDRAWN = math.radians(119)  # between neighbouring drawings, of the whole turn
EYE_LEVEL = math.radians(8)  # from above or below, rows of two drawings show no common height


@dataclass(frozen=True, eq=False)
class Roles:
    """What each drawing is for.

    Attributes:
        facing: from front or back; the first has the runs that are sections.
        aside: from the sides; the first says how deep sections are. There may be none.
        between: the others.
    """

    facing: tuple[Drawing, ...]
    aside: tuple[Drawing, ...]
    between: tuple[Drawing, ...]


def roles_of(drawings: Sequence[Drawing]) -> Roles:
    """Return what drawings are for."""
    facing = [d for d in drawings if apart(d.yaw, 0) < FACING]
    facing = sorted(facing, key=lambda d: abs(d.yaw))
    facing = facing or [min(drawings, key=lambda d: apart(d.yaw, 0))]
    rest = [d for d in drawings if d not in facing]
    across = facing[0].yaw + math.pi / 2
    aside = [d for d in rest if apart(d.yaw, across) < ASIDE]
    aside = sorted(aside, key=lambda d: apart(d.yaw, across))
    return Roles(tuple(facing), tuple(aside), tuple(d for d in rest if d not in aside))


def mirror_images(
    drawings: Sequence[Drawing], everything: Sequence[Drawing], plane_x: float
) -> list[Drawing]:
    """Return the mirror images of drawings that show a silhouette which no drawing shows."""
    images = (mirrored(drawing, plane_x) for drawing in drawings)
    return [i for i in images if all(apart(i.yaw, d.yaw) > SAME for d in everything)]


def wants_sections(cameras: Sequence[Camera]) -> bool:
    """Return whether drawings from here have sections, and a hull of them would be square."""
    return at_eye_level(cameras) and hull_is_square(cameras)


def hull_is_square(cameras: Sequence[Camera]) -> bool:
    """Return whether a hull of outlines from here would have edges that no figure has.

    Without any outline there is no hull to trust.
    """
    if not cameras:
        return True
    yaws = [yaw_of(camera) for camera in cameras]
    half = largest_gap(yaws, 2 * math.pi) > UNDRAWN
    return largest_gap(yaws, math.pi) > (GAP_OF_HALF if half else GAP)


def at_eye_level(cameras: Sequence[Camera]) -> bool:
    """Return whether rows of all drawings show common heights."""
    return all(abs(camera.angles[1]) < EYE_LEVEL for camera in cameras)


def largest_gap(yaws: Sequence[float], turn: float) -> float:
    """Return the largest gap between directions that repeat after a turn; radians."""
    turns = sorted(yaw % turn for yaw in yaws)
    following = [*turns[1:], turns[0] + turn]
    return max(end - begin for begin, end in zip(turns, following, strict=True))


def apart(one: float, other: float) -> float:
    """Return the angle between two lines of sight, whichever way they look."""
    return abs((one - other + math.pi / 2) % math.pi - math.pi / 2)
