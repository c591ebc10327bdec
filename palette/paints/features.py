"""Find features: eyes, mouths, buttons, too small for the 5 % rule but part of the character.

A colour under the rule is a feature if people tell it from every colour of the palette, and if it
is where the character has it: at the same height in two drawings or more, for turning leaves
heights as they are. In a single drawing it must be there twice, at one height. Specks of paper
between an arm and the body meet at one height, too, but there is little of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from toonset.palette.colors import JUST_NOTICEABLE, oklab_from_rgb
from toonset.palette.options import MAX_COLORS
from toonset.palette.paints.clusters import UNLIKE
from toonset.palette.paints.places import PLACES
from toonset.palette.palette import Palette, Shadow
from toonset.palette.pixels.labels import nearest_labels
from toonset.palette.pixels.shadow import apply_shadow

RGB = tuple[int, int, int]

WORN_SHARE, WORN_UNLIKE = 0.01, 2 * JUST_NOTICEABLE  # of the character; in OKLab: shoes, belts
SMALL = 0.05  # of the character: more is no feature, whatever share is asked for
THICK = 3  # pixels: a patch of a blend is thinner
LEAST_PX = 48  # of all patches at that height: two eyes of 5 x 5
LEFT = 2 * JUST_NOTICEABLE  # from a paint's colour in shadow: such a colour is a rest of it
ALIKE = 0.05  # of the figure's height: heights of one feature differ by less, the median


def find_features(
    palette: Palette, pictures: Sequence[UInt8[np.ndarray, "_ _ 4"]], shadow: Shadow | None = None
) -> tuple[RGB, ...]:
    """Return those of a palette's left-out colours that are features.

    Args:
        palette: of the pictures.
        pictures: the character on transparent ground, in light.
        shadow: that was taken off: what looks like a colour of the palette in it was left there.
    """
    small = [color for color in palette.dropped if color.share < SMALL]
    unlike = [
        color.rgb
        for color in small
        if color.cost >= UNLIKE or (color.share >= WORN_SHARE and color.cost >= WORN_UNLIKE)
    ]
    if shadow is not None:
        shades = oklab_from_rgb(apply_shadow(palette.rgb, shadow.factor))
        unlike = [rgb for rgb in unlike if _away(rgb, shades) > LEFT]
    listed = [*(color.rgb for color in palette.colors), *(color.rgb for color in palette.dropped)]
    listed = listed[:MAX_COLORS]
    labels = [nearest_labels(picture, np.array(listed, dtype=np.uint8)) for picture in pictures]
    return tuple(
        rgb for rgb in unlike if rgb in listed and _recurs(listed.index(rgb), labels, pictures)
    )


def _away(rgb: RGB, others: Float[np.ndarray, "n 3"]) -> float:
    own = oklab_from_rgb(np.array(rgb, dtype=np.uint8))
    return float(np.linalg.norm(others - own, axis=1).min())


def _recurs(
    number: int, labels: Sequence[UInt8[np.ndarray, "_ _"]], pictures: Sequence[np.ndarray]
) -> bool:
    """Return whether a label's patches are at one height of the figure, and large enough."""
    square = np.ones((THICK, THICK), dtype=np.uint8)
    heights: list[float] = []
    patches_px: list[int] = []
    levels: list[float] = []
    for label, picture in zip(labels, pictures, strict=True):
        patches = cv2.morphologyEx((label == number).view(np.uint8), cv2.MORPH_OPEN, square)
        if not patches.any():
            continue
        rows = np.flatnonzero((picture[..., 3] > 0).any(axis=1))
        _, _, stats, centers = cv2.connectedComponentsWithStats(patches)
        areas, level = stats[1:, cv2.CC_STAT_AREA], (centers[1:, 1] - rows[0]) / len(rows)
        patches_px += areas.tolist()
        levels += level.tolist()
        if len(pictures) > 1:  # of its largest patch
            level = level[[int(areas.argmax())]]
        heights += level.tolist()
    if not heights:
        return False
    at, every, areas = (np.array(some) for some in (heights, levels, patches_px))
    order = np.sort(at)
    there = np.searchsorted(order, at + ALIKE, "right") - np.searchsorted(order, at - ALIKE)
    most = at[there.argmax()]
    area = int(areas[np.abs(every - most) <= ALIKE].sum())
    return int(there.max()) >= max(PLACES, (len(heights) + 1) // 2) and area >= LEAST_PX
