"""Weld and check the raw triangles that every mesh reader returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.errors import MeshError, printable
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
        remarks: what was done to them that people should know, without the file's name.
        world_from_file: how they were turned.
    """

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    colors: UInt8[np.ndarray, "faces 3"] | None = None
    parts: Int[np.ndarray, " faces"] | None = None
    part_names: tuple[str, ...] = ("body",)
    remarks: tuple[str, ...] = ()
    world_from_file: Float[np.ndarray, "3 3"] = field(default_factory=lambda: np.eye(3))

    def turned(self, rotation: Float[np.ndarray, "3 3"], said: str = "") -> RawTriangles:
        """Return the triangles turned; `said` is remarked."""
        return replace(
            self,
            vertices=self.vertices @ rotation.T,
            remarks=(*self.remarks, said) if said else self.remarks,
            world_from_file=rotation @ self.world_from_file,
        )


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
        remarks=tuple(f"{path.name}: {said}" for said in raw.remarks),
        world_from_file=raw.world_from_file,
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


def listed(names: Sequence[str]) -> str:
    """Return the first of some names for people, and how many more there are."""
    shown = ", ".join(printable(name)[:40] for name in names[:3])
    return shown if len(names) <= 3 else f"{shown} and {len(names) - 3} more"


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
