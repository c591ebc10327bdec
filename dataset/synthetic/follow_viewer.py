"""Turn parts of a mesh to the viewer, as cartoonists cheat ears and noses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toonset.errors import MeshError
from toonset.mesh import Mesh


def part_numbers(mesh: Mesh, names: Sequence[str]) -> tuple[int, ...]:
    """Return the numbers of the named parts.

    Raises:
        MeshError: the mesh has no such part.
    """
    missing = [name for name in names if name not in mesh.part_names]
    if missing:
        raise MeshError(
            f"{mesh.name}: has no part {missing[0]!r}; its parts are {', '.join(mesh.part_names)}"
        )
    return tuple(mesh.part_names.index(name) for name in names)


def turn_parts(mesh: Mesh, parts: Sequence[int], yaw: float) -> Mesh:
    """Return the mesh with `parts` turned by `yaw` radians towards a camera at that yaw.

    Each part turns about the vertical line through the middle of its own bounding box. Faces and
    their order stay; vertices that a part shares with the rest are doubled.
    """
    if not parts or mesh.face_parts is None:
        return mesh
    vertices, faces = mesh.vertices, mesh.faces.copy()
    for part in parts:
        own = mesh.face_parts == part
        used, local = np.unique(faces[own], return_inverse=True)
        faces[own] = len(vertices) + local.reshape(-1, 3)
        vertices = np.concatenate([vertices, _turned(vertices[used], yaw)])
    return replace(mesh, vertices=vertices, faces=faces)


def _turned(points: np.ndarray, yaw: float) -> np.ndarray:
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    c, s = math.cos(yaw), math.sin(yaw)
    y_turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return (points - middle) @ y_turn.T + middle
