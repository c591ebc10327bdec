"""Read Wavefront OBJ: vertices with colours, polygons, objects and groups, material colours.

What materials leave transparent (`d 0`, `map_d`) is left out. Our own reader: trimesh takes index 0
for the first vertex, counts negative indices from the file's end, and names parts by their
materials.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path

import numpy as np
from jaxtyping import Int, UInt8

from toonset.dataset.mesh.mtl import beside, ends_of, library_names, matches, read_mtl, text_of
from toonset.dataset.mesh.obj_materials import paint_pieces, read_library, shown_pieces
from toonset.dataset.mesh.polygons import Triangles, triangulate
from toonset.dataset.mesh.raw_triangles import RawTriangles, check_counts, listed
from toonset.dataset.mesh.texture import corner_values
from toonset.errors import MeshError, printable

MOST_INDEX = 10**9
LINES_BETWEEN = 100_000  # of two looks at how much it has become
MTLLIB = re.compile(r"(?m)^.*mtllib.*$")


@dataclass
class _Lists:
    """Parsed lines: polygons are the corners that follow each other, indices from 0; -1 = none."""

    vertices: list[list[float]] = field(default_factory=list)
    colors: list[list[float]] = field(default_factory=list)
    uvs: list[list[float]] = field(default_factory=list)
    corners: list[int] = field(default_factory=list)
    texture_corners: list[int] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)
    materials: list[str] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    part: str = ""
    object_name: str = ""
    material: str = ""

    @property
    def triangles(self) -> int:
        """Return how many triangles its polygons have."""
        return len(self.corners) - 2 * len(self.sizes)

    def read(self, words: list[str], line: str) -> None:
        """Take the words of one line in; a ValueError says what is wrong with them."""
        key, *words = words
        if key == "v":
            numbers = _numbers(words, 3)
            self.vertices.append(numbers[:3])
            self.colors.append(numbers[3:6] if len(numbers) in (6, 7) else [])
        elif key == "vt":
            self.uvs.append([*_numbers(words, 1), 0.0][:2])
        elif key == "f":
            self._polygon(words)
        elif key == "o":
            self.part = self.object_name = " ".join(words)
        elif key == "g":
            self.part = " ".join(words) or self.object_name
        elif key == "usemtl":
            self.material = _rest(line)
        elif key == "mtllib":
            self.libraries.append(_rest(line))

    def _polygon(self, words: list[str]) -> None:
        vertices, textures = len(self.vertices), len(self.uvs)
        for word in words:
            vertex, _, rest = word.partition("/")
            texture = rest.partition("/")[0] if rest else ""
            self.corners.append(_index(vertex, vertices))
            self.texture_corners.append(_index(texture, textures) if texture else -1)
        if len(words) < 3:
            raise ValueError(f"a face with {len(words)} corners, 3 are needed")
        self.sizes.append(len(words))
        self.parts.append(self.part)
        self.materials.append(self.material)


def read_obj(data: bytes, path: Path, max_faces: int) -> RawTriangles:
    """Return the triangles of an OBJ file.

    Raises:
        MeshError: a number or index that cannot be read, with its line; too many faces.
        PictureError: a texture that is there, but cannot be read.
    """
    lists = _Lists()
    for number, line in enumerate(_text(data).split("\n"), start=1):
        words = _words(line)
        if not words:
            continue
        try:
            lists.read(words, line)
        except ValueError as error:
            shown = printable(" ".join(words)[:40])
            raise MeshError(
                f"{path}: line {number}: '{shown}': {error}; the file is damaged, export it again"
            ) from error
        if number % LINES_BETWEEN == 0:
            check_counts(path, len(lists.vertices), lists.triangles, max_faces)
    check_counts(path, len(lists.vertices), lists.triangles, max_faces)
    if not lists.vertices:
        raise MeshError(f"{path}: has no vertices; is it really an OBJ mesh? export it again")
    return _triangles(lists, path)


def _triangles(lists: _Lists, path: Path) -> RawTriangles:
    vertices = np.array(lists.vertices, dtype=np.float64)
    corners = np.array(lists.corners, dtype=np.int64)
    triangles = triangulate(vertices, corners, np.array(lists.sizes, dtype=np.int64))
    faces = corners[triangles.corners]
    names = list(dict.fromkeys(lists.parts)) or [""]
    numbers = {name: number for number, name in enumerate(names)}
    parts = np.array([numbers[name] for name in lists.parts], dtype=np.int64)[triangles.polygons]
    raw = RawTriangles(
        vertices,
        faces,
        _vertex_colors(lists, faces) if any(lists.colors) else None,
        parts if len(names) > 1 else None,
        tuple(name or "body" for name in names),
    )
    if not lists.libraries or not any(lists.materials):
        return raw
    if not len(faces) or faces.max() >= len(vertices):
        return raw  # the check of the faces says what is wrong
    return _with_materials(raw, lists, triangles, path)


def _with_materials(
    raw: RawTriangles, lists: _Lists, triangles: Triangles, path: Path
) -> RawTriangles:
    """Return the triangles in their materials' colours, if vertices have none."""
    names, of_polygon = np.unique(np.array(lists.materials), return_inverse=True)
    of_face = of_polygon[triangles.polygons]
    materials = [str(name) for name in names]
    library = read_library(lists.libraries, materials, path)
    said = f"names files that are not beside it: {listed(library.missing)}; their colours are lost"
    raw = replace(raw, remarks=(said,) if library.missing else ())
    if not library.paints:
        return raw
    table = np.array(lists.uvs, dtype=np.float64).reshape(-1, 2)
    textured = np.array(lists.texture_corners, dtype=np.int64)
    uvs = corner_values(table, textured[triangles.corners])
    cut = shown_pieces(library, materials, of_face, uvs)
    colors = raw.colors
    if colors is None or (colors == 255).all():  # some programs write white for none
        colors = paint_pieces(library, materials, of_face, uvs, cut)
    elif cut is not None:
        colors = colors[cut.parents]
    if cut is None:
        return replace(raw, colors=colors)
    whole = np.zeros(len(of_face), dtype=bool)
    whole[cut.parents[cut.whole]] = True
    lost = [materials[number] for number in np.unique(of_face[~whole])]
    said = f"left out what is transparent of {listed(lost)}"
    vertices, faces = cut.apply(raw.vertices, raw.faces)
    parts = None if raw.parts is None else raw.parts[cut.parents]
    remarks = (*raw.remarks, said)
    return replace(raw, vertices=vertices, faces=faces, colors=colors, parts=parts, remarks=remarks)


