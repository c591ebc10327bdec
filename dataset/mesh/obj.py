"""Wavefront OBJ: vertices with colours, polygons, objects and groups, material colours.

Our own reader, because groups, exact line numbers in messages and "no file outside the folder"
matter more here than OBJ's rarer records, which are skipped.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from toonset.dataset.mesh.color import Material, face_colors_from_texture, read_materials
from toonset.dataset.mesh.validate import Soup, check_counts
from toonset.errors import MeshError, printable


@dataclass
class _Lists:
    """What the lines add up to. Corners are (vertex, texture) indices from 0; -1 = none."""

    vertices: list[tuple[float, ...]] = field(default_factory=list)
    colors: list[tuple[float, ...] | None] = field(default_factory=list)
    uvs: list[tuple[float, ...]] = field(default_factory=list)
    faces: list[tuple[int, int, int]] = field(default_factory=list)
    face_uvs: list[tuple[int, int, int]] = field(default_factory=list)
    face_parts: list[int] = field(default_factory=list)
    face_materials: list[str] = field(default_factory=list)
    parts: dict[str, int] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)
    object_name: str = ""
    group_name: str = ""
    material: str = ""


def read_obj(data: bytes, path: Path, max_faces: int) -> Soup:
    """Return the triangles of an OBJ file; polygons are fanned from their first corner.

    Raises:
        MeshError: a number or index that cannot be read, with its line; too many faces.
    """
    lists = _Lists()
    for number, line in enumerate(text_of(data).split("\n"), start=1):
        words = list(itertools.takewhile(lambda word: word[0] != "#", line.split()))
        if not words:
            continue
        try:
            _read_line(words, lists)
        except (ValueError, IndexError) as error:
            shown = printable(" ".join(words)[:40])
            raise MeshError(
                f"{path}: line {number}: '{shown}': {error}; the file is damaged, export it again"
            ) from error
        if len(lists.faces) > max_faces:
            check_counts(path, 0, len(lists.faces), max_faces)
    if not lists.vertices:
        raise MeshError(f"{path}: has no vertices; is it really an OBJ mesh? export it again")
    return _soup(lists, path)


def text_of(data: bytes) -> str:
    """Return text of any 8-bit encoding with plain line ends; a byte order mark is dropped."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", errors="replace")
    else:
        text = data.removeprefix(b"\xef\xbb\xbf").decode("utf-8", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " ")


def _read_line(words: list[str], lists: _Lists) -> None:
    key, rest = words[0], words[1:]
    if key == "v":
        numbers = _numbers(rest, 3)
        lists.vertices.append(numbers[:3])
        lists.colors.append(numbers[3:6] if len(numbers) == 6 else None)
    elif key == "vt":
        lists.uvs.append((*_numbers(rest, 1), 0.0)[:2])
    elif key == "f":
        _read_face(rest, lists)
    elif key == "o":
        lists.object_name, lists.group_name = " ".join(rest), ""
    elif key == "g":
        lists.group_name = " ".join(rest)
    elif key == "usemtl":
        lists.material = " ".join(rest)
    elif key == "mtllib":
        lists.libraries.append(" ".join(rest))


def _numbers(words: list[str], least: int) -> tuple[float, ...]:
    if len(words) < least:
        raise ValueError(f"{len(words)} numbers, {least} are needed")
    try:
        return tuple([float(word) for word in words])
    except ValueError:
        raise ValueError("not a number (decimals need a point)") from None


def _read_face(words: list[str], lists: _Lists) -> None:
    corners = [_corner(word, lists) for word in words]
    if len(corners) < 3:
        raise ValueError(f"a face with {len(corners)} corners, 3 are needed")
    name = lists.group_name or lists.object_name
    part = lists.parts.setdefault(name, len(lists.parts))
    first = corners[0]
    for second, third in itertools.pairwise(corners[1:]):
        lists.faces.append((first[0], second[0], third[0]))
        lists.face_uvs.append((first[1], second[1], third[1]))
        lists.face_parts.append(part)
        lists.face_materials.append(lists.material)


def _corner(word: str, lists: _Lists) -> tuple[int, int]:
    fields = word.split("/")
    vertex = _index(fields[0], len(lists.vertices))
    has_uv = len(fields) > 1 and fields[1] != ""
    return vertex, _index(fields[1], len(lists.uvs)) if has_uv else -1


def _index(word: str, count: int) -> int:
    """Return an index from 0; negative ones count back from the latest."""
    try:
        index = int(word)
    except ValueError:
        raise ValueError("not a face index") from None
    if index == 0:
        raise ValueError("face index 0, but OBJ counts from 1")
    if index < -count:
        raise ValueError(f"face index {index}, but only {count} came before")
    return index - 1 if index > 0 else count + index


def _soup(lists: _Lists, path: Path) -> Soup:
    names = tuple(name or "body" for name in lists.parts) or ("body",)
    return Soup(
        vertices=np.array(lists.vertices, dtype=np.float64),
        faces=np.array(lists.faces, dtype=np.int64).reshape(-1, 3),
        colors=_colors(lists, path),
        parts=np.array(lists.face_parts, dtype=np.int64) if len(names) > 1 else None,
        part_names=names,
    )


def _colors(lists: _Lists, path: Path) -> np.ndarray | None:
    """Return vertex colours where every vertex has one, else the materials' colours."""
    if any(color is not None for color in lists.colors):
        return _vertex_colors(lists)
    materials = read_materials(lists.libraries, path) if any(lists.face_materials) else {}
    if not materials:
        return None
    used = sorted(set(lists.face_materials))
    of_face = np.array([used.index(name) for name in used])[
        np.searchsorted(used, lists.face_materials)
    ]
    table = [materials.get(name, Material()) for name in used]
    colors = np.array([material.rgb for material in table], dtype=np.uint8)[of_face]
    for number, material in enumerate(table):
        chosen = of_face == number
        if material.texture is not None and chosen.any():
            uvs = np.array(lists.uvs, dtype=np.float64).reshape(-1, 2)
            corners = np.array(lists.face_uvs, dtype=np.int64)[chosen]
            colors[chosen] = face_colors_from_texture(
                material.texture, uvs, corners, colors[chosen]
            )
    return colors


def _vertex_colors(lists: _Lists) -> np.ndarray | None:
    white = (1.0, 1.0, 1.0)
    values = np.array([white if color is None else color for color in lists.colors])
    values = np.nan_to_num(values)
    scale = 255.0 if values.max() <= 1 else 1.0  # some programs write 0 to 255
    faces = np.array(lists.faces, dtype=np.int64).reshape(-1, 3)
    if not len(faces) or faces.max() >= len(values):
        return None  # the check of the faces says what is wrong
    mean = values[faces].mean(axis=1) * scale
    return np.clip(np.rint(mean), 0, 255).astype(np.uint8)
