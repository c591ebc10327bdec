"""Find the smooth zones of a picture, and where they meet in straight edges.

A zone is a connected patch without edges: its colour may change slowly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.raster import dilate, erode, from_nearest, sized_parts

MEDIAN_PX = 5  # grain and thin lines are no edges
EDGE = 7  # levels between neighbours
REACH = 0.0075  # of the shorter side: zones grow by it to meet, for a ruled line may part them
SOFT_CELLS = 2  # that a zone ends before its edge: they grow by these, too
BEND_CELLS = 1.2  # that an edge may leave a straight line
LEAST_EDGE = 0.03  # of the shorter side: a shorter edge is not straight
LEAST_EDGE_CELLS = 40  # arcs of a radius of less than 170 cells bend too much
LEAST_RULED = 0.1  # of the shorter side: level or upright edges as long may have a line along them
BETWEEN = 8  # levels beyond the colours of two zones: there a line is drawn between them


@dataclass(frozen=True, eq=False)
class Zones:
    """Smooth connected patches of a picture.

    Attributes:
        labels: (rows, columns) number of the zone, from 1; 0 at edges and in small patches.
        shrink: cells of `labels` per pixel of the picture, at most 1.
    """

    labels: Int[np.ndarray, "rows columns"]
    shrink: float

    @property
    def count(self) -> int:
        """Return how many zones there are."""
        return int(self.labels.max())

    @property
    def reach(self) -> int:
        """Return by how many cells zones grow to meet: half a ruled line."""
        return SOFT_CELLS + round(REACH * min(self.labels.shape))

    @cached_property
    def areas(self) -> Int[np.ndarray, " zones"]:
        """Return the zones' cells, from number 0 on."""
        return np.bincount(self.labels.ravel())

    @cached_property
    def windows(self) -> list[tuple[slice, slice]]:
        """Return the rows and columns of the zones, from number 1 on."""
        return _windows(self.labels)

    @cached_property
    def sizes_wh(self) -> Int[np.ndarray, "zones 2"]:
        """Return the widths and heights of the zones, from number 0 on."""
        sizes = [(x.stop - x.start, y.stop - y.start) for y, x in self.windows]
        return np.array([self.labels.shape[::-1], *sizes])

    @cached_property
    def grown(self) -> Int[np.ndarray, "rows columns"]:
        """Return the zones, grown until they meet."""
        own = self.labels > 0
        if not own.any():
            return self.labels
        return np.where(dilate(own, self.reach), from_nearest(self.labels, own), 0)

    @cached_property
    def are_lines(self) -> Bool[np.ndarray, " zones"]:
        """Return which zones are level or upright lines."""
        return np.asarray(self.sizes_wh.min(axis=1) <= self.reach)

    @cached_property
    def are_thin(self) -> Bool[np.ndarray, " zones"]:
        """Return which zones are nowhere broad: lines of any form."""
        broad = self.labels[erode(self.labels > 0, self.reach // 2)]
        return np.bincount(broad, minlength=self.count + 1) == 0

    def colors(self, picture: UInt8[np.ndarray, "rows columns 3"]) -> Float[np.ndarray, "zones 3"]:
        """Return the zones' median colours in a picture, from number 0 on."""
        found = [np.zeros(3)]
        for number, window in enumerate(self.windows, start=1):
            found.append(np.median(picture[window][self.labels[window] == number], axis=0))
        return np.array(found)

    def mask(
        self, numbers: list[int], size_wh: tuple[int, int]
    ) -> Bool[np.ndarray, "height width"]:
        """Return the pixels of zones in the picture."""
        own = np.isin(self.labels, numbers).view(np.uint8)
        return cv2.resize(own, size_wh, interpolation=cv2.INTER_NEAREST) > 0


@dataclass(frozen=True, eq=False)
class Meetings:
    """Where grown zones meet, in cells of length; zone 0 is whatever is no zone.

    Attributes:
        length: of the outline of a zone (row) along another one (column).
        straight: the part of it on straight steps.
    """

    length: Int[np.ndarray, "zones zones"]
    straight: Int[np.ndarray, "zones zones"]


def find_zones(
    rgb: UInt8[np.ndarray, "height width 3"], shrink: float, least_share: float
) -> Zones:
    """Return the zones that take more than a share of the picture.

    Args:
        rgb: the picture, shrunk already.
        shrink: its cells per pixel of the whole one.
        least_share: of the picture.
    """
    small = cv2.medianBlur(np.ascontiguousarray(rgb), MEDIAN_PX)
    near = np.ones((3, 3), np.uint8)
    steep = cv2.subtract(cv2.dilate(small, near), cv2.erode(small, near)).max(axis=2)
    found, areas = sized_parts(steep <= EDGE, connectivity=4)
    large = areas >= least_share * found.size
    large[0] = False
    number = np.where(large, np.cumsum(large), 0).astype(np.int32)
    return Zones(number[np.asarray(found, dtype=np.int32)], shrink)


def shrunk(
    picture: UInt8[np.ndarray, "height width c"], longest_px: int
) -> tuple[np.ndarray, float]:
    """Return a picture no longer than that, and its cells per pixel of the whole one."""
    shrink = min(1.0, longest_px / max(picture.shape[:2]))
    if shrink == 1:
        return picture, shrink
    size = (max(round(side * shrink), 1) for side in picture.shape[1::-1])
    return cv2.resize(picture, tuple(size), interpolation=cv2.INTER_AREA), shrink


def find_meetings(
    zones: Zones,
    values: UInt8[np.ndarray, "rows columns 3"],
    picture: UInt8[np.ndarray, "rows columns 3"],
) -> Meetings:
    """Return where zones meet.

    Args:
        zones: of the picture.
        values: their colours, beyond them the nearest zone's.
        picture: in cells.
    """
    count, shorter = zones.count + 1, min(zones.labels.shape)
    least = max(LEAST_EDGE_CELLS, LEAST_EDGE * shorter)
    length, straight = (np.zeros((count, count), dtype=np.int64) for _ in range(2))
    for number, (rows, columns) in enumerate(_windows(zones.grown), start=1):
        own = np.pad(zones.grown[rows, columns] == number, 1).view(np.uint8)
        outlines, _ = cv2.findContours(own, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        for outline in outlines:
            points = outline[:, 0] + np.array([columns.start - 1, rows.start - 1])
            others, is_step = _beside(points, zones.grown, values, picture)
            edge, upright = _edges(outline)
            good = (edge >= least) & is_step | (edge >= LEAST_RULED * shorter) & upright
            length[number] += np.bincount(others, minlength=count)
            straight[number] += np.bincount(others[good], minlength=count)
    return Meetings(length, straight)


def _windows(labels: Int[np.ndarray, "rows columns"]) -> list[tuple[slice, slice]]:
    from scipy.ndimage import find_objects

    found: list[tuple[slice, slice]] = find_objects(labels)
    return found


def _beside(
    points: Int[np.ndarray, "n 2"],
    grown: Int[np.ndarray, "rows columns"],
    values: UInt8[np.ndarray, "rows columns 3"],
    picture: UInt8[np.ndarray, "rows columns 3"],
) -> tuple[Int[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Return which zone lies beside points of an outline, and whether no line is drawn there."""
    columns, rows = points.T
    own = grown[rows, columns]
    others, beside = np.zeros_like(own), values[rows, columns]
    for right, down in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        x = np.clip(columns + right, 0, grown.shape[1] - 1)
        y = np.clip(rows + down, 0, grown.shape[0] - 1)
        found = (others == 0) & (grown[y, x] != own)
        others[found] = grown[y, x][found]
        beside[found] = values[y, x][found]
    here, there, color = (
        levels.astype(np.int16)
        for levels in (values[rows, columns], beside, picture[rows, columns])
    )
    low, high = np.minimum(here, there) - BETWEEN, np.maximum(here, there) + BETWEEN
    return others, np.asarray(np.all((color >= low) & (color <= high), axis=1))


def _edges(
    outline: Int[np.ndarray, "n 1 2"],
) -> tuple[Float[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Return the length of the straight edge that every point is on, and if it is level or upright.

    Source: polygons of outlines, U. Ramer (1972); D. Douglas, T. Peucker (1973).
    """
    corners = cv2.approxPolyDP(outline, BEND_CELLS, True)[:, 0]
    points = outline[:, 0]
    wide = int(points.max()) + 1
    starts = np.flatnonzero(np.isin(points @ (1, wide), corners @ (1, wide)))
    across = np.abs(np.roll(points[starts], -1, axis=0) - points[starts])
    which = np.searchsorted(starts, np.arange(len(points)), side="right") - 1
    length = np.hypot(across[:, 0], across[:, 1])
    return length[which], (across.min(axis=1) <= BEND_CELLS)[which]
