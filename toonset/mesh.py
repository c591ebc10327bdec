"""Define a triangle mesh: the mannequin, in world coordinates."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.errors import MeshError

Up = Literal["y", "z"]
Z_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # ours from a world with +Z up, front -Y


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle surface.

    Attributes:
        vertices: (n, 3) world coordinates, finite; welded (outlines need the faces at an edge)
            and all used, as `toonset.dataset.mesh.load.load_mesh` returns them.
        faces: (m, 3) vertex indices.
        face_colors: (m, 3) sRGB of every face, or None where the file has no colours.
        face_parts: (m,) part number of every face (0 where the file has no parts).
        part_names: name of each part number.
        name: where it came from, for messages.
        path: its file, if it has one.
        sha256: of the file's bytes.
        remarks: what was done to it as it was read that people should know, one line each.
        world_from_file: how the file's coordinates were turned.
    """

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    face_colors: UInt8[np.ndarray, "faces 3"] | None = None
    face_parts: Int[np.ndarray, " faces"] | None = None
    part_names: tuple[str, ...] = ("body",)
    name: str = "mesh"
    path: Path | None = None
    sha256: str = ""
    remarks: tuple[str, ...] = ()
    world_from_file: Float[np.ndarray, "3 3"] = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        """Refuse arrays that are not a surface.

        Raises:
            MeshError: no faces, a vertex that is not finite, an index out of range, no extent.
        """
        where = self.path or self.name
        if len(self.faces) == 0:
            raise MeshError(
                f"{where}: has {len(self.vertices)} vertices and no faces; export the mesh with "
                "its triangles"
            )
        bad = int((~np.isfinite(self.vertices)).any(axis=1).sum())
        if bad:
            raise MeshError(
                f"{where}: {bad} of {len(self.vertices)} vertices are NaN or infinite; "
                "repair the mesh and export it again"
            )
        low, high = int(self.faces.min()), int(self.faces.max())
        if low < 0 or high >= len(self.vertices):
            raise MeshError(
                f"{where}: a face refers to vertex {low if low < 0 else high} of "
                f"{len(self.vertices)}, counted from 0; the file is damaged, export it again"
            )
        with np.errstate(over="ignore"):
            extent = float(np.ptp(self.vertices, axis=0).max())
        if not 1e-4 <= extent <= 1e6:
            raise MeshError(
                f"{where}: extent {extent:g} world units, 1e-4 to 1e6 is needed; rescale it"
            )

    @property
    def up(self) -> Up:
        """Return the axis of the file that points up."""
        return "z" if np.array_equal(self.world_from_file[1], [0, 0, 1]) else "y"

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Return the lowest and highest corner of the bounding box."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def middle(self) -> Float[np.ndarray, " 3"]:
        """Return the middle of the bounding box."""
        return self.bounds.mean(axis=0)

    @property
    def height(self) -> float:
        """Return the extent along +Y."""
        return float(np.ptp(self.vertices[:, 1]))

    @property
    def radius(self) -> float:
        """Return the distance from `middle` to the farthest vertex."""
        return float(np.linalg.norm(self.vertices - self.middle, axis=1).max())


def split_by_face(
    faces: Int[np.ndarray, "faces 3"], tags: Int[np.ndarray, " faces"]
) -> tuple[Int[np.ndarray, " split"], Int[np.ndarray, " split"], Int[np.ndarray, "faces 3"]]:
    """Return old number and tag of every new vertex, and the faces of these.

    A vertex between faces of several tags comes once for each, at the same place, so that every
    face keeps its own.

    Args:
        faces: vertex indices.
        tags: of every face, 0 to 2^24 - 1.
    """
    keys = faces.astype(np.int64) << 24 | tags.astype(np.int64)[:, None]
    unique, index = np.unique(keys, return_inverse=True)
    return unique >> 24, unique & 0xFFFFFF, index.reshape(-1, 3)
