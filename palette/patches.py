"""Where left-out colours are: the largest patch of each, so that a person can look at it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from toonset.palette.labels import nearest_labels
from toonset.palette.palette import MAX_COLORS, Palette, Place

BLOCK = np.ones((2, 2), dtype=np.uint8)  # blends along an edge are thinner


def with_places(palette: Palette, images: Sequence[UInt8[np.ndarray, "_ _ 4"]]) -> Palette:
    """Return the palette with the place of every left-out colour's largest patch.

    It is looked for in the picture with most of the colour's pixels, each pixel taken for the
    nearest of all colours, left-out ones included.

    Args:
        palette: of these pictures.
        images: the character on transparent ground.
    """
    if not palette.dropped:
        return palette
    kept, left = ([c.rgb for c in palette.colors], [c.rgb for c in palette.dropped])
    listed = [*kept, *left][:MAX_COLORS]
    labels = [nearest_labels(image, np.array(listed, dtype=np.uint8)) for image in images]
    counts = np.array([np.bincount(own.ravel(), minlength=256) for own in labels])
    dropped = []
    for number, color in enumerate(palette.dropped, start=len(palette.colors)):
        view = int(counts[:, number].argmax()) if number < len(listed) else 0
        seen = number < len(listed) and counts[view, number] > 0
        place = Place(view, _largest_patch(labels[view] == number)) if seen else None
        dropped.append(replace(color, place=place))
    return replace(palette, dropped=tuple(dropped))


def _largest_patch(mask: Bool[np.ndarray, "height width"]) -> tuple[int, int, int, int]:
    """Return (x, y, width, height) of the largest connected part that is thicker than a blend."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, left = int(rows[0]), int(columns[0])
    part = mask[top : rows[-1] + 1, left : columns[-1] + 1].astype(np.uint8)
    thick = cv2.morphologyEx(part, cv2.MORPH_OPEN, BLOCK)
    _, _, stats, _ = cv2.connectedComponentsWithStats(thick if thick.any() else part)
    largest = stats[1:][stats[1:, cv2.CC_STAT_AREA].argmax()]
    x, y, width, height = (int(value) for value in largest[:4])
    return left + x, top + y, width, height
