"""Find ground that is sketched under the figures: hatching, dry strokes, a wash, a spray of dots.

Unlike a soft shadow it has a texture, and any colour. What tells it from feet is where it lies:
flat in the lowest rows of its figure, beside and below feet that are broader than a stroke, and
under most figures of the sheet.
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


Mask = Bool[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class _Ground:
    """What may be sketched ground under one figure.

    Attributes:
        mask: its pixels.
        spread: its columns away from the feet, as a share of the figure's height.
        strokes: how many of its pieces away from the feet are as thin as strokes.
        broad: width of its widest wash, as a share of the figure's height.
    """

    mask: Mask
    spread: float = 0.0
    strokes: int = 0
    broad: float = 0.0


@dataclass(frozen=True, eq=False)
class _Surroundings:
    """The lowest rows of a figure, and what lies beside them.

    Attributes:
        own: the figure with what it encloses.
        paint: of it and of patches beside it.
        contrast: levels between every pixel and the background.
        tall: the figure's height.
    """

    own: Mask
    paint: Mask
    contrast: UInt8[np.ndarray, "height width"]
    tall: int

    @property
    def stroke(self) -> int:
        """Return half of a stroke's width in pixels."""
        return max(1, round(STROKE * self.tall))

    def lowest(self, share: float) -> Mask:
        """Return the figure's lowest rows up to a share of its height, and all below."""
        last = int(np.flatnonzero(self.own.any(axis=1))[-1])
        above = last - np.arange(len(self.own))[:, None]
        return np.broadcast_to(above <= max(1, share * self.tall), self.own.shape)


def find_ground_strokes(
    blobs: Blobs,
    main_blobs: Int[np.ndarray, " main_blobs"],
    painted: Mask,
    contrast: UInt8[np.ndarray, "height width"],
) -> Mask:
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
        ground = _ground_of(
            _Surroundings(own, paint, contrast[window], int(blobs.boxes[number, 3]))
        )
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


def _ground_of(seen: _Surroundings) -> _Ground:
    """Return what lies under and beside one figure's feet."""
    nothing = _Ground(np.zeros_like(seen.own))
    if not seen.own.any():
        return nothing
    low, stroke = seen.lowest(BAND), seen.stroke
    if not (seen.own & low & seen.paint).any() or not (seen.own & ~seen.lowest(WASH)).any():
        return nothing
    wash = _wash(seen)
    feet = _feet(seen, wash)
    if not (feet & low).any():
        return nothing
    strokes = low & seen.paint & ~dilate(feet, stroke) & ~wash
    fringe = connected_to(dilate(seen.own & seen.paint & ~low), strokes, 8)
    bottom = int(np.flatnonzero(feet.any(axis=1))[-1]) + stroke
    ground = _starting_above(bottom, wash | (strokes & ~fringe))  # lower down are letters
    away = _starting_above(bottom, ground & (distance_to(feet) > 2 * stroke))
    pieces = find_blobs(away)
    thick = np.unique(pieces.labels[wider_than(away, stroke)])
    thin = len(pieces.areas) - np.count_nonzero(thick)
    widest = find_blobs(wash).boxes[:, 2].max(initial=0) * _on_both_sides(wash, feet & low)
    spread = np.count_nonzero(away.any(axis=0))
    return _Ground(ground, spread / seen.tall, int(thin), float(widest) / seen.tall)


def _wash(seen: _Surroundings) -> Mask:
    """Return pale paint at the feet that no line divides from the paper: a wash, dry strokes.

    What is pale above as well is cloth, and so is what lies above the strokes.
    """
    low, room = seen.lowest(BAND), seen.lowest(WASH)
    feet = seen.contrast[seen.own & low & seen.paint]
    pale = (seen.contrast < PALE * np.percentile(feet, 90)) & seen.paint
    wash = connected_to(dilate(~seen.own & ~seen.paint) & low, room & pale)
    cloth = wider_than(seen.own & pale, seen.stroke) & ~room
    return parts_mostly_in(wash & ~connected_to(dilate(cloth), wash, 8), low)


def _feet(seen: _Surroundings, wash: Mask) -> Mask:
    """Return the parts of a figure that are broader than a stroke, and higher or no ground's."""
    low = seen.lowest(BAND)
    enclosed = seen.own & ~seen.paint
    enclosed &= ~(seen.lowest(FLAT) & connected_to(~low, enclosed, 8))  # between the legs
    broad = find_blobs(wider_than((seen.paint & ~wash) | enclosed, seen.stroke))
    is_foot = np.append(False, broad.boxes[:, 3] >= FLAT * seen.tall)
    is_foot[np.unique(broad.labels[~low & seen.own])] = True
    is_foot[0] = False
    return is_foot[broad.labels]


def _starting_above(row: int, mask: Mask) -> Mask:
    """Return the parts of a mask that do not begin below a row."""
    pieces = find_blobs(mask)
    return np.append(False, pieces.boxes[:, 1] <= row)[pieces.labels]


def _on_both_sides(wash: Mask, feet: Mask) -> bool:
    """Return whether a wash reaches farther left and right than the feet; a tail does not."""
    if not wash.any():
        return False
    washed, stood = (np.flatnonzero(mask.any(axis=0)) for mask in (wash, feet))
    return bool(washed[0] < stood[0] and washed[-1] > stood[-1])
