"""Read Wavefront OBJ: vertices with colours, polygons, objects and groups, material colours.

Our own reader: trimesh takes index 0 for the first vertex, counts negative indices from the file's
end, and names parts by their materials.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise, takewhile
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.images.picture import load_rgba
from toonset.dataset.mesh.raw_triangles import RawTriangles, check_counts, face_colors_from_texture
from toonset.errors import MeshError, printable
from toonset.read import read_whole

UNKNOWN_COLOR = (204, 204, 204)  # a face whose material is not described; trimesh's and Blender's
MAX_LIBRARY_BYTES = 4 * 2**20
MOST_INDEX = 10**9
LINES_BETWEEN = 100_000  # of two looks at how much it has become
MTLLIB = re.compile(r"(?m)^.*mtllib.*$")


@dataclass
class _Lists:
    """Parsed lines. Faces are vertices, then texture corners, from 0; -1 = none."""

    vertices: list[list[float]] = field(default_factory=list)
    colors: list[list[float]] = field(default_factory=list)
    uvs: list[list[float]] = field(default_factory=list)
    faces: list[tuple[int, ...]] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)
    materials: list[str] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    part: str = ""
    object_name: str = ""
    material: str = ""

    def read(self, line: list[str]) -> None:
        """Take the words of one line in; a ValueError says what is wrong with them."""
        key, *words = line
        if key == "v":
            numbers = _numbers(words, 3)
            self.vertices.append(numbers[:3])
            self.colors.append(numbers[3:] if len(numbers) == 6 else [])
        elif key == "vt":
            self.uvs.append([*_numbers(words, 1), 0.0][:2])
        elif key == "f":
            corners = [self._corner(word) for word in words]
            if len(corners) < 3:
                raise ValueError(f"a face with {len(corners)} corners, 3 are needed")
            v, t = corners[0]
            self.faces += [(v, a[0], b[0], t, a[1], b[1]) for a, b in pairwise(corners[1:])]
            self.parts += [self.part] * (len(corners) - 2)
            self.materials += [self.material] * (len(corners) - 2)
        elif key == "o":
            self.part = self.object_name = " ".join(words)
        elif key == "g":
            self.part = " ".join(words) or self.object_name
        elif key == "usemtl":
            self.material = " ".join(words)
        elif key == "mtllib":
            self.libraries.append(" ".join(words))

    def _corner(self, word: str) -> tuple[int, int]:
        vertex, _, rest = word.partition("/")
        texture = rest.partition("/")[0]
        known = _index(texture, len(self.uvs)) if texture else -1
        return _index(vertex, len(self.vertices)), known


def read_obj(data: bytes, path: Path, max_faces: int) -> RawTriangles:
    """Return the triangles of an OBJ file; polygons are fanned from their first corner.

    Raises:
        MeshError: a number or index that cannot be read, with its line; too many faces.
    """
    lists = _Lists()
    for number, line in enumerate(_text(data).split("\n"), start=1):
        words = _words(line)
        if not words:
            continue
        try:
            lists.read(words)
        except ValueError as error:
            shown = printable(" ".join(words)[:40])
            raise MeshError(
                f"{path}: line {number}: '{shown}': {error}; the file is damaged, export it again"
            ) from error
        if number % LINES_BETWEEN == 0:
            check_counts(path, len(lists.vertices), len(lists.faces), max_faces)
    check_counts(path, len(lists.vertices), len(lists.faces), max_faces)
    if not lists.vertices:
        raise MeshError(f"{path}: has no vertices; is it really an OBJ mesh? export it again")
    faces = np.array(lists.faces, dtype=np.int64).reshape(-1, 6)
    names = list(dict.fromkeys(lists.parts)) or [""]
    numbers = {name: number for number, name in enumerate(names)}
    return RawTriangles(
        vertices=np.array(lists.vertices, dtype=np.float64),
        faces=faces[:, :3],
        colors=_colors(lists, faces, path),
        parts=np.array([numbers[name] for name in lists.parts]) if len(names) > 1 else None,
        part_names=tuple(name or "body" for name in names),
    )


def _words(line: str) -> list[str]:
    """Return the words before a comment."""
    return list(takewhile(lambda word: word[0] != "#", line.split()))


def _text(data: bytes) -> str:
    """Return text of any 8-bit encoding with plain line ends; a byte order mark is dropped."""
    wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    text = data.decode("utf-16" if wide else "utf-8-sig", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " ")


def _numbers(words: list[str], least: int) -> list[float]:
    if len(words) < least:
        raise ValueError(f"{len(words)} numbers, {least} are needed")
    try:
        return [float(word) for word in words]
    except ValueError:
        raise ValueError("not a number (decimals need a point)") from None


def _index(word: str, count: int) -> int:
    """Return an index from 0; negative ones count back from the latest."""
    try:
        index = int(word)
    except ValueError:
        raise ValueError("not a face index") from None
    if abs(index) > MOST_INDEX:
        raise ValueError(f"face index {float(word):.3g}, and no mesh has so many")
    if index == 0:
        raise ValueError("face index 0, but OBJ counts from 1")
    if index < -count:
        raise ValueError(f"face index {index}, but only {count} came before")
    return index - 1 if index > 0 else count + index


def _colors(lists: _Lists, faces: np.ndarray, path: Path) -> np.ndarray | None:
    """Return vertex colours where a vertex has one, else the materials' colours."""
    if any(lists.colors):
        return _vertex_colors(lists, faces[:, :3])
    found = _read_materials(lists.libraries, path) if any(lists.materials) else {}
    if not found:
        return None
    names, of_face = np.unique(lists.materials, return_inverse=True)
    colors = np.full((len(faces), 3), UNKNOWN_COLOR, dtype=np.uint8)
    uvs = np.array(lists.uvs, dtype=np.float64).reshape(-1, 2)
    for number, name in enumerate(names.tolist()):
        chosen = of_face == number
        rgb, texture = found.get(name, (UNKNOWN_COLOR, None))
        colors[chosen] = rgb
        if texture is not None:
            colors[chosen] = face_colors_from_texture(
                texture, uvs, faces[chosen, 3:], colors[chosen]
            )
    return colors


