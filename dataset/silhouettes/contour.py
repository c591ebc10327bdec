"""Extract the drawn outline: sub-pixel contour points with outward normals.

The contour is the 0.5 level of the view's alpha (marching squares), holes included, resampled at
even spacing. Coordinates are pixels of the view, first pixel's centre at (0.5, 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float
from skimage.measure import find_contours

from toonset.errors import SheetError
from toonset.view import NO_ENDS, Ends, View

MIN_LOOP_OF_HEIGHT = 0.04  # shorter closed loops are pinholes of the matting, not outline
EDGE_PX = 0.75  # from the picture's edge: smoothing pulls an outline's corners off it
CUT_OF_HEIGHT = 0.12  # a longer contact with the picture's edge is a cut
SMOOTHING_PX = 0.7  # of alpha: a hard mask's staircase becomes a line, corners move < 0.2 px


@dataclass(frozen=True, eq=False)
class Contour:
    """A drawn outline.

    Attributes:
        points: (n, 2) pixels, at even spacing along each loop.
        normals: (n, 2) unit, pointing out of the figure.
        box: (left, top, width, height) of the figure in pixels.
        height_px: the figure's extent in v.
        free: (n,) whether a point is outline; not where the figure is cut.
        ends: lines where it is, see `View`; the picture's edges among them.
    """

    points: Float[np.ndarray, "n 2"]
    normals: Float[np.ndarray, "n 2"]
    box: tuple[float, float, float, float]
    height_px: float
    free: Bool[np.ndarray, " n"]
    ends: Ends = NO_ENDS

    def scaled(self, factor: float) -> Contour:
        """Return the contour of the drawing scaled by `factor`."""
        left, top, width, height = (factor * value for value in self.box)
        a, b, c, d = self.ends
        return Contour(
            self.points * factor,
            self.normals,
            (left, top, width, height),
            self.height_px * factor,
            self.free,
            (factor * a, factor * b, factor * c, factor * d),
        )


def drawn_contour(view: View, spacing_of_height: float = 1 / 256) -> Contour:
    """Return the outline of a view.

    Args:
        view: the drawing.
        spacing_of_height: distance between neighbouring points over the figure's height.

    Raises:
        SheetError: the drawing is too thin or faint to have an outline.
    """
    alpha = np.pad(view.rgba[..., 3].astype(np.float32) / 255, 2)
    alpha = cv2.GaussianBlur(alpha, (0, 0), SMOOTHING_PX)
    loops = find_contours(alpha, 0.5, positive_orientation="high")
    if not loops:
        raise SheetError(f"view {view.name}: too thin or faint for an outline; draw it larger")
    xy = [loop[:, ::-1] - 2 + 0.5 for loop in loops]  # unpad; sample (0, 0) is pixel centre .5
    everything = np.concatenate(xy)
    left, top = everything.min(axis=0)
    width, height = np.ptp(everything, axis=0)
    shortest = MIN_LOOP_OF_HEIGHT * height
    spacing = max(spacing_of_height * height, 0.5)
    sampled = [_resample(loop, spacing) for loop in xy if _length(loop) >= shortest]
    points = np.concatenate([points for points, _ in sampled])
    normals = np.concatenate([normals for _, normals in sampled])
    box = (float(left), float(top), float(width), float(height))
    cut = np.concatenate([_is_cut(p, view.rgba.shape, height) for p, _ in sampled])
    ends = _with_edges(view.ends, points[cut], view.rgba.shape)
    at_end = np.abs(points[:, [0, 1, 0, 1]] - ends) < EDGE_PX
    free: Bool[np.ndarray, " n"] = ~np.any(at_end, axis=1)
    return Contour(points, normals, box, float(height), free, ends)


def _is_cut(
    loop: Float[np.ndarray, "n 2"], shape: tuple[int, ...], height: float
) -> Bool[np.ndarray, " n"]:
    """Return which points of an evenly sampled loop are the picture's edge, not outline.

    Short contacts with the edge are those of a closely cropped figure.
    """
    edge = np.array([shape[1], shape[0]])
    at_edge = ((loop < EDGE_PX) | (loop > edge - EDGE_PX)).any(axis=1)
    if not at_edge.any() or at_edge.all():
        return np.zeros(len(loop), dtype=bool)
    start = int(np.flatnonzero(~at_edge)[0])
    rolled = np.roll(at_edge, -start)
    changes = np.flatnonzero(np.diff(np.concatenate([[0], rolled.astype(np.int8), [0]])))
    spacing = np.linalg.norm(loop[1] - loop[0])
    for first, last in zip(changes[::2], changes[1::2], strict=True):
        if (last - first) * spacing < CUT_OF_HEIGHT * height:
            rolled[first:last] = False
    return np.roll(rolled, start)


def _with_edges(ends: Ends, cut: Float[np.ndarray, "n 2"], shape: tuple[int, ...]) -> Ends:
    """Return `ends` with the picture's edges at which the points `cut` lie."""
    (left, top, right, bottom), (u, v), (height, width) = ends, cut.T, shape[:2]
    return (
        0.0 if (u < EDGE_PX).any() else left,
        0.0 if (v < EDGE_PX).any() else top,
        float(width) if (u > width - EDGE_PX).any() else right,
        float(height) if (v > height - EDGE_PX).any() else bottom,
    )


def _length(loop: Float[np.ndarray, "n 2"]) -> float:
    return float(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum())


def _resample(
    loop: Float[np.ndarray, "n 2"], spacing: float
) -> tuple[Float[np.ndarray, "m 2"], Float[np.ndarray, "m 2"]]:
    """Return even samples of a closed loop and the normals to the right of its direction.

    `find_contours` with "high" winds so that the figure is on the left in (x right, y down) array
    order, hence the outward normal of direction (dx, dy) is (-dy, dx) rotated to the free side.
    """
    steps = np.linalg.norm(np.diff(loop, axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    count = max(8, round(arc[-1] / spacing))
    at = (np.arange(count) + 0.5) * arc[-1] / count
    points = np.stack([np.interp(at, arc, loop[:, i]) for i in (0, 1)], axis=1)
    tangent = np.roll(points, -2, axis=0) - np.roll(points, 2, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    return points, np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
