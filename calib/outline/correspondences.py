"""Match a drawing's outline with the mannequin's occluding contour at a pose.

Every point of the occluding contour is matched with the nearest drawn one, and every drawn point
with the nearest occluding one. "Nearest" is measured over position and outline direction together,
so that the two sides of a thin limb are not confused.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.calib.outline.occluding_contour import OccludingContour, Surface, occluding_contour_at
from toonset.calib.outline.pose import Pose, project
from toonset.dataset.silhouettes.contour import Contour

FAR = 10.0  # heights
SUBPIXEL_HEIGHT = 90.0  # px of a figure's height per subpixel of the visibility test
DIRECTION_OF_HEIGHT = 0.06  # a contour turned by 60 degrees counts as this far away
BLOCK = 64  # rows of a distance table at once


@dataclass(frozen=True, eq=False)
class Matches:
    """Corresponding points of occluding contour and drawing.

    Attributes:
        points: (n, 3) occluding points, surface coordinates.
        targets: (n, 2) drawn points in pixels.
        normals: (n, 2) outward normals of the drawn outline there.
        distances: (n,) pixel distance before the step, direction included.
        drawn: number of leading rows that come from drawn points (the rest from occluding points).
        target_index: (n,) which drawn point each row's target is.
    """

    points: Float[np.ndarray, "n 3"]
    targets: Float[np.ndarray, "n 2"]
    normals: Float[np.ndarray, "n 2"]
    distances: Float[np.ndarray, " n"]
    drawn: int
    target_index: Int[np.ndarray, " n"]


class Table:
    """Points, or points with features, prepared for `nearest`.

    Single precision tells neighbours apart whose distances differ by more than about 1e-3 px.
    """

    def __init__(self, points: Float[np.ndarray, "n features"]) -> None:
        """Prepare points whose coordinates are not much larger than their distances."""
        single = points.astype(np.float32)
        self.rows = np.hstack([single, np.ones((len(single), 1), np.float32)])
        self.columns = np.vstack([-single.T, (single**2).sum(axis=1) / 2])


class Drawing:
    """A contour at a working scale, thinned (built once, used by every start)."""

    def __init__(self, contour: Contour, height_px: float, max_points: int) -> None:
        """Scale `contour` to `height_px` and thin it to about `max_points`."""
        self.factor = height_px / contour.height_px
        scaled = contour.scaled(self.factor)
        every = max(1, round(len(scaled.points) / max_points))
        left, top, width, height = scaled.box
        margin = 0.3 * height
        self.offset = np.array([left - margin, top - margin])
        self.points = scaled.points[::every] - self.offset
        self.normals = scaled.normals[::every]
        self.free = scaled.free[::every]
        self.low, self.high = np.reshape(scaled.ends, (2, 2)) - self.offset
        self.is_cut = bool(np.isfinite(scaled.ends).any())
        self.height = height
        self.size_wh = (int(width + 2 * margin) + 1, int(height + 2 * margin) + 1)
        self.subpixels = max(1, round(height_px / SUBPIXEL_HEIGHT))
        self.direction_px = DIRECTION_OF_HEIGHT * height
        self._lay()

    def _lay(self) -> None:
        self.features = np.hstack([self.points, self.direction_px * self.normals])
        self.table = Table(self.features)

    def inset(self, offset: float) -> Drawing:
        """Return the drawing with its outline moved inwards by `offset` heights.

        A drawn line lies outside of the body: what a sheet's views share of that is not misfit.
        """
        other = copy.copy(self)
        other.points = self.points - offset * self.height * self.normals
        other._lay()
        return other

    def unstretched(self, taller: float) -> Drawing:
        """Return the outline of a drawing whose height over width is e^`taller` times too large.

        Areas and the middle of the working picture stay.
        """
        other = copy.copy(self)
        by = np.exp(np.array([taller, -taller]) / 2)
        middle = np.array(self.size_wh) / 2
        other.points = middle + (self.points - middle) * by
        normals = self.normals / by
        other.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        other.low, other.high = (middle + (end - middle) * by for end in (self.low, self.high))
        other._lay()
        return other

    def shows(self, pixels: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Return which pixels the drawing says something of: none beyond a cut."""
        return ((pixels > self.low) & (pixels < self.high)).all(axis=1)

    def pose_in(self, pose: Pose) -> Pose:
        """Return a full-size pose in working pixels."""
        scaled = pose.scaled(self.factor)
        return replace(scaled, shift=scaled.shift - self.offset)

    def pose_out(self, pose: Pose) -> Pose:
        """Return a working pose in full-size pixels."""
        return replace(pose, shift=pose.shift + self.offset).scaled(1 / self.factor)


def match(drawing: Drawing, surface: Surface, pose: Pose) -> Matches:
    """Return two-sided nearest neighbours of occluding contour and drawing at a pose."""
    spacing = max(1.0, drawing.height / 128)
    occluding = occluding_contour_at(surface, pose, drawing.size_wh, spacing, drawing.subpixels)
    if drawing.is_cut:
        shown = drawing.shows(project(pose, occluding.points))
        occluding = OccludingContour(occluding.points[shown], occluding.normals[shown])
    if len(occluding.points) == 0:  # nothing in the picture: far off, every residual is at its cap
        far = np.full(len(drawing.points), drawing.height)
        zeros = np.zeros((len(far), 3))
        everything = np.arange(len(far))
        return Matches(zeros, drawing.points, drawing.normals, far, len(far), everything)
    occluding = _thinned(occluding, len(drawing.points))
    seen = np.hstack([project(pose, occluding.points), drawing.direction_px * occluding.normals])
    table = Table(seen)
    to_occluding, to_drawn = nearest(drawing.table, table), nearest(table, drawing.table)
    off = np.concatenate([drawing.features - seen[to_occluding], seen - drawing.features[to_drawn]])
    target = np.concatenate([np.arange(len(drawing.points)), to_drawn])
    # where the picture's edge cuts the figure, nothing is met: as good as infinitely far
    distances = np.where(drawing.free[target], np.sqrt((off**2).sum(axis=1)), FAR * drawing.height)
    return Matches(
        np.concatenate([occluding.points[to_occluding], occluding.points]),
        np.concatenate([drawing.points, drawing.points[to_drawn]]),
        np.concatenate([drawing.normals, drawing.normals[to_drawn]]),
        distances,
        len(drawing.points),
        target,
    )


def nearest(asking: Table, asked: Table) -> Int[np.ndarray, " n"]:
    """Return for every point of `asking` the nearest point of `asked`.

    |a - b|^2 / 2 = |a|^2 / 2 + (-a b + |b|^2 / 2), the bracket as a matrix product: for some
    hundred points faster than building and asking a search tree.
    """
    blocks = range(0, len(asking.rows), BLOCK)
    with np.errstate(invalid="ignore"):  # some BLAS raise the flag beside the result
        return np.concatenate(
            [(asking.rows[i : i + BLOCK] @ asked.columns).argmin(axis=1) for i in blocks]
        )


def _thinned(occluding: OccludingContour, wanted: int) -> OccludingContour:
    every = max(1, len(occluding.points) // max(wanted, 1))
    return OccludingContour(occluding.points[::every], occluding.normals[::every])
