"""Tell drawn frames from figures: lines round what is drawn, or pieces of them, ruled or by hand.

A frame round figures encloses them like the outline of one large figure. But it is a line alone,
it goes round its box once, and what it encloses stands free of it. Where it has gaps its pieces are
lines as simple, longer than figures are high.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool

from toonset.dataset.split.figures.blobs import Blobs
from toonset.dataset.split.figures.open_outlines import LINE
from toonset.raster import connected_to, dilate, sized_parts, wider_than

Mask = Bool[np.ndarray, "height width"]

LEAST_SIDE = 0.2  # of the sheet's shorter side: smaller rectangles are parts of drawings
FULL = 0.85  # of its box that a frame encloses
FRAMED = 0.3  # of its height: something as high stands in it
BROAD = 0.1  # of a frame's cells that are broader than a line, as its corners are
ROUND = 2.6  # times the sum of width and height: a line that goes round its box but once
PAINTED = 0.5  # of what is drawn that is broader than lines: it is painted, no line drawing


def find_frames(blobs: Blobs, painted: Mask) -> Mask:
    """Return the lines that stand round figures without touching them.

    Args:
        blobs: patches of the sheet, with what they enclose.
        painted: what is drawn.
    """
    found = np.zeros_like(painted)
    for number in _large(blobs):
        window, mask = blobs.window(number), blobs.mask(number)
        if mask.mean() < FULL:
            continue
        drawn = painted[window] & mask
        outer = connected_to(dilate(np.pad(~mask, 1, constant_values=True))[1:-1, 1:-1], drawn)
        if not _is_one_line(outer):
            continue
        inside, areas = sized_parts(drawn & ~outer)
        rows = np.nonzero(inside)[0]
        numbers = inside[inside > 0]
        top, bottom = np.full(len(areas), mask.shape[0]), np.zeros(len(areas), dtype=int)
        np.minimum.at(top, numbers, rows)
        np.maximum.at(bottom, numbers, rows)
        if (bottom - top)[1:].max(initial=0) >= FRAMED * mask.shape[0]:
            found[window] |= outer
    return found


def find_strokes(blobs: Blobs, painted: Mask) -> Mask:
    """Return the patches that are simple lines, beside painted figures; else none.

    Args:
        blobs: patches of the sheet, with what they enclose.
        painted: what is drawn.
    """
    found = np.zeros_like(painted)
    strokes = [number for number in _large(blobs) if _is_one_line(blobs.mask(number))]
    if not strokes:
        return found
    height = int(blobs.boxes[:, 3].max())
    broad = wider_than(painted, max(1, round(LINE * height)))
    lines = int(blobs.areas[strokes].sum())
    others = int(blobs.areas.sum()) - lines
    if others < lines or np.count_nonzero(broad) < PAINTED * others:
        return found
    for number in strokes:
        found[blobs.window(number)] |= blobs.mask(number)
    return found


def _large(blobs: Blobs) -> list[int]:
    least = LEAST_SIDE * min(blobs.labels.shape)
    return np.flatnonzero(blobs.boxes[:, 2:].max(axis=1) >= least).tolist()


def _is_one_line(mask: Mask) -> bool:
    """Return whether a patch is a thin line that goes round its box once at most."""
    height, width = mask.shape
    broad = wider_than(mask, max(1, round(LINE * max(height, width))))
    if np.count_nonzero(broad) > BROAD * np.count_nonzero(mask):
        return False
    edges, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
    length = sum(cv2.arcLength(edge, closed=True) for edge in edges) / 2
    return length <= ROUND * (width + height)
