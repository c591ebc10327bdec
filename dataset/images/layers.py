"""Say of a layered file whose layers hold a figure each what a person can do with them.

The picture of all layers is what is cut: it is what the person sees. Layers are often line art over
colours, so they are never cut by themselves; where they surely are one figure each, a line says it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

Box = tuple[int, int, int, int]  # x, y, width, height

BACKGROUND = 0.9  # of the picture's width and height: a layer that covers more is paper
FIGURE = 0.5  # of the highest layer: a lower one is a caption or a prop


@dataclass(frozen=True)
class Layer:
    """A visible layer or group at the top of a layered file.

    Attributes:
        name: as the person has called it.
        box: around what it shows, pixels of the picture.
    """

    name: str
    box: Box


def layers_line(
    layers: Sequence[Layer], size_wh: tuple[int, int], figures: Sequence[Box]
) -> str | None:
    """Return a line, for people, if every figure-high layer stands beside the others; else None.

    Args:
        layers: visible ones.
        size_wh: of the picture.
        figures: boxes of the views that were found in it, in their order.
    """
    others = [layer for layer in layers if not _covers(layer.box, size_wh)]
    highest = max((layer.box[3] for layer in others), default=0)
    full = [layer for layer in others if layer.box[3] >= FIGURE * highest > 0]
    if len(full) < 2 or any(
        _overlap(one.box, other.box) for i, one in enumerate(full) for other in full[:i]
    ):
        return None
    inside = [[layer.name for layer in full if _overlap(layer.box, box)] for box in figures]
    if len(full) == len(figures) and all(len(names) == 1 for names in inside):
        names = ",".join(name for (name,) in inside)
        return f"its layers hold a figure each: --views '{names}' if their names say directions"
    return (
        f"{len(full)} of its layers hold a figure each, {len(figures)} views were found: if those "
        "are wrong, save every layer as a PNG and name the PNGs"
    )


def _covers(box: Box, size_wh: tuple[int, int]) -> bool:
    return box[2] >= BACKGROUND * size_wh[0] and box[3] >= BACKGROUND * size_wh[1]


def _overlap(one: Box, other: Box) -> bool:
    return all(
        one[axis] < other[axis] + other[axis + 2] and other[axis] < one[axis] + one[axis + 2]
        for axis in (0, 1)
    )
