"""Lay the colours of a view on each other: large paints below small ones, lines on top.

A region's border is where half of a pixel is its own. Where a higher region meets it, it goes on
beneath that one, and holes that only higher regions fill are filled: no reader shows a gap between
neighbours.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from skimage.measure import find_contours

from toonset.nerf.render.bezier import Curve, Points, fit_closed
from toonset.nerf.render.shares import NONE, Colors, Labels, Shares
from toonset.raster import dilate, distance_to, parts

LINES = -1  # the paint of lines
OFF_PX = 0.2  # how far a curve may be off the border that it follows
BENEATH_PX = 2.0  # by which regions go on beneath those above
LEAST_PX = 0.5  # area of a path
CRISPER = 0.5  # of what a blur takes away, put on top: thin lines stay whole
Shape = tuple[Curve, ...]


@dataclass(frozen=True, eq=False)
class Region:
    """What a view shows in one colour.

    Attributes:
        paint: its number; LINES.
        rgb: sRGB bytes.
        shapes: connected parts, each its outline and then its holes; pixels of the view.
    """

    paint: int
    rgb: tuple[int, int, int]
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, eq=False)
class Stack:
    """Colours that are to lie on each other.

    Attributes:
        colors, paints: of the shares, lines last.
        like_pen: colours that lines go on over, for nobody sees where they end there.
        shares: of every pixel.
        labels: those of the shares, lines where the outline is.
    """

    colors: Colors
    paints: tuple[int, ...]
    like_pen: Bool[np.ndarray, " colors"]
    shares: Shares
    labels: Labels

    def order(self) -> list[int]:
        """Return the colours, the lowest first: large paints, in them large ones; lines last."""
        areas = np.bincount(self.labels[self.labels != NONE], minlength=len(self.paints))
        whole = dict.fromkeys(self.paints, 0)
        for paint, area in zip(self.paints, areas.tolist(), strict=True):
            whole[paint] += area

        def place(k: int) -> tuple[bool, int, int, int, int]:
            paint = self.paints[k]
            return paint == LINES, -whole[paint], paint, -int(areas[k]), k

        return sorted(np.flatnonzero(areas).tolist(), key=place)

    def regions(
        self, corner: Int[np.ndarray, " 2"], scale: Float[np.ndarray, " 2"]
    ) -> tuple[Region, ...]:
        """Return the regions, the lowest first.

        Args:
            corner: of the picture in its view.
            scale: pixels of the picture in one of the result, across and down.
        """
        above = np.ones(len(self.colors), dtype=bool)
        borders: dict[int, list[Points]] = {}
        order = self.order()
        for k in order:
            above[k] = False
            under = self.like_pen if self.paints[k] == LINES else above
            borders[k] = [points + corner for points in self._borders(k, under)]
        curves = iter(fit_closed(list(itertools.chain.from_iterable(borders.values())), OFF_PX))
        found = []
        for k in order:
            mine = [curve / scale for curve in itertools.islice(curves, len(borders[k]))]
            red, green, blue = np.rint(255 * self.colors[k]).astype(int).tolist()
            if mine:
                shapes = _shapes(borders[k], mine)
                found.append(Region(self.paints[k], (red, green, blue), shapes))
        return tuple(found)

    def _borders(self, k: int, above: Bool[np.ndarray, " colors"]) -> list[Points]:
        """Return the contours of a colour and of what it goes on under; lines go on above."""
        x, y, width, height = cv2.boundingRect((self.labels == k).view(np.uint8))
        x, y = max(0, x - 3), max(0, y - 3)
        at = (slice(y, y + height + 6), slice(x, x + width + 6))
        labels, own = self.labels[at], np.arange(len(self.colors)) == k
        mask, outside = labels == k, labels == NONE
        holes = parts(~mask, connectivity=4)
        lower = ~(above[labels] & ~outside) | (self.paints[k] == LINES)
        filled = np.bincount(holes.ravel(), lower.ravel()) == 0
        filled[[0, *holes[[0, -1]].ravel(), *holes[:, [0, -1]].ravel()]] = False
        reach = np.clip(BENEATH_PX + 1 - distance_to(mask), 0, 1)
        reach = np.maximum(reach, dilate(filled[holes]))
        reach = np.minimum(reach, np.clip(distance_to(outside) - 1, 0, 1))
        field = self.shares.of(own, at) + reach * self.shares.of(above, at)
        field, clear = np.pad(field, 2), np.pad(self.shares.clear[at], 2, mode="edge")
        soft = cv2.GaussianBlur(field, (0, 0), 1.0)
        field = soft + clear * (1 + CRISPER) * (field - soft)
        finer = cv2.resize(
            field.astype(np.float32), None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC
        )
        found = [(points[:-1, ::-1] + 0.5) / 2 - 2 + (x, y) for points in find_contours(finer, 0.5)]
        return [points for points in found if len(points) > 2 and abs(_area(points)) > LEAST_PX]


def _shapes(contours: Sequence[Points], curves: Sequence[Curve]) -> tuple[Shape, ...]:
    """Return outlines, each with its holes: those that lie in it and in no smaller one."""
    areas = [_area(points) for points in contours]
    shapes = {i: [i] for i, area in enumerate(areas) if area > 0}
    for i, area in enumerate(areas):
        if area > 0:
            continue
        x, y = contours[i][0].tolist()
        around = [
            j
            for j in shapes
            if areas[j] > -area
            and cv2.pointPolygonTest(contours[j].astype(np.float32), (x, y), measureDist=False) >= 0
        ]
        if around:
            shapes[min(around, key=areas.__getitem__)].append(i)
    return tuple(tuple(curves[i] for i in part) for part in shapes.values())


def _area(points: Points) -> float:
    """Return the area within a contour, negative for a hole."""
    x, y = points.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)
