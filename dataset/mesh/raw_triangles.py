"""Weld and check the raw triangles that every mesh reader returns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.errors import MeshError
from toonset.mesh import Mesh

VERTICES_PER_FACE = 3  # a heap of unconnected triangles has no more


@dataclass(frozen=True, eq=False)
class RawTriangles:
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


def weld_mesh(raw: RawTriangles, path: Path) -> Mesh:
    """Return the checked mesh: equal vertices and equal faces are one, unused vertices dropped.

    Raises:
        MeshError: what `Mesh` refuses, and faces that are all lines or points.
    """
    vertices = raw.vertices
    Mesh(vertices, raw.faces, path=path)  # refuses what could not be welded
    welded = _weld(vertices)[raw.faces]
    keep = (welded != np.roll(welded, 1, axis=1)).all(axis=1)  # three different corners
    keep &= _is_first(welded)
    corners = vertices[welded[keep]]
    edges = corners[:, 1:] - corners[:, :1]
    if not np.cross(edges[:, 0], edges[:, 1]).any():
        raise MeshError(f"{path}: every face is a line or a point; export the mesh's triangles")
    used, compact = np.unique(welded[keep], return_inverse=True)
    return Mesh(
        vertices=vertices[used],
        faces=compact.reshape(-1, 3),
        face_colors=None if raw.colors is None else raw.colors[keep],
        face_parts=None if raw.parts is None else raw.parts[keep],
        part_names=raw.part_names,
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


def face_colors_from_texture(
    texture: UInt8[np.ndarray, "height width 4"],
    uvs: Float[np.ndarray, "uvs 2"],
    corners: Int[np.ndarray, "faces 3"],
    fallback: UInt8[np.ndarray, "faces 3"],
) -> UInt8[np.ndarray, "faces 3"]:
    """Return the texture's colour at the middle of every face.

    Args:
        texture: sRGB picture; v = 0 is its lower edge.
        uvs: texture coordinates, repeated outside [0, 1].
        corners: index into `uvs` per face corner; out of range = the face has none.
        fallback: colour of faces without usable coordinates.
    """
    usable = ((corners >= 0) & (corners < len(uvs))).all(axis=1)
    colors = fallback.copy()
    middle = uvs[corners[usable]].mean(axis=1)
    finite = np.isfinite(middle).all(axis=1)
    height, width = texture.shape[:2]
    u, v = np.nan_to_num(middle).T % 1.0
    column = np.minimum((u * width).astype(int), width - 1)
    row = np.minimum(((1 - v) * height).astype(int), height - 1)
    colors[usable] = np.where(finite[:, None], texture[row, column, :3], fallback[usable])
    return colors


def _is_first(faces: Int[np.ndarray, "faces 3"]) -> Bool[np.ndarray, " faces"]:
    """Return which faces show a side that none before them shows."""
    start = np.argmin(faces, axis=1)[:, None]
    turned = np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1)
    order = np.lexsort(turned.T)
    repeats = (turned[order[1:]] == turned[order[:-1]]).all(axis=1)
    first = np.ones(len(faces), dtype=bool)
    first[order[1:][repeats]] = False  # lexsort keeps the order of equal ones
    return first


def _weld(vertices: Float[np.ndarray, "vertices 3"]) -> Int[np.ndarray, " vertices"]:
    """Return for every vertex the first vertex at exactly the same place."""
    place = np.zeros(len(vertices), dtype=np.int64)
    for values in vertices.T:  # axis by axis: ten times as fast as rows at once
        number = np.unique(values, return_inverse=True)[1]
        place = np.unique(place * len(vertices) + number, return_inverse=True)[1]
    return np.unique(place, return_index=True)[1][place]
