"""Find ground that is sketched under the figures: hatching, dry strokes, a wash, a spray of dots.

Unlike a soft shadow it has a texture and any colour, ink's as well. It is told from feet by where
it lies: flat in the lowest rows of its figure, beside and below feet that are broader than a
stroke, under most figures of the sheet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.dataset.split.figures.blobs import Blobs, find_blobs
from toonset.raster import connected_to, dilate, distance_to, parts_mostly_in, wider_than

BAND = 0.06  # of the figure's height, from its lowest row up: no strokes lie higher
WASH = 0.1  # of the same: no wash reaches higher, and most of it lies among the strokes
FLAT = 0.03  # of the height: a patch of overlapping strokes is no higher
STROKE = 0.008  # of the height, half a stroke's width
PALE = 0.5  # of the feet's contrast with the paper: a wash has less
BESIDE = 0.25  # of the figure's width on both sides: so far ground reaches beyond its box
SPREAD = 0.04  # of the height, columns of ground away from the feet
SCATTERED = 4  # strokes away from the feet: a tail, a staff's tip and toes are fewer
BROAD = 0.2  # of the height, a wash under the feet: a pale shoe is shorter


@dataclass(frozen=True, eq=False)
class Ground:
    """What may be sketched ground under one figure.

    Attributes:
        mask: its pixels.
        spread: its columns away from the feet, of the figure's height.
        strokes: how many lie away from the feet.
        broad: width of its widest wash, of the figure's height.
    """

    mask: Bool[np.ndarray, "height width"]
    spread: float = 0.0
    strokes: int = 0
    broad: float = 0.0


def find_ground_strokes(
    blobs: Blobs,
    main_blobs: Int[np.ndarray, " main_blobs"],
    painted: Bool[np.ndarray, "height width"],
    contrast: UInt8[np.ndarray, "height width"],
) -> Bool[np.ndarray, "height width"]:
    """Return the pixels of sketched ground; none unless most of the figures stand on some.

    Args:
        blobs: patches of paint with what they enclose.
        main_blobs: numbers of those that are bodies of views.
        painted: pixels that are not background.
        contrast: levels between every pixel and the background.
    """
    found = np.zeros_like(painted)
    bodies = np.append(False, np.isin(np.arange(len(blobs.areas)), main_blobs))[blobs.labels]
    each = []
    for number in main_blobs:
        window = _around_the_feet(blobs.boxes[number], painted.shape)
        own = blobs.labels[window] == number + 1
        paint = painted[window] & (own | ~bodies[window])
        ground = _ground_of(own, paint, contrast[window], int(blobs.boxes[number, 3]))
        found[window] |= ground.mask
        each.append((ground.spread, ground.strokes, ground.broad))
    spread, strokes, broad = np.median(each, axis=0)
    drawn = spread >= SPREAD and (strokes >= SCATTERED or broad >= BROAD)
    return found if drawn else np.zeros_like(found)


def _around_the_feet(box: np.ndarray, shape: tuple[int, ...]) -> tuple[slice, slice]:
    x, y, width, height = (int(value) for value in box)
    bottom, aside, up = y + height, round(BESIDE * width), max(2, round(2 * BAND * height))
    return (
        slice(max(bottom - up, 0), min(bottom + up // 4, shape[0])),
        slice(max(x - aside, 0), min(x + width + aside, shape[1])),
    )


def _ground_of(
    own: Bool[np.ndarray, "height width"],
    paint: Bool[np.ndarray, "height width"],
    contrast: UInt8[np.ndarray, "height width"],
    tall: int,
) -> Ground:
    """Return what lies under and beside one figure's feet.

    Args:
        own: the figure with what it encloses.
        paint: of it and of patches beside it.
        contrast: levels between every pixel and the background.
        tall: the figure's height.
    """
    if not own.any():
        return Ground(np.zeros_like(own))
    lowest = int(np.flatnonzero(own.any(axis=1))[-1])
    above = np.broadcast_to(lowest - np.arange(len(own))[:, None], own.shape)
    low, flat, room = (above <= max(1, share * tall) for share in (BAND, FLAT, WASH))
    if not (own & low & paint).any() or not (own & ~room).any():
        return Ground(np.zeros_like(own))
    by = max(1, round(STROKE * tall))
    pale = contrast < PALE * np.percentile(contrast[own & low & paint], 90)
    wash = connected_to(dilate(~own & ~paint) & low, room & pale & paint)
    wash &= ~connected_to(dilate(wider_than(own & pale & paint, by) & ~room), wash, 8)
    wash &= parts_mostly_in(wash, low)
    enclosed = own & ~paint
    enclosed &= ~(flat & connected_to(~low, enclosed, 8))  # between the legs
    broad = find_blobs(wider_than((paint & ~wash) | enclosed, by))
    is_foot = broad.boxes[:, 3] >= FLAT * tall
    is_foot[np.unique(broad.labels[~low & own & (broad.labels > 0)]) - 1] = True
    feet = np.append(False, is_foot)[broad.labels]
    if not (feet & low).any():
        return Ground(np.zeros_like(own))
    strokes = low & paint & ~dilate(feet, by) & ~wash
    ground = wash | (strokes & ~connected_to(dilate(own & paint & ~low), strokes, 8))  # a fringe
    away = ground & (distance_to(feet) > 2 * by)
    pieces = find_blobs(away)
    bottom = int(np.flatnonzero(feet.any(axis=1))[-1])
    beside = pieces.boxes[:, 1] <= bottom + by  # lower ones are letters
    away &= np.append(False, beside)[pieces.labels]
    counted = np.ones(len(beside) + 1, dtype=bool)
    counted[np.unique(pieces.labels[wider_than(away, by)])] = False
    count = int((beside & counted[1:]).sum())
    below = find_blobs(ground)
    ground &= np.append(False, below.boxes[:, 1] <= bottom + by)[below.labels]
    widest = find_blobs(wash).boxes[:, 2].max(initial=0) * _on_both_sides(wash, feet & low)
    return Ground(ground, float(away.any(axis=0).sum()) / tall, count, float(widest) / tall)


def _on_both_sides(
    wash: Bool[np.ndarray, "height width"], feet: Bool[np.ndarray, "height width"]
) -> bool:
    """Return whether a wash reaches farther left and right than the feet; a tail does not."""
    if not wash.any():
        return False
    washed, stood = (np.flatnonzero(mask.any(axis=0)) for mask in (wash, feet))
    return bool(washed[0] < stood[0] and washed[-1] > stood[-1])
