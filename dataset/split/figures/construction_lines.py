"""Find construction lines that stick out of a line drawing: a centre line, an eye line.

They are as thin as lines, straight, end in nothing, and each is the only one on its side: level to
the left or right, or upright below. Staffs are broader, antennae stand above, whiskers and legs
come in pairs.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int

from toonset.dataset.split.figures.blobs import Blobs, find_blobs
from toonset.dataset.split.figures.open_outlines import LINE
from toonset.raster import dilate, wider_than

LONG = 0.12  # of the figure's height: shorter ends are hair, claws, folds
STRAIGHT = 0.015  # of the same: a line leaves its row or column by no more
FULL = 0.6  # of its length that is drawn


def find_construction_lines(
    blobs: Blobs, main_blobs: Int[np.ndarray, " main_blobs"]
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels of thin straight lines beside and below the bodies of the views."""
    found = np.zeros(blobs.labels.shape, dtype=bool)
    for number in main_blobs:
        mask, window = np.pad(blobs.mask(int(number)), 1), blobs.window(int(number))
        found[window] |= _loose_ends(mask)[1:-1, 1:-1]
    return found


def _loose_ends(mask: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """Return the straight lines that leave a figure sideways, or downwards below its feet."""
    tall = len(mask) - 2
    by = max(1, round(LINE * tall))
    body = wider_than(mask, by)
    lines = np.zeros_like(mask)
    if not body.any():
        return lines
    core = dilate(body, by)
    bottom = int(np.flatnonzero(body.any(axis=1))[-1])
    middle = float(np.flatnonzero(body.any(axis=0)).mean())
    thin = find_blobs(mask & ~core)
    long, off = max(6, round(LONG * tall)), max(3, round(STRAIGHT * tall))
    sides: dict[str, list[int]] = {"left": [], "right": [], "below": []}
    for number, (x, y, width, height) in enumerate(thin.boxes.tolist()):
        level, upright = height <= off <= long <= width, width <= off <= long <= height
        if not level and not (upright and y >= bottom - off):
            continue
        own, window = thin.mask(number), thin.window(number)
        if own.any(axis=0 if level else 1).sum() < FULL * max(width, height):
            continue
        around = tuple(slice(max(part.start - 1, 0), part.stop + 1) for part in window)
        met = np.nonzero(dilate(thin.labels[around] == number + 1) & core[around])
        if not len(met[0]) or np.ptp(met[1 if level else 0]) > by + off:
            continue  # it does not end in nothing
        side = "below" if upright else "left" if x + width / 2 < middle else "right"
        sides[side].append(number)
    for alone in sides.values():  # whiskers and legs come in pairs
        if len(alone) == 1:
            lines[thin.window(alone[0])] |= thin.mask(alone[0])
    return lines
