"""Locate colours: their patches, the largest of each for a person to look at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.palette.options import MAX_COLORS
from toonset.palette.paints.histogram import OPAQUE_WORD, RGB, Histogram
from toonset.palette.palette import Palette, Place
from toonset.palette.pixels.labels import nearest_labels

PLACES = 2  # at which a colour is, or in which drawings: one may be a slip of the pen
THIN = 2  # pixels: blends along an edge are thinner
BITS = 8  # of a byte: so many kinds of colours are looked for at once

Members = Int[np.ndarray, " members"]
Box = tuple[int, int, int, int]


def add_places(palette: Palette, images: Sequence[UInt8[np.ndarray, "_ _ 4"]]) -> Palette:
    """Return the palette with the place of every left-out colour's largest patch, if it lacks one.

    It is looked for in the picture with most of the colour's pixels, each pixel taken for the
    nearest of all colours, left-out ones included.

    Args:
        palette: of these pictures.
        images: the character on transparent ground.
    """
    if all(color.place is not None for color in palette.dropped):
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
        dropped.append(replace(color, place=color.place or place))
    return replace(palette, dropped=tuple(dropped))


@dataclass(frozen=True, eq=False)
class Pixels:
    """Pixels of some colours in a picture.

    Attributes:
        view: number of the picture.
        rows: of every pixel.
        columns: likewise.
    """

    view: int
    rows: Int[np.ndarray, " pixels"]
    columns: Int[np.ndarray, " pixels"]


def pixels_of(histogram: Histogram, kinds: Sequence[Members]) -> list[list[Pixels]]:
    """Return for every kind of colour where it is, per picture that has it.

    Args:
        histogram: of the character's pictures.
        kinds: positions of each one's colours in it; a colour may be of several.
    """
    found: list[list[Pixels]] = [[] for _ in kinds]
    for first in range(0, len(kinds), BITS):
        some = kinds[first : first + BITS]
        marks = np.zeros(1 << 24, dtype=np.uint8)
        for bit, members in enumerate(some):
            marks[histogram.codes[members]] |= 1 << bit
        for view, picture in enumerate(histogram.pictures):
            marked = marks[picture.words & RGB] * (picture.words >= OPAQUE_WORD)
            at = np.flatnonzero(marked)
            rows, columns = np.divmod(at, max(picture.words.shape[1], 1))
            for bit in range(len(some)):
                own = (marked.ravel()[at] & (1 << bit)) > 0
                if own.any():
                    pixels = Pixels(view, picture.top + rows[own], columns[own])
                    found[first + bit].append(pixels)
    return found


def patches_of(places: Sequence[Pixels], thickness_px: int = THIN) -> list[Place]:
    """Return every connected patch of some pixels, the largest first.

    Args:
        places: the pixels, per picture.
        thickness_px: what is thinner is not a patch.
    """
    found = []
    for own in places:
        (row, row_of), (column, column_of) = _squeezed(own.rows), _squeezed(own.columns)
        mask = np.zeros((len(row_of), len(column_of)), dtype=bool)
        mask[row, column] = True
        for (x, y, width, height), area in _patches(mask, thickness_px):
            box = (int(column_of[x]), int(row_of[y]), width, height)
            found.append((area, Place(own.view, box)))
    found.sort(key=lambda one: (-one[0], one[1].view, one[1].box))
    return [place for _, place in found]


def _squeezed(
    values: Int[np.ndarray, " n"],
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " lines"]]:
    """Return whole numbers with every gap shrunk to one, and what each of the new ones was."""
    known = np.unique(values)
    new = np.cumsum(np.minimum(np.diff(known, prepend=known[0]), 2))
    old = np.zeros(new[-1] + 1, dtype=np.int64)
    old[new] = known
    return new[np.searchsorted(known, values)], old


def _largest_patch(mask: Bool[np.ndarray, "height width"]) -> Box:
    """Return (x, y, width, height) of the largest connected part that is thicker than a blend."""
    patches = _patches(mask, THIN) or _patches(mask, 1)
    return max(patches, key=lambda patch: patch[1])[0]


def _patches(mask: Bool[np.ndarray, "height width"], thickness_px: int) -> list[tuple[Box, int]]:
    """Return box and area of every connected part of what such a square fits into."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, left = int(rows[0]), int(columns[0])
    part = np.pad(mask[top : rows[-1] + 1, left : columns[-1] + 1], thickness_px)
    square = np.ones((thickness_px, thickness_px), dtype=np.uint8)
    corner = cv2.erode(part.view(np.uint8), square, anchor=(0, 0))
    thick = cv2.dilate(corner, square, anchor=(thickness_px - 1, thickness_px - 1))
    stats = cv2.connectedComponentsWithStats(thick)[2][1:]
    top, left = top - thickness_px, left - thickness_px
    return [((left + x, top + y, w, h), area) for x, y, w, h, area in stats.tolist()]
