"""Find what sticks out sideways and is low: blades, outstretched arms, brims, fists.

An opening along columns takes out what is lower than a limit. Such parts have no section in common
with the rows that they cross: a blade in the front drawing is no body as deep as the side drawing's
run at its height.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool
from scipy import ndimage

from toonset.nerf.sections.drawing import TALL, Mask
from toonset.nerf.sections.runs import runs_of
from toonset.raster import parts

OUT = 0.7  # of the limit: parts that stick out less are the body's
LOW_PX = 0.11 * TALL
BRIM_PX = 0.04 * TALL  # width of a row that can be a brim's
BRIM_ROWS = 4  # by which heights of brims may differ between two drawings
BRIM_SHARE = 0.6  # of a part's rows
EVEN = 0.35  # lesser over larger reach of a brim in the front drawing
EVEN_ASIDE = EVEN / 2  # in the side drawing, where faces and hair stick out
REACH = 0.5  # of the body's width: what reaches less to either side is no brim
FLAT = 2.0  # times a part's height: a section as wide is no part's
AROUND_BODY, AROUND_PART = 31, 7  # rows in which a part's body is looked for


def thin_parts(mask: Mask, low_px: float = LOW_PX, out_px: float | None = None) -> Mask:
    """Return the parts lower than a limit that stick out sideways from what is not.

    Args:
        mask: of a figure.
        low_px: the limit.
        out_px: how far parts stick out, at least; None: OUT of the limit.
    """
    high = max(3, round(low_px))
    body = _opened(_opened(mask, (high, 1)), (1, 3))
    rest = _opened(mask & ~body, (2, 2))
    labels = parts(rest, 4)
    least = OUT * low_px if out_px is None else out_px
    found = np.zeros_like(mask)
    for number, (rows, columns) in enumerate(ndimage.find_objects(labels), start=1):
        inside = np.flatnonzero(body[rows].any(axis=0))
        across = np.arange(columns.start, columns.stop)
        if len(inside):
            across = across[(across < inside[0]) | (across > inside[-1])]
        if len(across) > least:
            found[rows, columns] |= labels[rows, columns] == number
    return found


def without_sections(front: Mask, side: Mask) -> tuple[Mask, Mask]:
    """Return the thin parts of two drawings that have no section in common.

    Two kinds have one: discs, such as a hat's brim, stick out to both sides alike, in both drawings
    and at one height; and where the other drawing's figure is narrow, as at toes, a section is no
    wider than the part. Both drawings have their rows in common.
    """
    front_parts, side_parts = thin_parts(front), thin_parts(side)
    both = np.logical_and(
        _brim_rows(front_parts, front & ~front_parts, EVEN),
        _brim_rows(side_parts, side & ~side_parts, EVEN_ASIDE),
    )
    return _chosen(front_parts, both, side), _chosen(side_parts, both, front)


def _opened(mask: Mask, size: tuple[int, int]) -> Mask:
    kernel = np.ones(size, np.uint8)
    return cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0


def _chosen(thin: Mask, brim_rows: Bool[np.ndarray, " height"], other: Mask) -> Mask:
    """Return the parts that are no brim's and are thinner than another drawing's figure is wide."""
    widths = np.zeros(len(other))
    runs = runs_of(other)
    np.maximum.at(widths, runs.row, runs.end - runs.start)
    labels = parts(thin, 4)
    kept = np.zeros_like(thin)
    for number in range(1, int(labels.max()) + 1):
        part = labels == number
        rows = part.any(axis=1)
        flat = np.median(widths[rows]) > FLAT * np.median(part.sum(axis=0)[part.any(axis=0)])
        if flat and brim_rows[rows].mean() <= BRIM_SHARE:
            kept |= part
    return kept


def _brim_rows(thin: Mask, body: Mask, even: float) -> Bool[np.ndarray, " height"]:
    """Return the rows in which parts stick out to both sides of the body alike."""
    columns = np.arange(thin.shape[1])
    around = ndimage.binary_dilation(thin, np.ones((AROUND_PART, 1)))
    beside = ndimage.binary_dilation(body, np.ones((AROUND_BODY, 1)))
    found = np.zeros(len(thin), bool)
    for row in np.flatnonzero(thin.sum(axis=1) > BRIM_PX):
        inner, outer = columns[beside[row]], columns[around[row]]
        if not len(inner):
            found[row] = True
            continue
        middle, width = (inner[0] + inner[-1]) / 2, inner[-1] - inner[0]
        reaches = max(middle - outer[0], 0), max(outer[-1] - middle, 0)
        found[row] = min(reaches) > max(even * max(reaches), REACH * width)
    return ndimage.binary_dilation(found, iterations=BRIM_ROWS)
