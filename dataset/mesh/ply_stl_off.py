"""Read PLY, STL and OFF with trimesh, after checking what their headers promise."""

from __future__ import annotations

import io
import re
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from toonset.dataset.mesh.raw_triangles import RawTriangles, check_counts
from toonset.errors import MeshError
from toonset.read import describe

PLY_ELEMENT = re.compile(rb"^element\s+(\w+)\s+(\d+)\s*$", re.MULTILINE)
OFF_COUNTS = re.compile(rb"^\s*(\d+)[ \t]+(\d+)[ \t]+\d+\s*$", re.MULTILINE)
HEADER_BYTES = 65536
STL_HEADER_BYTES, STL_FACE_BYTES = 84, 50


def read_scan(data: bytes, kind: str, path: Path, max_faces: int) -> RawTriangles:
    """Return the triangles of a PLY, STL or OFF file.

    Raises:
        MeshError: damaged, cut off, too large.
    """
    counts = _announced(data, kind)
    check_counts(path, *counts, max_faces)
    if kind == "stl" and len(data) < STL_HEADER_BYTES + STL_FACE_BYTES * counts[1]:
        raise MeshError(
            f"{path}: the STL file is cut off ({len(data)} bytes for {counts[1]} faces); export "
            "it again"
        )
    mesh = _parse(data, kind, path)
    faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64).reshape(-1, 3)
    vertices = np.asarray(getattr(mesh, "vertices", ()), dtype=np.float64).reshape(-1, 3)
    check_counts(path, len(vertices), len(faces), max_faces)
    if len(vertices) < counts[0] or len(faces) < counts[1]:
        raise MeshError(
            f"{path}: has {len(vertices)} vertices and {len(faces)} faces, its header announces "
            f"{counts[0]} and {counts[1]}; the file is cut off, export it again"
        )
    return RawTriangles(vertices, faces, _colors(mesh, faces) if len(faces) else None)


def _announced(data: bytes, kind: str) -> tuple[int, int]:
    """Return the numbers of vertices and faces in the header; 0 where it has none."""
    if kind == "ply":
        found = dict(PLY_ELEMENT.findall(data[:HEADER_BYTES].replace(b"\r\n", b"\n")))
        return int(found.get(b"vertex", 0)), int(found.get(b"face", 0))
    if kind == "off":
        match = OFF_COUNTS.search(data[:HEADER_BYTES])
        return (int(match[1]), int(match[2])) if match else (0, 0)
    if describe(data) != "text" and len(data) >= STL_HEADER_BYTES:
        faces = struct.unpack_from("<I", data, 80)[0]
        return 3 * faces, faces
    return 0, 0


def _parse(data: bytes, kind: str, path: Path) -> Any:
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return trimesh.load(io.BytesIO(data), file_type=kind, process=False)
    except Exception as error:  # parsers raise almost anything on damaged bytes
        words = " ".join(str(error).split())[:80] or type(error).__name__
        raise MeshError(
            f"{path}: the {kind.upper()} file is damaged or cut off ({words}); export it again"
        ) from error


def _colors(mesh: Any, faces: np.ndarray) -> np.ndarray | None:
    if mesh.visual.kind == "face":
        return np.asarray(mesh.visual.face_colors)[:, :3].astype(np.uint8)
    if mesh.visual.kind != "vertex":
        return None
    corners = np.asarray(mesh.visual.vertex_colors)[:, :3].astype(np.float64)[faces]
    return np.rint(corners.mean(axis=1)).astype(np.uint8)
