"""Hold a signed distance on a grid of voxels: f < 0 inside, in pixels of the working drawings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Float
from scipy import ndimage

from toonset.nerf.sections.drawing import TALL, Drawing, Picture, Pixels

VOXEL_PX = 2.4
MARGIN_PX = 0.04 * TALL  # round what the drawings span
ACROSS = 0.8  # cosine: drawings that span an axis look across it
SURE_VOXELS = 1.6  # within which a distance is f over its slope, beyond, counted in voxels
LEAST_SLOPE = 0.4
NEAR_PX = 12  # of a figure: rays beyond are not looked at
BACKGROUND_PX = 30.0  # what is said of them
PARALLEL = 1e-9  # to a side of the grid
EVERY = 2  # pixels, in rows and columns, between a silhouette's rays

Volume = Float[np.ndarray, "x y z"]
Points = Float[np.ndarray, "*n 3"]


@dataclass(frozen=True, eq=False)
class Grid:
    """Cubic voxels along the world's axes.

    Attributes:
        low: (3,) world position of the lowest corner.
        per_px: world units per pixel of the working drawings.
        shape: voxels along x, y, z.
    """

    low: Float[np.ndarray, " 3"]
    per_px: float
    shape: tuple[int, int, int]

    @property
    def voxel(self) -> float:
        """Return a voxel's edge, world units."""
        return VOXEL_PX * self.per_px

    @property
    def middle(self) -> Float[np.ndarray, " 3"]:
        """Return the middle of the grid."""
        return self.low + self.voxel * np.array(self.shape) / 2

    @cached_property
    def centres(self) -> Float[np.ndarray, "n 3"]:
        """Return the voxels' centres in the world, in the order of a flat volume."""
        axes = [
            (low + self.voxel * (np.arange(n) + 0.5)).astype(np.float32)
            for low, n in zip(self.low, self.shape, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def index(self, points_world: Points) -> Points:
        """Return points in voxels from the first voxel's centre."""
        low = (self.low + self.voxel / 2).astype(np.float32)
        return (points_world - low) * np.float32(1 / self.voxel)

    def at(self, volume: Volume, points_world: Points) -> Float[np.ndarray, " *n"]:
        """Return a volume's values at points, trilinear; beyond its edge, the edge's."""
        places = self.index(points_world).reshape(-1, 3).T
        values = ndimage.map_coordinates(volume, places, order=1, mode="nearest")
        return values.reshape(points_world.shape[:-1])

    def along(self, drawing: Drawing, pixels: Pixels) -> Float[np.ndarray, "n steps 3"]:
        """Return points about a voxel apart on the rays through pixels, within the grid."""
        origins, ways = drawing.camera.rays(pixels)
        high = self.low + self.voxel * np.array(self.shape)
        steep = np.where(np.abs(ways) < PARALLEL, PARALLEL, ways)
        bounds = [(edge - origins) / steep for edge in (self.low, high)]
        near, far = np.minimum(*bounds).max(axis=1), np.maximum(*bounds).min(axis=1)
        near, far = np.where(far > near, (near, far), 0.0)  # a miss stays beside the grid
        steps = int(np.ceil((far - near).max() / self.voxel)) + 1
        along = near[:, None] + (far - near)[:, None] * (np.arange(steps) + 0.5) / steps
        points = origins[:, None] + along[..., None] * ways[:, None]
        return points.astype(np.float32)


def grid_of(drawings: Sequence[Drawing], per_px: float) -> Grid:
    """Return the grid that holds what the drawings span."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for drawing in drawings:
        for axis, ends in _spans(drawing):
            low[axis], high[axis] = min(low[axis], ends[0]), max(high[axis], ends[1])
    for axis, other in ((0, 2), (2, 0)):  # seen from one direction only: as deep as wide
        if not np.isfinite(low[axis]):
            middle = np.mean([drawing.camera.target[axis] for drawing in drawings])
            half = (high[other] - low[other]) / 2
            if not np.isfinite(half):  # diagonals only: a square that stands on its corner
                half = max(_widest(drawing) for drawing in drawings) / math.sqrt(2)
            low[axis], high[axis] = middle - half, middle + half
    low, high = low - MARGIN_PX * per_px, high + MARGIN_PX * per_px
    counts = np.ceil((high - low) / (VOXEL_PX * per_px)).astype(int).tolist()
    return Grid(low, per_px, (counts[0], counts[1], counts[2]))


def _widest(drawing: Drawing) -> float:
    """Return how wide a drawing's figure is, world units."""
    drawn = np.flatnonzero(drawing.mask.any(axis=0))
    return float(drawn[-1] + 1 - drawn[0]) / float(drawing.camera.scale_uv[0])


def _spans(drawing: Drawing) -> list[tuple[int, tuple[float, float]]]:
    """Return the axes that a drawing looks across, and what its figure spans of each."""
    camera, mask = drawing.camera, drawing.mask
    found = []
    for axis, direction, place in ((0, 0, 0), (1, 1, 1), (2, 0, 0)):
        turn = camera.rotation[direction, axis]
        if abs(turn) < ACROSS:
            continue
        drawn = np.flatnonzero(mask.any(axis=place))
        ends = np.array([drawn[0], drawn[-1] + 1]) - camera.center[place]
        ends = camera.target[axis] + ends / camera.scale_uv[place] / turn
        found.append((axis, (float(ends.min()), float(ends.max()))))
    return found


def distance_again(f: Volume) -> Volume:
    """Return the signed distance of f's zero set, px."""
    inside = f < 0
    if inside.all() or not inside.any():
        return f
    outer, inner = (np.asarray(ndimage.distance_transform_edt(part)) for part in (~inside, inside))
    counted = np.where(inside, 0.5 - inner, outer - 0.5) * VOXEL_PX
    slope = np.sqrt(sum(np.square(part) for part in np.gradient(f, VOXEL_PX)))
    most = SURE_VOXELS * VOXEL_PX
    sure = (f / np.maximum(slope, LEAST_SLOPE)).clip(-most, most)
    return np.where(np.abs(counted) < most, sure, counted).astype(np.float32)


def blurred(f: Volume, voxels: float, most_px: float = NEAR_PX) -> Volume:
    """Return f with its surface smoothed."""
    return ndimage.gaussian_filter(f.clip(-most_px, most_px), voxels)


def silhouette(grid: Grid, f: Volume, drawing: Drawing) -> Picture:
    """Return the lowest f along every pixel's ray, looked at in every EVERY-th row and column."""
    height, width = drawing.mask.shape
    size = 2 * NEAR_PX + 1
    near = cv2.dilate(drawing.mask.astype(np.uint8), np.ones((size, size), np.uint8))
    rows, columns = np.nonzero(near[::EVERY, ::EVERY])
    pixels = (np.stack([columns, rows], axis=-1) + 0.5) * EVERY  # the small picture's centres
    small = np.full((-(-height // EVERY), -(-width // EVERY)), BACKGROUND_PX, np.float32)
    small[rows, columns] = grid.at(f, grid.along(drawing, pixels)).min(axis=1)
    return cv2.resize(small, None, fx=EVERY, fy=EVERY)[:height, :width]


@dataclass(frozen=True, eq=False)
class Solid:
    """A body on a grid.

    Attributes:
        grid: where its voxels lie.
        f: (x, y, z) signed distance, px; exact beside the surface only.
    """

    grid: Grid
    f: Volume
