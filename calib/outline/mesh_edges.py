"""Prepare a mesh for outlines: its edges, the faces at them and the faces' planes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.errors import MeshError
from toonset.mesh import Mesh

MOST_FOLDS = 1000  # heights; bodies have up to 31 of them, hair of loose ribbons a few hundred


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh prepared for outlines.

    Attributes:
        vertices: (n, 3), shifted so that the middle of the bounding box is the origin.
        faces: (m, 3) int32.
        edges: (e, 2) vertex indices of every edge; an edge of more than two faces is repeated.
        edge_faces: (2, e) the faces at an edge, the same face twice where there is only one.
        edge_senses: (2, e) +1 where that face runs from the edge's first vertex to its second, -1
            where it runs back, 0 for the repetition of a single face.
        middle: (3,) world coordinates of the origin.
        height: world units along +Y.
        radius: farthest vertex from the origin.
    """

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    edges: Int[np.ndarray, "edges 2"]
    edge_faces: Int[np.ndarray, "2 edges"]
    edge_senses: Int[np.ndarray, "2 edges"]
    middle: Float[np.ndarray, " 3"]
    height: float
    radius: float

    @cached_property
    def planes(self) -> Float[np.ndarray, "faces 4"]:
        """Return every face's normal, as long as the face is large, and its product with a corner.

        A property, since the same edges serve other vertices (`dataclasses.replace`).
        """
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        return np.hstack([normals, (normals * a).sum(axis=1, keepdims=True)])


def prepare_surface(mesh: Mesh) -> Surface:
    """Return the mesh with its edges and their faces.

    Raises:
        MeshError: it is a heap of triangles, whose edges are all outlines.
    """
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    edges, edge_faces, edge_senses = _edges(faces)
    surface = Surface(
        mesh.vertices - mesh.middle,
        faces,
        edges,
        edge_faces,
        edge_senses,
        mesh.middle,
        mesh.height,
        mesh.radius,
    )
    length = max(_fold_length(surface, axis) for axis in (0, 2)) / mesh.height
    if length > MOST_FOLDS:
        raise MeshError(
            f"{mesh.path or mesh.name}: folds {length:.0f} times as long as it is high, at most "
            f"{MOST_FOLDS}: a heap of triangles; export a surface whose faces join at their edges"
        )
    return surface


def folds_of(
    surface: Surface, turned: Bool[np.ndarray, " faces"]
) -> tuple[Int[np.ndarray, " folds"], Int[np.ndarray, " folds"]]:
    """Return the edges that are folds or borders in an image, and `covered`'s layers there.

    Args:
        surface: the mesh.
        turned: which faces run clockwise in the image.
    """
    side = turned.astype(np.int8) * np.int8(2) - np.int8(1)
    first, second = side[surface.edge_faces] * surface.edge_senses
    layers = first + second
    folds = np.flatnonzero(layers)
    return folds, layers[folds]


def _fold_length(surface: Surface, axis: int) -> float:
    """Return how long all folds are in the picture along an axis, world units."""
    folds, _ = folds_of(surface, surface.planes[:, axis] > 0)
    ends = np.delete(surface.vertices[surface.edges[folds]], axis, axis=2)
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def _edges(
    faces: Int[np.ndarray, "faces 3"],
) -> tuple[Int[np.ndarray, "e 2"], Int[np.ndarray, "2 e"], Int[np.ndarray, "2 e"]]:
    """Return edges, their faces and senses; the faces of an edge are taken two by two."""
    corners = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    keys = np.sort(corners, axis=1)
    order = np.lexsort((keys[:, 1], keys[:, 0]))
    sense = np.where(corners[:, 0] < corners[:, 1], 1, -1).astype(np.int8)[order]
    owner = np.tile(np.arange(len(faces)), 3)[order]
    keys = keys[order]
    fresh = np.concatenate([[True], (np.diff(keys, axis=0) != 0).any(axis=1)])
    place = np.arange(len(keys))
    first = np.flatnonzero((place - np.maximum.accumulate(np.where(fresh, place, 0))) % 2 == 0)
    second = np.minimum(first + 1, len(keys) - 1)
    paired = (second > first) & ~fresh[second]
    second = np.where(paired, second, first)
    edge_faces = np.stack([owner[first], owner[second]])
    senses = np.stack([sense[first], np.where(paired, sense[second], 0)])
    return keys[first].astype(np.intp), edge_faces, senses.astype(np.int8)
