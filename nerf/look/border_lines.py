"""Close the lines between paints where a view has pieces of two drawings.

The drawings tell of every pair of paints whether the artist draws a line along all of its borders.
Where a view has such a border without a line, because a seam runs there, one is drawn. Pairs with a
line along a part of their border are left as they are: there it stands for a step in depth.

Where one part of the figure hides another of the same paint, only a line tells them apart: one is
drawn along deep steps in depth that no line is near.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8, UInt16

from toonset.nerf.look.features import lines_of
from toonset.nerf.look.step_lines import step_places, step_sides
from toonset.raster import dilate, distance_to, nearest, sized_parts, taken

LINED = 0.9  # of the border of two paints: they have a line
LEAST = 0.05  # of the figure's height: shorter borders tell nothing
SMOOTH = 0.008  # of the height: borders are smooth over so much
BROKEN = 0.6  # times the pen's width, to the nearest line: so far away there is none
STEP, DEEP = 0.03, 0.08  # of the height: a step in depth; most of a hidden edge is so deep
LONG = 0.04  # of the height: shorter edges and lines do not count
BESIDE = 0.01  # of the height: so far to both sides a step's paints are looked up
ASTRAY = 0.015  # of the height: a drawn line so near an edge is its line
GAP = 0.006  # of the height: edges go on over so much
SOFT_PX = 1.0  # sigma that smooths them
PAINTS = 256  # a pair is its lower paint times so many, and the higher one
NONE = 0xFFFF  # no pair

Mask = Bool[np.ndarray, "height width"]
Labels = UInt8[np.ndarray, "height width"]
Depth = Float[np.ndarray, "height width"]
Pairs = UInt16[np.ndarray, " pairs"]


@dataclass(frozen=True, eq=False)
class Unlined:
    """A picture's paints without its lines.

    Attributes:
        labels: (height, width) the paint, under lines and features and beyond the figure, too.
        lined: (height, width) pixels in which lines are, and beside them.
        inside: (height, width) pixels of the figure.
        figure_px: height of the figure.
    """

    labels: Labels
    lined: Mask
    inside: Mask
    figure_px: float

    @classmethod
    def of(
        cls,
        paint: Float[np.ndarray, "height width 3"],
        labels: Labels,
        inside: Mask,
        pen: tuple[float, tuple[int, int, int]] | None,
        figure_px: float,
    ) -> Unlined:
        """Return the paints under a drawing's lines, which `pen` drew."""
        lined = lines_of(paint, pen) & inside
        kept = inside & ~lined if (inside & ~lined).any() else np.ones_like(inside)
        return cls(taken(labels, nearest(kept)), lined, inside, figure_px)

    def extended(self, inside: Mask) -> Unlined:
        """Return the paints extended into the pixels of a figure that no drawing shows."""
        if not self.inside.any():
            return self
        return replace(self, labels=taken(self.labels, nearest(self.inside)), inside=inside)

    def borders(self) -> UInt16[np.ndarray, "height width"]:
        """Return every pixel's pair of paints, whose border it lies at; NONE elsewhere."""
        side = round(SMOOTH * self.figure_px) | 1
        smooth = cv2.medianBlur(self.labels, side) if side > 1 else self.labels
        pairs = np.full(smooth.shape, NONE, np.uint16)
        for here, there in (
            ((slice(None), slice(-1)), (slice(None), slice(1, None))),
            ((slice(-1), slice(None)), (slice(1, None), slice(None))),
        ):
            apart = (smooth[here] != smooth[there]) & self.inside[here] & self.inside[there]
            one, other = (smooth[side_of][apart].astype(np.uint16) for side_of in (here, there))
            pair = np.minimum(one, other) * np.uint16(PAINTS) + np.maximum(one, other)
            pairs[here][apart] = pairs[there][apart] = pair
        return pairs

    def broken(self, pen_px: float) -> Mask:
        """Return the pixels that no line is near."""
        if not self.lined.any():
            return np.ones_like(self.lined)
        return distance_to(self.lined) > max(1.0, BROKEN * pen_px)


