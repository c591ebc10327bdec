"""Leave out what a character stands on or in front of: floors and backdrops.

A drawing shows the figure alone, and a camera that fits an outline with the scene's floor is wrong
by degrees. What is flat and wider than the rest is tall is no part of a figure: a floor lies under
all of the rest, a backdrop stands beside all of it. Smaller pedestals stay.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.dataset.mesh.raw_triangles import listed
from toonset.mesh import Mesh

FLAT = 0.1  # of its width: a slab may be so thick
LARGE = 0.5  # of the mesh's largest extent: less is never wider than the rest is tall
ASIDE = 0.05  # of the rest's height: feet sink so far into a floor
LEVEL, UPRIGHT = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))  # of a normal's height
LEAST_REST = 0.1  # of a backdrop's height: a smaller rest is not what stands before it


def without_surroundings(mesh: Mesh) -> Mesh:
    """Return the mesh without floors and backdrops; what was left out is remarked."""
    sheets = [] if _has_no_room(mesh) else [sheet for sheet in _sheets(mesh) if sheet.is_flat]
    rest = np.ones(len(mesh.faces), dtype=bool)
    for sheet in sheets:
        rest &= ~sheet.faces
    if not sheets or not rest.any():
        return mesh
    body = mesh.vertices[np.unique(mesh.faces[rest])]
    found = [sheet for sheet in sheets if sheet.is_round(body)]
    if not found:
        return mesh
    kept = np.ones(len(mesh.faces), dtype=bool)
    for sheet in found:
        kept &= ~sheet.faces
    names = listed(list(dict.fromkeys(sheet.name for sheet in found)))
    said = f"left out {names}: flat, and wider than the rest is tall"
    smaller = _only(mesh, kept)
    return replace(smaller, remarks=(*mesh.remarks, f"{mesh.name}: {said}"))


@dataclass(frozen=True, eq=False)
class _Sheet:
    """A connected piece, or a part, of a mesh.

    Attributes:
        name: for people.
        faces: those of it.
        points: its vertices.
    """

    name: str
    faces: Bool[np.ndarray, " faces"]
    points: Float[np.ndarray, "points 3"]

    @cached_property
    def _axes(self) -> Float[np.ndarray, "3 3"]:
        """Return its principal axes, the thinnest last."""
        shifted = self.points - self.points.mean(axis=0)
        return np.asarray(np.linalg.eigh(shifted.T @ shifted)[1].T[::-1])

    @cached_property
    def _extents(self) -> Float[np.ndarray, " 3"]:
        return np.asarray(np.ptp(self.points @ self._axes.T, axis=0))

    @property
    def is_flat(self) -> bool:
        """Return whether it is a level or upright sheet."""
        tilt = abs(float(self._axes[2, 1]))
        flat = self._extents[2] <= FLAT * self._extents[:2].min()
        return bool(flat and (tilt >= LEVEL or tilt <= UPRIGHT))

    def is_round(self, body: Float[np.ndarray, "points 3"]) -> bool:
        """Return whether the body stands on it or before it, and is not as tall as it is wide."""
        low, high = body.min(axis=0), body.max(axis=0)
        tall = high[1] - low[1]
        if self._extents[:2].min() <= tall:
            return False
        room = ASIDE * tall
        if abs(self._axes[2, 1]) >= LEVEL:
            return bool(self.points[:, 1].max() <= low[1] + room)
        if tall < LEAST_REST * np.ptp(self.points[:, 1]):
            return False
        along, own = body @ self._axes[2], self.points @ self._axes[2]
        return bool(own.max() <= along.min() + room or own.min() >= along.max() - room)


def _has_no_room(mesh: Mesh) -> bool:
    """Return whether the mesh is too narrow for a sheet as wide as its body is tall.

    A floor adds to both widths and nothing to the height, a backdrop to one width and the height.
    """
    widths = np.ptp(mesh.vertices, axis=0)
    return bool(max(widths[0], widths[2]) < LARGE * widths[1])


def _sheets(mesh: Mesh) -> Iterator[_Sheet]:
    """Yield the large parts of a mesh and, of each part, the large pieces."""
    widest = float(np.ptp(mesh.vertices, axis=0).max())
    pieces, part_of = connected_pieces(mesh)
    for numbers, names in ((part_of[pieces], mesh.part_names), (pieces, None)):
        groups = int(numbers.max()) + 1
        if names is not None and (groups == 1 or mesh.face_parts is None):
            continue
        low, high = _bounds(mesh, numbers, groups)
        for number in np.flatnonzero((high - low).max(axis=1) >= LARGE * widest).tolist():
            faces = numbers == number
            part = mesh.part_names[part_of[number] if names is None else number]
            own = f"a piece of {int(faces.sum())} faces" if mesh.face_parts is None else part
            yield _Sheet(own, faces, mesh.vertices[np.unique(mesh.faces[faces])])


def connected_pieces(mesh: Mesh) -> tuple[Int[np.ndarray, " faces"], Int[np.ndarray, " pieces"]]:
    """Return the connected piece of every face, and the part of every piece.

    Faces of different parts are not connected.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    parts, corners = mesh.face_parts, mesh.faces.astype(np.int64)
    if parts is not None:
        keys = parts[:, None] * len(mesh.vertices) + corners
        corners = np.unique(keys, return_inverse=True)[1].reshape(-1, 3)
    count = int(corners.max()) + 1
    ones = np.ones(2 * len(corners), dtype=np.int8)
    rows, columns = corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel()
    graph = coo_array((ones, (rows, columns)), shape=(count, count))
    of_corner = connected_components(graph, directed=False)[1]
    found, pieces = np.unique(of_corner[corners[:, 0]], return_inverse=True)
    part_of = np.zeros(len(found), dtype=np.int64)
    part_of[pieces] = 0 if parts is None else parts
    return pieces, part_of


def _bounds(
    mesh: Mesh, numbers: Int[np.ndarray, " faces"], groups: int
) -> tuple[Float[np.ndarray, "groups 3"], Float[np.ndarray, "groups 3"]]:
    """Return the lowest and highest corner of every group of faces."""
    low, high = np.full((groups, 3), np.inf), np.full((groups, 3), -np.inf)
    corners = mesh.vertices[mesh.faces]
    np.minimum.at(low, numbers, corners.min(axis=1))
    np.maximum.at(high, numbers, corners.max(axis=1))
    return low, high


def _only(mesh: Mesh, kept: Bool[np.ndarray, " faces"]) -> Mesh:
    """Return the mesh with some of its faces, and the vertices and parts that these use."""
    used, compact = np.unique(mesh.faces[kept], return_inverse=True)
    names, parts = mesh.part_names, None
    if mesh.face_parts is not None:
        numbers, parts = np.unique(mesh.face_parts[kept], return_inverse=True)
        names = tuple(mesh.part_names[number] for number in numbers)
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        faces=compact.reshape(-1, 3),
        face_colors=None if mesh.face_colors is None else mesh.face_colors[kept],
        face_parts=parts if len(names) > 1 else None,
        part_names=names,
    )
