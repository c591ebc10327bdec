"""Find the sides of a character that no drawing shows: shape and colours there are a guess.

Drawings from opposite sides share an outline, so that for the shape half a turn is all there is:
four even views have but two outlines, five have five.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from toonset.dataset.bundle.scene import Scene
from toonset.dataset.silhouettes.mask import figure_px
from toonset.nerf.sections.drawing import yaw_of
from toonset.nerf.sections.roles import largest_gap

WIDE = math.radians(119)  # between neighbouring drawings, a third of the turn (docs/decisions.md)
FEW_OUTLINES = math.radians(75)  # of half a turn without one: four even views lose 5 dB by that
DEPTHLESS = math.radians(150)  # then a body may come out four times as deep as it is wide


@dataclass(frozen=True)
class Gap:
    """Gap in yaw between neighbouring drawings.

    Attributes:
        after: the drawing at which it begins, seen from above counterclockwise.
        before: the drawing at which it ends.
        radians: its size.
        begin: the yaw at which it begins, radians.
    """

    after: str
    before: str
    radians: float
    begin: float


def guesses(scene: Scene) -> list[str]:
    """Describe the sides of a character that no drawing shows, a line each, for people."""
    scene = replace(scene, frames=tuple(frame for frame in scene.frames if figure_px(frame)))
    if len(scene.frames) < 2:
        return []
    gap = outline_gap(scene)
    if gap > DEPTHLESS:
        return [
            "all drawings look within 30 degrees of one line, which hardly tells how deep the "
            "figure is: it is of no use from the side; add a drawing from there"
        ]
    said = [
        f"{_undrawn(gap)}no drawing in the {math.degrees(gap.radians):.0f} deg from {gap.after} to "
        f"{gap.before}: shape and colours seen from there are a guess"
        for gap in wide_gaps(scene)
    ]
    if gap > FEW_OUTLINES:
        said.append(
            f"opposite drawings share an outline, which leaves {math.degrees(gap):.0f} deg of half "
            "a turn without one: the shape between is a guess; a drawing in between tells most"
        )
    return said


def wide_gaps(scene: Scene) -> list[Gap]:
    """Return the turns of more than WIDE that no drawing looks from, about the upright axis."""
    turns = sorted((yaw_of(frame.camera), frame.name) for frame in scene.frames)
    following = [*turns[1:], (turns[0][0] + 2 * math.pi, turns[0][1])]
    gaps = [
        Gap(after, before, end - begin, begin)
        for (begin, after), (end, before) in zip(turns, following, strict=True)
    ]
    return [gap for gap in gaps if gap.radians > WIDE]


def _undrawn(gap: Gap) -> str:
    """Return which side nobody drew, and what stands in for it; "" of one without a name."""
    for side, yaw in (("front", 0.0), ("back", math.pi)):
        if 0 < (yaw - gap.begin) % (2 * math.pi) < gap.radians:
            return f"nobody drew the {side}, the paint beside it stands in; "
    return ""


def outline_gap(scene: Scene) -> float:
    """Return the largest gap in yaw between outlines, of half a turn; radians."""
    return largest_gap([yaw_of(frame.camera) for frame in scene.frames], math.pi)
