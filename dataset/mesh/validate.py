"""What every mesh reader delivers, and the one way from there to a checked mesh."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.errors import MeshError
from toonset.mesh import Mesh

FARTHEST = 1e9  # world units; beyond, a sum of squares loses the figure
VERTICES_PER_FACE = 3  # a soup of unconnected triangles has no more


@dataclass(frozen=True, eq=False)
class Soup:
    """Triangles as a file has them: unchecked, vertices repeated.

    Attributes:
        vertices: (n, 3) world coordinates.
        faces: (m, 3) vertex indices.
        colors: (m, 3) sRGB per face, or None.
        parts: (m,) part per face, or None.
        part_names: name per part.
    """

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    colors: UInt8[np.ndarray, "faces 3"] | None = None
    parts: Int[np.ndarray, " faces"] | None = None
    part_names: tuple[str, ...] = ("body",)


def mesh_of_soup(soup: Soup, path: Path) -> Mesh:
    """Return the checked mesh: vertices at the same place are one, unused ones dropped.

    Raises:
        MeshError: no faces, vertices that are not finite, indices out of range, no extent.
    """
    vertices, faces = soup.vertices, soup.faces
    count = len(vertices)
    if len(faces) == 0:
        found = f"{count} vertices but no faces (a point cloud)" if count else "no faces"
        raise MeshError(f"{path}: has {found}; export the mesh with its triangles")
    bad = int((~np.isfinite(vertices)).any(axis=1).sum())
    if bad:
        raise MeshError(
            f"{path}: {bad} of {count} vertices are NaN or infinite; repair the mesh and export "
            "it again"
        )
    largest = float(np.abs(vertices).max())
    if largest > FARTHEST:
        raise MeshError(
            f"{path}: coordinates up to {largest:g} world units, at most {FARTHEST:g} are read; "
            "rescale the mesh"
        )
    low, high = int(faces.min()), int(faces.max())
    if low < 0 or high >= count:
        raise MeshError(
            f"{path}: a face refers to vertex {low if low < 0 else high}, but the file has {count} "
            "(counted from 0); the file is damaged, export it again"
        )
    welded = _weld(vertices)[faces]
    keep = (welded != np.roll(welded, 1, axis=1)).all(axis=1)  # three different corners
    if not keep.any():
        raise MeshError(f"{path}: every face is a line or a point; export the mesh's triangles")
    corners = vertices[welded[keep]]
    edges = corners[:, 1:] - corners[:, :1]
    if not np.cross(edges[:, 0], edges[:, 1]).any():
        raise MeshError(f"{path}: every face is a line or a point; export the mesh's triangles")
    used, compact = np.unique(welded[keep], return_inverse=True)
    return Mesh(
        vertices=vertices[used],
        faces=compact.reshape(-1, 3),
        face_colors=None if soup.colors is None else soup.colors[keep],
        face_parts=None if soup.parts is None else soup.parts[keep],
        part_names=soup.part_names,
        name=path.name,
        path=path,
    )


def check_counts(path: Path, vertices: int, faces: int, max_faces: int) -> None:
    """Refuse what a header promises before memory is reserved for it.

    Raises:
        MeshError: more faces than `max_faces`, or more vertices than these could use.
    """
    for count, limit, thing in (
        (faces, max_faces, "faces"),
        (vertices, VERTICES_PER_FACE * max_faces, "vertices"),
    ):
        if count > limit:
            raise MeshError(
                f"{path}: announces {count:,} {thing}, at most {limit:,} are read; "
                "simplify the mesh (or the file is damaged)"
            )


def _weld(vertices: Float[np.ndarray, "vertices 3"]) -> Int[np.ndarray, " vertices"]:
    """Return for every vertex the first vertex at exactly the same place."""
    order = np.lexsort(vertices.T)
    ordered = vertices[order]
    starts = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    first = np.minimum.reduceat(order, np.flatnonzero(starts))
    result = np.empty(len(vertices), dtype=np.int64)
    result[order] = first[np.cumsum(starts) - 1]
    return result
