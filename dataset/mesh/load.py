"""Mesh files in and out: one safe way to read a mannequin, one to write it.

Read: OBJ, glTF/GLB (self-contained), PLY, STL, OFF; never an archive, never a file outside the
mesh's own folder. Sizes are capped before anything is built from a header's promise. Coordinates
are kept exactly as the file has them; vertices at the same place become one, so that neighbouring
faces share edges; vertices that no face uses are dropped.
"""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from toonset.dataset.mesh.gltf import read_gltf
from toonset.dataset.mesh.obj import read_obj
from toonset.dataset.mesh.ply_stl_off import read_scan
from toonset.dataset.mesh.validate import Soup, mesh_of_soup
from toonset.errors import MeshError
from toonset.mesh import Mesh
from toonset.read import describe, read_whole

MAX_BYTES = 256 * 2**20
MAX_FACES = 5_000_000
KINDS = ("obj", "ply", "stl", "glb", "gltf", "off")


def load_mesh(path: str | Path, max_bytes: int = MAX_BYTES, max_faces: int = MAX_FACES) -> Mesh:
    """Return the mesh of a file, in the file's own units, scene transforms applied.

    Args:
        path: an OBJ, PLY, STL, GLB, glTF or OFF file.
        max_bytes: a longer file is refused before it is read.
        max_faces: more triangles (or three times as many vertices) are refused.

    Returns:
        The mesh. `face_colors` comes from face, vertex, material or texture colours; `face_parts`
        from OBJ objects and groups or glTF nodes.

    Raises:
        MeshError: the file is missing, damaged, cut off, an archive, too large, without faces,
            or has vertices that are not finite or face indices out of range.
    """
    path = Path(path)
    data = read_whole(path, "mesh", MeshError, max_bytes)
    mesh = mesh_of_soup(_read(data, path, max_faces), path)
    return replace(mesh, sha256=sha256(data).hexdigest())


def save_obj(mesh: Mesh) -> bytes:
    """Return the mesh as OBJ text: exact coordinates, one object per part.

    Face colours become vertex colours (`v x y z r g b`): a vertex between two colours is written
    once for each, at the same place, so that every face keeps its own.
    """
    vertices, faces, colors = _split_by_color(mesh)
    lines = ["# toonset"]
    for row in range(len(vertices)):
        numbers = [repr(float(x)) for x in vertices[row]]
        if colors is not None:
            numbers += [f"{channel / 255:.6f}" for channel in colors[row]]
        lines.append("v " + " ".join(numbers))
    parts = mesh.face_parts if mesh.face_parts is not None else np.zeros(len(faces), dtype=int)
    for part in np.unique(parts):
        lines.append(f"o {_word(mesh.part_names[part])}")
        lines += [f"f {a} {b} {c}" for a, b, c in (faces[parts == part] + 1).tolist()]
    return ("\n".join(lines) + "\n").encode()


def _read(data: bytes, path: Path, max_faces: int) -> Soup:
    kind = _kind(data, path)
    if kind == "obj":
        return read_obj(data, path, max_faces)
    if kind in ("glb", "gltf"):
        return read_gltf(data, path, max_faces)
    return read_scan(data, kind, path, max_faces)


def _kind(data: bytes, path: Path) -> str:
    """Return the kind by content where it is unmistakable, else by the name."""
    if data.startswith(b"glTF"):
        return "glb"
    if data[:4] in (b"ply\n", b"ply\r"):
        return "ply"
    extension = path.suffix.lower().removeprefix(".")
    found = describe(data)
    if extension in KINDS and found in ("text", "of an unknown kind"):
        return extension
    raise MeshError(
        f"{path}: is {found}, no mesh that can be read; export the mesh as "
        f"{', '.join(KINDS[:-1])} or {KINDS[-1]}"
    )


def _split_by_color(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return vertices, faces and vertex colours such that a vertex has one colour only."""
    if mesh.face_colors is None:
        return mesh.vertices, mesh.faces, None
    r, g, b = mesh.face_colors.astype(np.int64).T
    color = np.repeat((r << 16) | (g << 8) | b, 3)
    key = mesh.faces.astype(np.int64).ravel() << 24 | color
    corners, faces = np.unique(key, return_inverse=True)
    code = corners & 0xFFFFFF
    colors = np.stack([code >> 16, code >> 8 & 255, code & 255], axis=1)
    return mesh.vertices[corners >> 24], faces.reshape(-1, 3), colors


def _word(name: str) -> str:
    return "_".join(name.split()) or "part"
