"""Read STL, binary or text of one or several solids, and OFF with colours.

Our own readers: trimesh makes a scene of several solids, and knows no colours of OFF.
Source: Geomview's OFF format (`man off`); the StereoLithography interface specification, 1989.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.mesh.polygons import triangulate
from toonset.dataset.mesh.raw_triangles import RawTriangles, check_counts
from toonset.errors import MeshError
from toonset.read import describe

HEADER_BYTES, FACE_BYTES = 84, 50
STL_FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
SOLID = re.compile(r"^[ \t]*solid\b[ \t]*(.*)$", re.MULTILINE | re.IGNORECASE)
ENDSOLID = re.compile(r"\bend\s*solid\b", re.IGNORECASE)
VERTEX = re.compile(r"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
OFF_HEADER = re.compile(r"^\s*(ST)?(C)?(N)?(4)?(n)?OFF\b[ \t]*(BINARY)?")


def read_stl(data: bytes, path: Path, max_faces: int) -> RawTriangles:
    """Return the triangles of an STL file; every solid is one part.

    Raises:
        MeshError: damaged, cut off, too large.
    """
    if not _is_text(data):
        return _binary_stl(data, path, max_faces)
    text = data.decode("latin-1")
    solids = [*SOLID.finditer(text)]
    starts = [solid.start() for solid in solids] or [0]
    ends = [*starts[1:], len(text)]
    corners = [VERTEX.findall(text, *place) for place in zip(starts, ends, strict=True)]
    check_counts(path, sum(map(len, corners)), sum(map(len, corners)) // 3, max_faces)
    if any(len(own) % 3 for own in corners) or (solids and not ENDSOLID.search(text, starts[-1])):
        raise _damaged(path, "STL", "its last solid does not end")
    try:
        vertices = np.array([each for own in corners for each in own], dtype=np.float64)
    except ValueError as error:
        raise _damaged(path, "STL", error) from error
    filled = [number for number, own in enumerate(corners) if own]
    names = _unique([solids[number][1].strip() if solids else "" for number in filled])
    parts = np.repeat(np.arange(len(filled)), [len(corners[number]) // 3 for number in filled])
    faces = np.arange(len(vertices)).reshape(-1, 3)
    several = len(filled) > 1
    return RawTriangles(
        vertices.reshape(-1, 3),
        faces,
        parts=parts if several else None,
        part_names=names if several else ("body",),
    )


def _binary_stl(data: bytes, path: Path, max_faces: int) -> RawTriangles:
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= HEADER_BYTES else 0
    check_counts(path, 3 * count, count, max_faces)
    if len(data) < HEADER_BYTES + FACE_BYTES * count:
        raise MeshError(
            f"{path}: the STL file is cut off ({len(data)} bytes for {count} faces); export it "
            "again"
        )
    faces = np.frombuffer(data, STL_FACE, count, HEADER_BYTES)
    vertices = faces["corners"].reshape(-1, 3).astype(np.float64)
    return RawTriangles(vertices, np.arange(len(vertices)).reshape(-1, 3))


def read_off(data: bytes, path: Path, max_faces: int) -> RawTriangles:
    """Return the triangles of an OFF file, in the colours of its faces or vertices.

    Raises:
        MeshError: damaged, cut off, too large, binary or of four dimensions.
    """
    text = re.sub(r"#.*", "", data.decode("latin-1"))
    header = OFF_HEADER.match(text)
    if header is not None and (header[4] or header[5] or header[6]):
        raise MeshError(f"{path}: is an OFF of another kind (binary, 4D); export it as plain OFF")
    try:
        if header is None:
            raise ValueError("no OFF at its beginning")
        lines = [line for line in map(str.split, text[header.end() :].splitlines()) if line]
        vertices, faces = int(lines[0][0]), int(lines[0][1])
        check_counts(path, vertices, faces, max_faces)
        if vertices < 0 or faces < 0 or len(lines) < 1 + vertices + faces:
            raise ValueError("it ends too early")
        skipped = 3 + (3 if header[3] else 0)  # a normal stands before the colour
        raw = _off(lines[1 : 1 + vertices], lines[1 + vertices : 1 + vertices + faces], skipped)
    except (ValueError, IndexError, OverflowError) as error:
        raise _damaged(path, "OFF", error) from error
    check_counts(path, len(raw.vertices), len(raw.faces), max_faces)
    return raw


def _off(points: Sequence[list[str]], polygons: Sequence[list[str]], skipped: int) -> RawTriangles:
    vertices = np.array([line[:3] for line in points], dtype=np.float64).reshape(-1, 3)
    sizes = np.array([int(line[0]) for line in polygons], dtype=np.int64)
    if any(size < 1 or len(line) <= size for line, size in zip(polygons, sizes, strict=True)):
        raise ValueError("a face has fewer corners than it says")
    rows = [*zip(polygons, sizes.tolist(), strict=True)]
    words = [word for line, size in rows for word in line[1 : 1 + size]]
    indices = np.array([int(word) for word in words], dtype=np.int64)
    triangles = triangulate(vertices, indices, sizes)
    corners = indices[triangles.corners]
    colors = _off_colors([line[1 + size :] for line, size in rows])
    if colors is not None:
        return RawTriangles(vertices, corners, colors[triangles.polygons])
    of_vertex = _off_colors([line[skipped:] for line in points])
    known = ((corners >= 0) & (corners < len(vertices))).all()
    if of_vertex is None or not known or not len(corners):
        return RawTriangles(vertices, corners)
    means = np.rint(of_vertex[corners].mean(axis=1)).astype(np.uint8)
    return RawTriangles(vertices, corners, means)


def _off_colors(words: Sequence[list[str]]) -> UInt8[np.ndarray, "rows 3"] | None:
    """Return sRGB colours that stand behind vertices or faces; None where no row has three.

    Numbers with a point are fractions of 1, others of 255. Rows without a colour are as grey as
    Geomview draws them.
    """
    if not any(len(row) >= 3 for row in words):
        return None
    numbers = [row[:3] if len(row) >= 3 else ["", "", ""] for row in words]
    fractions = any("." in word for row in numbers for word in row)
    unknown = "0.8" if fractions else "204"
    values = np.array([[word or unknown for word in row] for row in numbers], dtype=np.float64)
    scale = 255.0 if fractions and values.max() <= 1 else 1.0
    return np.clip(np.rint(np.nan_to_num(values) * scale), 0, 255).astype(np.uint8)


def _is_text(data: bytes) -> bool:
    """Return whether an STL file is text: some that begin with `solid` are binary all the same."""
    if describe(data) != "text":
        return False
    if len(data) < HEADER_BYTES:
        return True
    count = struct.unpack_from("<I", data, 80)[0]
    return bool(len(data) != HEADER_BYTES + FACE_BYTES * count)


def _unique(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of parts; of those that repeat or are missing, with their number."""
    return tuple(
        name if name and names.count(name) == 1 else f"{name or 'solid'} {number}"
        for number, name in enumerate(names, start=1)
    )


def _damaged(path: Path, kind: str, why: object) -> MeshError:
    words = " ".join(str(why).split())[:80] or type(why).__name__
    return MeshError(f"{path}: the {kind} file is damaged or cut off ({words}); export it again")
