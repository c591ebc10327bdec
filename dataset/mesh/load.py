"""Read and write mesh files in one safe way.

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
from toonset.dataset.mesh.ply import read_ply
from toonset.dataset.mesh.raw_triangles import weld_mesh
from toonset.dataset.mesh.stl_off import read_off, read_stl
from toonset.dataset.mesh.surroundings import without_surroundings
from toonset.errors import MeshError
from toonset.mesh import Z_UP, Mesh, Up, split_by_face
from toonset.read import describe, read_whole

MAX_BYTES = 256 * 2**20
MAX_FACES = 1_000_000
LYING = 1.5  # times its height: a deeper mesh may lie on its back (docs/decisions.md)
READERS = {
    **{"obj": read_obj, "ply": read_ply, "stl": read_stl, "glb": read_gltf, "gltf": read_gltf},
    "off": read_off,
}
KINDS = tuple(READERS)


def load_mesh(
    path: str | Path, max_bytes: int = MAX_BYTES, max_faces: int = MAX_FACES, *, up: Up = "y"
) -> Mesh:
    """Return the mesh of a file, in the file's own units, scene transforms applied.

    What nobody sees is left out: hidden nodes, what materials leave transparent, and floors and
    backdrops, flat and wider than the rest is tall. `remarks` of the mesh say so.

    Args:
        path: an OBJ, PLY, STL, GLB, glTF, VRM or OFF file.
        max_bytes: a longer file is refused before it is read.
        max_faces: more triangles (or three times as many vertices) are refused.
        up: the axis that points up in the file; "z" (front -Y, as in Blender) is turned to ours.

    Returns:
        The mesh. `face_colors` comes from face, vertex, material or texture colours; `face_parts`
        from OBJ objects and groups, glTF nodes or the solids of an STL file.

    Raises:
        MeshError: the file is missing, damaged, cut off, an archive, too large, without faces,
            or has vertices that are not finite or face indices out of range.
        PictureError: a texture that is there, but cannot be read.
    """
    path = Path(path)
    data = read_whole(path, "mesh", MeshError, max_bytes)
    raw = READERS[_kind(data, path)](data, path, max_faces)
    if up == "z":
        raw = raw.turned(Z_UP)
    mesh = without_surroundings(weld_mesh(raw, path))
    return replace(mesh, sha256=sha256(data).hexdigest(), remarks=(*mesh.remarks, *_lying(mesh)))


def save_obj(mesh: Mesh) -> bytes:
    """Return the mesh as OBJ text: exact coordinates, one object per part.

    Face colours become vertex colours (`v x y z r g b`): a vertex between two colours is written
    once for each, at the same place, so that every face keeps its own.
    """
    rgb = np.zeros((len(mesh.faces), 3)) if mesh.face_colors is None else mesh.face_colors
    old, code, faces = split_by_face(mesh.faces, rgb.astype(np.int64) @ [1 << 16, 1 << 8, 1])
    shown = np.stack([code >> 16, code >> 8 & 255, code & 255], axis=1) / 255
    lines = ["# toonset"]
    for place, color in zip(mesh.vertices[old].tolist(), shown.tolist(), strict=True):
        numbers = [repr(x) for x in place]
        if mesh.face_colors is not None:
            numbers += [f"{channel:.6f}" for channel in color]
        lines.append("v " + " ".join(numbers))
    parts = mesh.face_parts if mesh.face_parts is not None else np.zeros(len(faces), dtype=int)
    for part in np.unique(parts):
        lines.append(f"o {'_'.join(mesh.part_names[part].split()) or 'part'}")
        lines += [f"f {a} {b} {c}" for a, b, c in (faces[parts == part] + 1).tolist()]
    return ("\n".join(lines) + "\n").encode()


def _lying(mesh: Mesh) -> tuple[str, ...]:
    """Return a line if the mesh is so much deeper than high that it may lie on its back."""
    _, height, depth = np.ptp(mesh.vertices, axis=0).tolist()
    if mesh.up == "z" or depth < LYING * height:
        return ()
    deep = f"is {depth:.3g} deep and {height:.3g} high"
    return (f"{mesh.name}: {deep}: if it lies on its back, +Z is up in the file: give --up z",)


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