def lined_pairs(drawn: Iterable[Unlined], pen_px: float) -> Pairs:
    """Return the pairs of paints between which an artist draws a line.

    Args:
        drawn: of the drawings.
        pen_px: width of their lines.
    """
    length, lined = np.zeros(NONE + 1), np.zeros(NONE + 1)
    for unlined in drawn:
        pairs = unlined.borders()
        for total, these in ((length, pairs), (lined, pairs[~unlined.broken(pen_px)])):
            total += np.bincount(these.ravel(), minlength=NONE + 1) / unlined.figure_px
    length[NONE] = 0
    always = (length > 2 * LEAST) & (lined > LINED * length)  # counted on both sides
    return np.flatnonzero(always).astype(np.uint16)


def missing_lines(
    unlined: Unlined, lined: Pairs, pen_px: float
) -> Float[np.ndarray, "height width"]:
    """Return how far lines that a view lacks cover every pixel, 0 to 1.

    Args:
        unlined: of the view.
        lined: the pairs that have lines.
        pen_px: width of the lines.
    """
    wanted = np.zeros(NONE + 1, dtype=bool)
    wanted[lined] = True
    at = wanted[unlined.borders()]
    gaps = at & unlined.broken(pen_px)
    if not gaps.any():
        return np.zeros(gaps.shape, np.float32)
    drawn = at & dilate(gaps, max(1, round(pen_px)))  # until it meets the line that is there
    cover = np.clip(pen_px / 2 - distance_to(drawn), 0, 1).astype(np.float32)
    return np.where(unlined.inside, cover, 0)


def missing_steps(
    unlined: Unlined, depth: Depth, height: float, pen_px: float
) -> Float[np.ndarray, "height width"]:
    """Return how far lines along hidden edges that a view lacks cover every pixel, 0 to 1.

    Args:
        unlined: of the view.
        depth: of the surface, world units.
        height: of the figure, world units.
        pen_px: width of the lines.
    """
    long_px = LONG * unlined.figure_px
    lines = _parts_of(unlined.lined, long_px * pen_px)
    gaps = _hidden_edges(unlined, depth, height)
    if lines.any():
        gaps &= distance_to(lines) > ASTRAY * unlined.figure_px
    gaps = _parts_of(gaps, long_px)
    if not gaps.any():
        return np.zeros(gaps.shape, np.float32)
    away = cv2.GaussianBlur(distance_to(gaps), (0, 0), SOFT_PX)
    return np.where(unlined.inside, np.clip((pen_px + 1) / 2 - away, 0, 1), 0).astype(np.float32)


def _hidden_edges(unlined: Unlined, depth: Depth, height: float) -> Mask:
    """Return lines, a pixel wide, along deep steps in depth and borders of paints beside them.

    Args:
        unlined: of a picture.
        depth: of the surface, world units.
        height: of the figure, world units.
    """
    from skimage.morphology import skeletonize

    px = unlined.figure_px
    shown = np.where(unlined.inside, depth, np.nan)
    places, across = step_places(shown, STEP * height, 1, 1.0)
    steps = np.zeros(depth.shape, dtype=bool)
    if not len(places):
        return steps
    last = np.array(depth.shape)[::-1] - 1
    at, near, far = (
        np.floor(places + by * across).astype(int).clip(0, last).T[::-1]
        for by in (0.0, -BESIDE * px, BESIDE * px)
    )
    steps[tuple(at)] = True
    edges = (unlined.borders() != NONE) & (distance_to(steps) < ASTRAY * px)
    edges[tuple(at)] |= unlined.labels[tuple(near)] == unlined.labels[tuple(far)]
    part, areas = sized_parts(dilate(edges, max(1, round(GAP * px))))
    deep, _ = step_sides(shown, DEEP * height)
    deeps, lengths = (np.bincount(part[on], minlength=len(areas)) for on in (deep, steps))
    kept = (lengths > LONG * px) & (2 * deeps > lengths)
    kept[0] = False
    return np.asarray(skeletonize(kept[part]))


def _parts_of(mask: Mask, least_px: float) -> Mask:
    """Return the parts of a mask that have more pixels."""
    part, areas = sized_parts(mask)
    large = areas > least_px
    large[0] = False
    return np.asarray(large[part])