def _words(line: str) -> list[str]:
    """Return the words before a comment."""
    return list(takewhile(lambda word: word[0] != "#", line.split()))


def _rest(line: str) -> str:
    """Return what follows the first word of a line, as it is."""
    return line.strip().partition(line.split(None, 1)[0])[2].strip()


def _text(data: bytes) -> str:
    """Return the text with plain line ends, and lines that go on joined."""
    return text_of(data).replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " ")


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


def _vertex_colors(
    lists: _Lists, faces: Int[np.ndarray, "faces 3"]
) -> UInt8[np.ndarray, "faces 3"] | None:
    values = np.nan_to_num(np.array([color or [1.0] * 3 for color in lists.colors]))
    scale = 255.0 if values.max() <= 1 else 1.0  # some programs write 0 to 255
    if not len(faces) or faces.max() >= len(values):
        return None  # the check of the faces says what is wrong
    return np.clip(np.rint(values[faces].mean(axis=1) * scale), 0, 255).astype(np.uint8)


def material_files(
    mesh: bytes, find: Callable[[str], str | None], read: Callable[[str], bytes]
) -> list[str]:
    """Return the files that a mesh's colours come from: libraries, their textures.

    Args:
        mesh: content of an OBJ file.
        find: returns the file that a name means; None if there is none.
        read: returns the content of such a file.
    """
    found: dict[str, None] = {}
    for line in MTLLIB.findall(_text(mesh)):
        if _words(line)[:1] != ["mtllib"]:
            continue
        for name in library_names(_rest(line), lambda name: find(name) is not None):
            library = find(name)
            if library is None:
                continue
            found[library] = None
            for material in read_mtl(read(library)).values():
                textures = (find(named.name) for _, named in material.maps)
                found |= dict.fromkeys(file for file in textures if file is not None)
    return list(found)


def material_files_beside(mesh: Path) -> list[Path]:
    """Return the files in the folder of an OBJ file that its colours come from."""

    def find(name: str) -> str | None:
        file = beside(mesh, name)
        return None if file is None else str(file)

    def read(file: str) -> bytes:
        return Path(file).read_bytes()

    return [*map(Path, material_files(mesh.read_bytes(), find, read))]


def material_files_in(
    mesh: bytes,
    names_in: Callable[[str], Sequence[str]],
    is_file: Callable[[str], bool],
    read: Callable[[str], bytes],
) -> list[str]:
    """Return the same of a mesh in any folder, as paths below it.

    Args:
        mesh: content of an OBJ file.
        names_in: returns the names in a folder below the mesh's own, "" for itself.
        is_file: returns whether a file is at a path below it.
        read: returns the content of the file there.
    """

    def find(name: str) -> str | None:
        ends = ("/".join(end) for end in ends_of(name))
        return next((one for one in (*ends, *matches(name, names_in)) if is_file(one)), None)

    return material_files(mesh, find, read)
