"""Fill holes that the drawing from the other side contradicts: paint in the paper's colour.

One drawing cannot always tell a gap between arm and body from a white buckle on white paper; the
splitter assumes (`toonset.dataset.split.holes`). Once cameras are known, a second drawing can tell:
what is open towards one side is open towards the other. A hole is filled if a drawing from about
the opposite side shows paint there, in another colour than paper, and round that place no patch of
paper that could be the same gap.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.calib.result import ViewCalibration
from toonset.camera import Camera
from toonset.dataset.bundle.calibration_schema import FilledHole
from toonset.dataset.split.background import difference
from toonset.dataset.split.holes import CLEAR, LEAST_HOLE_PX
from toonset.raster import dilate, parts, sized_parts
from toonset.view import Box, View

Rgb = tuple[int, int, int]

OPPOSITE_DEG = 35.0  # from looking against each other: two views from 17 degrees above
ROUND = 0.02  # of the figure's height: what is drawn off by less is still the same hole
BESIDE = 0.05  # of the figure's height: the body is as deep here as it is behind the hole
EDGE_PX = 3  # of a hole, mixed with paper
MOST_PAPER = 0.1  # of what lies behind: lines and lights in the paper's colour
MOST_PLACES = 400  # pixels of a hole that are looked along
DEPTHS = 9  # places along each of their rays


def fill_false_holes(
    views: Sequence[View],
    found: Sequence[ViewCalibration],
    vertices: Float[np.ndarray, "vertices 3"],
) -> tuple[tuple[View, ...], tuple[FilledHole, ...]]:
    """Fill the holes that another drawing contradicts; return the drawings and those holes.

    Args:
        views: the drawings, as cut out; where the paper behind one is not known, nothing is filled
            in it, and it cannot contradict.
        found: their cameras; drawings without a usable one have no say.
        vertices: of the mannequin: how deep the body is.
    """
    known = [
        (view, fit.camera, view.paper)
        for view, fit in zip(views, found, strict=True)
        if view.paper is not None and fit.verdict != "failed"
    ]
    painted = {view.name: _painted(view, paper) for view, _, paper in known}
    result, filled = {view.name: view for view in views}, []
    for view, camera, paper in known:
        others = [(v.name, c) for v, c, _ in known if _opposite(camera, c)]
        for hole in _holes(view):
            points = _behind(hole, camera, vertices, view.figure_box[3])
            by = next((n for n, c in others if _is_closed(points, c, painted[n])), None)
            if by is None:
                continue
            result[view.name] = _with_paper(result[view.name], hole, paper)
            filled.append(FilledHole(view.name, _box(hole), by))
    return tuple(result[view.name] for view in views), tuple(filled)


def _holes(view: View) -> Iterator[Bool[np.ndarray, "height width"]]:
    """Yield the see-through patches that the figure encloses."""
    enclosed = ~view.mask & ~_outside(view)
    labels, areas = sized_parts(enclosed, connectivity=4)
    for number in range(1, len(areas)):
        if areas[number] >= LEAST_HOLE_PX:
            yield labels == number


def _opposite(camera: Camera, other: Camera) -> bool:
    return float(camera.rotation[2] @ other.rotation[2]) <= -math.cos(math.radians(OPPOSITE_DEG))


def _behind(
    hole: Bool[np.ndarray, "height width"],
    camera: Camera,
    vertices: Float[np.ndarray, "vertices 3"],
    height_px: int,
) -> Float[np.ndarray, "places depths 3"]:
    """Return the world points that a hole would leave empty, as deep as the body is beside it."""
    rows, columns = np.nonzero(hole)
    every = -(-len(rows) // MOST_PLACES)
    pixels = np.stack([columns, rows], axis=1)[::every] + 0.5
    at, depth, in_front = camera.project(vertices)
    middle, reach = pixels.mean(axis=0), np.ptp(pixels, axis=0).max() / 2 + BESIDE * height_px
    near = in_front & (np.linalg.norm(at - middle, axis=1) <= reach)
    depth = depth[near] if near.any() else depth[in_front]
    along = np.linspace(depth.min(), depth.max(), DEPTHS)
    return camera.unproject(
        np.broadcast_to(pixels[:, None], (len(pixels), DEPTHS, 2)),
        np.broadcast_to(along, (len(pixels), DEPTHS)),
    )


@dataclass(frozen=True, eq=False)
class _Painted:
    """Masks of a drawing's paint, and of its paint in the paper's colour."""

    solid: Bool[np.ndarray, "height width"]
    paper: Bool[np.ndarray, "height width"]
    reach_px: int


def _painted(view: View, paper: Rgb) -> _Painted:
    rgb = view.rgba[..., :3]
    apart = difference(rgb, np.broadcast_to(np.array(paper, np.uint8), rgb.shape))
    reach = max(1, round(ROUND * view.figure_box[3]))
    return _Painted(view.mask, view.mask & (apart < CLEAR), reach)


def _is_closed(
    points: Float[np.ndarray, "places depths 3"], camera: Camera, painted: _Painted
) -> bool:
    """Return whether a drawing shows paint, and other colours than paper, where the points are."""
    pixels, _, in_front = camera.project(points.reshape(-1, 3))
    height, width = painted.solid.shape
    if not in_front.all():
        return False
    at = np.floor(pixels).astype(int)
    if (at < 0).any() or (at >= (width, height)).any():
        return False
    region = np.zeros((height, width), np.uint8)
    region[at[:, 1], at[:, 0]] = 1
    size = 2 * painted.reach_px + 1
    shape = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    around = cv2.dilate(region, shape) > 0
    if not painted.solid[around].all() or painted.paper[region > 0].mean() > MOST_PAPER:
        return False
    labels, areas = sized_parts(painted.paper)
    inside = np.bincount(labels[around], minlength=len(areas))
    gaps = (areas >= LEAST_HOLE_PX) & (inside >= areas / 2)
    return not gaps[1:].any()  # the first is all that is not paper


def _with_paper(view: View, hole: Bool[np.ndarray, "height width"], paper: Rgb) -> View:
    """Return the view with paper's colour in a hole, and laid under its mixed edge."""
    share = view.rgba[..., 3:].astype(np.float64) / 255
    under: UInt8[np.ndarray, "height width 3"] = np.rint(
        share * view.rgba[..., :3] + (1 - share) * np.array(paper)
    ).astype(np.uint8)
    opaque = np.dstack([under, np.full(hole.shape, 255, np.uint8)])
    inside = hole | (dilate(hole, EDGE_PX) & ~dilate(_outside(view), EDGE_PX))
    return replace(view, rgba=np.where(inside[..., None], opaque, view.rgba))


def _outside(view: View) -> Bool[np.ndarray, "height width"]:
    empty = np.pad(~view.mask, 1, constant_values=True)
    labels = parts(empty, connectivity=4)
    return np.asarray(labels[1:-1, 1:-1] == labels[0, 0])


def _box(hole: Bool[np.ndarray, "height width"]) -> Box:
    rows, columns = (np.flatnonzero(hole.any(axis=axis)) for axis in (1, 0))
    x, y = int(columns[0]), int(rows[0])
    return x, y, int(columns[-1]) - x + 1, int(rows[-1]) - y + 1