def _vertex_colors(lists: _Lists, faces: np.ndarray) -> np.ndarray | None:
    values = np.nan_to_num(np.array([color or [1.0] * 3 for color in lists.colors]))
    scale = 255.0 if values.max() <= 1 else 1.0  # some programs write 0 to 255
    if not len(faces) or faces.max() >= len(values):
        return None  # the check of the faces says what is wrong
    return np.clip(np.rint(values[faces].mean(axis=1) * scale), 0, 255).astype(np.uint8)


def _read_materials(
    libraries: list[str], mesh_path: Path
) -> dict[str, tuple[tuple[int, ...], UInt8[np.ndarray, "height width 4"] | None]]:
    """Return colours and textures of MTL files beside the mesh; others are not opened.

    A library or texture that is missing leaves its faces without that colour.

    Raises:
        MeshError, PictureError: a file that is there but cannot be read.
    """
    found: dict[str, tuple[tuple[int, ...], UInt8[np.ndarray, "height width 4"] | None]] = {}
    for library in libraries:
        file = beside(mesh_path, library)
        data = b"" if file is None else read_whole(file, "material", MeshError, MAX_LIBRARY_BYTES)
        name = ""
        for line in data.decode("utf-8", errors="replace").splitlines():
            key, *words = line.split() or [""]
            rgb, texture = found.get(name, (UNKNOWN_COLOR, None))
            if key == "newmtl":
                name = " ".join(words)
                found[name] = (UNKNOWN_COLOR, None)
            elif key == "Kd":
                found[name] = (_rgb(words), texture)
            elif key == "map_Kd" and words:
                picture = beside(mesh_path, words[-1])
                found[name] = (rgb, None if picture is None else load_rgba(picture))
    return found


def material_files(mesh: bytes, read: Callable[[str], bytes | None]) -> list[str]:
    """Return the names of the files that a mesh's colours come from: libraries, their textures.

    Args:
        mesh: content of an OBJ file.
        read: returns the content of a file in the mesh's folder; None if it is not there.
    """
    found = []
    for line in MTLLIB.findall(_text(mesh)):
        key, *words = _words(line) or [""]
        library = read(" ".join(words)) if key == "mtllib" else None
        if library is not None:
            found.append(" ".join(words))
            lines = library.decode("utf-8", errors="replace").splitlines()
            of_line = [words for words in map(str.split, lines) if words[:1] == ["map_Kd"]]
            found += [words[-1] for words in of_line if len(words) > 1]
    return found


def beside(mesh_path: Path, name: str) -> Path | None:
    """Return the file `name` in the mesh's own folder; None if it is elsewhere or missing."""
    if "\0" in name:  # no file is called so
        return None
    folder = os.path.realpath(mesh_path.parent)
    file = os.path.realpath(os.path.join(folder, name.replace("\\", "/")))
    inside = os.path.commonpath([folder, file]) == folder
    return Path(file) if inside and os.path.isfile(file) else None


def _rgb(words: list[str]) -> tuple[int, ...]:
    try:
        red, green, blue = (round(255 * min(max(float(word), 0.0), 1.0)) for word in words[:3])
    except ValueError:  # too few, no numbers, or NaN
        return UNKNOWN_COLOR
    return red, green, blue
