"""Store a mannequin's surface in a run, and rasterise it for a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt16

from toonset.camera import Camera
from toonset.dataset.mesh.rasterize import depth_and_normals, depth_map
from toonset.errors import MeshError
from toonset.mesh import Mesh
from toonset.raster import distance_to, nearest

FINER = 3  # samples per pixel and axis: outlines and steps in depth lie between pixels
GRID_PX = 0.25  # of the drawings: what is nearer is one vertex
MOST_FACES = 40_000  # of finer meshes, vertices in one cell become one, in cells COARSER each time
COARSER = 1.3
MOST_STEPS = 65_000  # of the grid, along an axis
BESIDE_PX = 2  # pixels of room round what is seen


@dataclass(frozen=True, eq=False)
class ShapeView:
    """A camera's picture of a shape.

    Attributes:
        camera: that looks.
        alpha: (height, width) share of every pixel that is covered.
        depth: (height, width) past the camera's target at the pixels' centres, nan beside it.
        fine: (FINER height, FINER width) the same at FINER x FINER places of every pixel.
        normal: (height, width, 3) of the faces seen, in camera axes, towards the viewer; 0 beside
            the shape, and everywhere unless asked for.
    """

    camera: Camera
    alpha: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]
    fine: Float[np.ndarray, "rows columns"]
    normal: Float[np.ndarray, "height width 3"]


@dataclass(frozen=True, eq=False)
class Shape:
    """A triangle surface whose vertices lie on a grid.

    Attributes:
        low: (3,) world place of the grid's first corner.
        step: of the grid, world units.
        places: (v, 3) of the vertices, in steps.
        faces: (f, 3) vertices of every triangle.
        beyond: world units by which outlines are drawn outside of it.
    """

    low: Float[np.ndarray, " 3"]
    step: float
    places: UInt16[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]
    beyond: float = 0.0

    @cached_property
    def vertices(self) -> Float[np.ndarray, "v 3"]:
        """Return the vertices in the world."""
        return self.low + self.step * self.places.astype(np.float64)

    def box(self, camera: Camera) -> tuple[slice, slice] | None:
        """Return the rows and columns of a picture in which the shape may be; None: nowhere."""
        pixels, _, front = camera.project(self.vertices)
        if not front.any():
            return None
        room = BESIDE_PX + self.beyond * camera.scale
        sides = []
        for axis, size in ((1, camera.size_wh[1]), (0, camera.size_wh[0])):
            along = pixels[front, axis]
            first = max(0, int(np.floor(along.min() - room)))
            last = min(size, int(np.ceil(along.max() + room)))
            if last <= first:
                return None
            sides.append(slice(first, last))
        return sides[0], sides[1]

    def seen(self, camera: Camera, *, normals: bool = False) -> ShapeView:
        """Rasterise the shape for a camera; with `normals`, its faces' normals, too."""
        width, height = camera.size_wh
        depth = depth_map(self.vertices, self.faces, camera.resized(FINER))
        fine = _grown(
            np.where(np.isfinite(depth), depth, np.nan), self.beyond * camera.scale * FINER
        )
        hit = np.isfinite(fine).astype(np.float32)
        cover = cv2.resize(hit, (width, height), interpolation=cv2.INTER_AREA)
        middle = slice(FINER // 2, None, FINER)
        normal = np.zeros((height, width, 3), dtype=np.float32)
        if normals:
            _, normal = depth_and_normals(self.vertices, self.faces, camera)
            there = (normal != 0).any(axis=-1)
            if self.beyond and there.any():
                normal = np.where((cover > 0)[..., None], normal[nearest(there)], 0)
        return ShapeView(camera, cover, fine[middle, middle], fine, normal)


def shape_of(mesh: Mesh, cameras: Sequence[Camera]) -> Shape:
    """Return the part of a mannequin that lies in some drawing's picture.

    What lies beyond all of them was never drawn.

    Raises:
        MeshError: nothing of it lies in any picture.
    """
    faces = mesh.faces[_within(mesh, cameras)]
    if not len(faces):
        raise MeshError(
            f"{mesh.name}: lies in none of the pictures; it belongs to other cameras, train with "
            "--no-mannequin or put the right one there"
        )
    used, index = np.unique(faces, return_inverse=True)
    vertices, faces = mesh.vertices[used], index.reshape(-1, 3)
    low, extent = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    step = max(GRID_PX / max(camera.scale for camera in cameras), extent / MOST_STEPS)
    cell = step
    while True:
        group = _numbers(np.rint((vertices - low) / cell))
        places, number = _means((vertices - low) / step, group)
        found = _distinct(number[faces])
        if not len(found):
            raise MeshError(
                f"{mesh.name}: is smaller than a pixel in every picture; give one in the cameras' "
                "units, or train with --no-mannequin"
            )
        if len(found) <= MOST_FACES and len(places) <= MOST_STEPS:
            return Shape(low, step, places, found)
        cell *= COARSER


def _numbers(cells: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
    """Return one number for every cell, the same for points in one."""
    x, y, z = cells.astype(np.int64).T
    side = int(cells.max()) + 1
    return (x * side + y) * side + z


def _means(
    points: Float[np.ndarray, "n 3"], group: Int[np.ndarray, " n"]
) -> tuple[UInt16[np.ndarray, "m 3"], Int[np.ndarray, " n"]]:
    """Return the middle of every group of points, in whole numbers, and each point's group."""
    _, number, count = np.unique(group, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(number, axis) for axis in points.T], axis=1)
    return np.rint(sums / count[:, None]).astype(np.uint16), number


def _grown(
    depth: Float[np.ndarray, "rows columns"], by_px: float
) -> Float[np.ndarray, "rows columns"]:
    """Return depth continued over so many pixels beside the figure."""
    if by_px <= 0 or not np.isfinite(depth).any():
        return depth
    there = np.isfinite(depth)
    return np.where(distance_to(there) <= by_px, depth[nearest(there)], np.nan)


def _within(mesh: Mesh, cameras: Sequence[Camera]) -> Bool[np.ndarray, " faces"]:
    """Return the faces whose box in some picture meets it."""
    inside = np.zeros(len(mesh.faces), dtype=bool)
    for camera in cameras:
        pixels, _, front = camera.project(mesh.vertices)
        there = front[mesh.faces, None]
        least = np.where(there, pixels[mesh.faces], np.inf).min(axis=1)
        most = np.where(there, pixels[mesh.faces], -np.inf).max(axis=1)
        inside |= ((most >= 0) & (least <= np.array(camera.size_wh))).all(axis=1)
    return inside


def _distinct(faces: Int[np.ndarray, "f 3"]) -> Int[np.ndarray, "g 3"]:
    """Return the triangles with three corners, each once."""
    ordered = np.sort(faces, axis=1)
    whole = (np.diff(ordered, axis=1) > 0).all(axis=1)
    _, first = np.unique(ordered[whole], axis=0, return_index=True)
    return faces[whole][np.sort(first)]
