"""Read PLY: polygons of any size, with colours of faces or vertices, as text or binary.

Our own reader: trimesh gives every polygon one colour and two triangles, reads no binary file whose
polygons differ in size, and knows no colours by another name than red, green, blue.
Source: G. Turk, The PLY polygon file format, 1994.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int, UInt8

from toonset.dataset.mesh.polygons import triangulate
from toonset.dataset.mesh.raw_triangles import RawTriangles, check_counts
from toonset.errors import MeshError

TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
    **{"int64": "i8", "uint64": "u8", "long": "i8", "ulong": "u8", "half": "f2", "float16": "f2"},
}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
INDICES = ("vertex_indices", "vertex_index")
COLORS = (  # what programs call them
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
)


@dataclass(frozen=True)
class Property:
    """A property of an element; a list has a type of its length, too."""

    name: str
    kind: str
    length_kind: str = ""


@dataclass(frozen=True)
class Element:
    """An element that the header announces."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass(frozen=True, eq=False)
class Table:
    """The rows of an element.

    Attributes:
        columns: numbers by name.
        lists: by name, all numbers of all rows one after the other, and how many each row has.
    """

    columns: Mapping[str, np.ndarray]
    lists: Mapping[str, tuple[np.ndarray, Int[np.ndarray, " rows"]]]


def read_ply(data: bytes, path: Path, max_faces: int) -> RawTriangles:
    """Return the triangles of a PLY file.

    Raises:
        MeshError: damaged, cut off, too large.
    """
    try:
        order, elements, start = _header(data)
        counts = {element.name: element.count for element in elements}
        check_counts(path, counts.get("vertex", 0), counts.get("face", 0), max_faces)
        body = _Text(data[start:]) if not order else _Binary(data, start, order)
        tables = {}
        for element in elements:
            tables[element.name] = body.table(element)
            if {"vertex", "face"} <= tables.keys():
                break
        raw = _triangles(tables)
    except (ValueError, KeyError, IndexError, OverflowError) as error:
        words = " ".join(str(error).split())[:80] or type(error).__name__
        raise MeshError(
            f"{path}: the PLY file is damaged or cut off ({words}); export it again"
        ) from error
    check_counts(path, len(raw.vertices), len(raw.faces), max_faces)
    return raw


def _header(data: bytes) -> tuple[str, list[Element], int]:
    """Return the byte order ("" for text), the elements, and where the rows begin."""
    order, elements, position = None, [], 0
    while position < len(data):
        end = data.find(b"\n", position)
        end = len(data) if end < 0 else end
        words = data[position:end].decode("latin-1").split()
        position = end + 1
        if words[:1] == ["format"]:
            order = ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append(Element(words[1], int(words[2]), ()))
        elif words[:2] == ["property", "list"]:
            elements[-1] = _with(elements[-1], Property(words[4], TYPES[words[3]], TYPES[words[2]]))
        elif words[:1] == ["property"]:
            elements[-1] = _with(elements[-1], Property(words[2], TYPES[words[1]]))
        elif words == ["end_header"]:
            break
    else:
        raise ValueError("no end of the header")
    if order is None:
        raise ValueError("no format")
    if any(element.count < 0 for element in elements):
        raise ValueError("fewer than no rows")
    return order, elements, position


def _with(element: Element, more: Property) -> Element:
    return Element(element.name, element.count, (*element.properties, more))


def _triangles(tables: Mapping[str, Table]) -> RawTriangles:
    vertex = tables.get("vertex", Table({}, {}))
    vertices = np.zeros((0, 3))
    if vertex.columns:
        vertices = np.column_stack([vertex.columns[axis].astype(np.float64) for axis in "xyz"])
    face = tables.get("face", Table({}, {}))
    name = next((name for name in INDICES if name in face.lists), None)
    if name is None:
        return RawTriangles(vertices, np.zeros((0, 3), dtype=np.int64))
    indices, sizes = face.lists[name]
    indices = indices.astype(np.int64)
    triangles = triangulate(vertices, indices, sizes)
    faces = indices[triangles.corners]
    colors, of_vertex = _colors(face), _colors(vertex)
    if colors is not None:
        colors = colors[triangles.polygons]
    elif of_vertex is not None and len(faces) and 0 <= faces.min() <= faces.max() < len(vertices):
        colors = np.rint(of_vertex[faces].mean(axis=1)).astype(np.uint8)
    return RawTriangles(vertices, faces, colors)


def _colors(table: Table) -> UInt8[np.ndarray, "rows 3"] | None:
    """Return the sRGB colour of every row; fractions of 1 and of 65535 count as such."""
    for names in COLORS:
        if all(name in table.columns for name in names):
            values = np.column_stack([table.columns[name] for name in names])
            scale = 1.0
            if values.dtype.kind == "f":
                values = np.nan_to_num(values)
                scale = 255.0 if values.max(initial=0) <= 1 else 1.0
            elif values.dtype.itemsize == 2 and values.max(initial=0) > 255:
                scale = 255 / 65535
            return np.clip(np.rint(values * scale), 0, 255).astype(np.uint8)
    return None


class _Text:
    """Rows as text."""

    def __init__(self, data: bytes) -> None:
        self.numbers = np.array(data.split(), dtype=np.float64)
        self.at = 0

    def table(self, element: Element) -> Table:
        """Return the next element's rows."""
        width, rows = self._width(element), None
        if width is not None:
            rows = self._take(element.count * width).reshape(element.count, width)
            if not _lists_are_even(element, rows):
                self.at -= rows.size
                rows = None
        return self._of_rows(element, rows) if rows is not None else self._one_by_one(element)

    def _width(self, element: Element) -> int | None:
        """Return the numbers in a row, if all have as many as the first; None if they have not."""
        width = 0
        for each in element.properties:
            width += 1
            if each.length_kind and element.count:
                width += _count(self.numbers[self.at + width - 1])
        left = len(self.numbers) - self.at
        return width if element.count * width <= left else None

    def _of_rows(self, element: Element, rows: np.ndarray) -> Table:
        columns, lists, place = {}, {}, 0
        for each in element.properties:
            if not each.length_kind:
                columns[each.name] = rows[:, place].astype(_number_kind(each.kind))
                place += 1
                continue
            size = _count(rows[0, place]) if len(rows) else 0
            values = rows[:, place + 1 : place + 1 + size].ravel()
            lists[each.name] = (values, np.full(len(rows), size))
            place += 1 + size
        return Table(columns, lists)

    def _one_by_one(self, element: Element) -> Table:
        found: dict[str, list[np.ndarray]] = {each.name: [] for each in element.properties}
        for _ in range(element.count):
            for each in element.properties:
                size = _count(self._take(1)[0]) if each.length_kind else 1
                found[each.name].append(self._take(size))
        return _table(element, found)

    def _take(self, count: int) -> np.ndarray:
        if self.at + count > len(self.numbers):
            raise ValueError("it ends too early")
        self.at += count
        return self.numbers[self.at - count : self.at]


class _Binary:
    """Rows as bytes."""

    def __init__(self, data: bytes, start: int, order: str) -> None:
        self.data, self.at, self.order = data, start, order

    def table(self, element: Element) -> Table:
        """Return the next element's rows."""
        dtype = self._dtype(element)
        if self.at + element.count * dtype.itemsize <= len(self.data):
            rows = np.frombuffer(self.data, dtype, element.count, self.at)
            names = [f"#{each.name}" for each in element.properties if each.length_kind]
            if not len(rows) or all((rows[name] == rows[name][0]).all() for name in names):
                self.at += element.count * dtype.itemsize
                return _of_records(element, rows)
        return self._one_by_one(element)

    def _dtype(self, element: Element) -> np.dtype:
        """Return the record of all rows if their lists are as long as those of the first."""
        fields: list[Any] = []
        for each in element.properties:
            kind = np.dtype(self.order + each.kind)
            if not each.length_kind:
                fields.append((each.name, kind))
                continue
            length, size = np.dtype(self.order + each.length_kind), 0
            if element.count:
                before = np.dtype(fields).itemsize if fields else 0
                size = _count(np.frombuffer(self.data, length, 1, self.at + before)[0])
            fields += [(f"#{each.name}", length), (each.name, kind, (size,))]
        return np.dtype(fields)

    def _one_by_one(self, element: Element) -> Table:
        found: dict[str, list[np.ndarray]] = {each.name: [] for each in element.properties}
        kinds = [
            (each.name, np.dtype(self.order + each.kind), self.order + each.length_kind)
            for each in element.properties
        ]
        for _ in range(element.count):
            for name, kind, length in kinds:
                size = 1
                if length != self.order:
                    size = _count(self._take(np.dtype(length), 1)[0])
                found[name].append(self._take(kind, size))
        return _table(element, found)

    def _take(self, kind: np.dtype, count: int) -> np.ndarray:
        taken = np.frombuffer(self.data, kind, count, self.at)
        self.at += count * kind.itemsize
        return taken


def _of_records(element: Element, rows: np.ndarray) -> Table:
    columns = {each.name: rows[each.name] for each in element.properties if not each.length_kind}
    lists = {
        each.name: (rows[each.name].ravel(), np.full(len(rows), rows[each.name].shape[1]))
        for each in element.properties
        if each.length_kind
    }
    return Table(columns, lists)


def _table(element: Element, found: Mapping[str, list[np.ndarray]]) -> Table:
    """Return rows that were read one by one."""
    columns, lists = {}, {}
    for each in element.properties:
        own = found[each.name]
        values = np.concatenate([np.zeros(0), *own]) if own else np.zeros(0)
        if each.length_kind:
            lists[each.name] = (values, np.array([len(row) for row in own], dtype=np.int64))
        else:
            columns[each.name] = values.astype(_number_kind(each.kind))
    return Table(columns, lists)


def _lists_are_even(element: Element, rows: np.ndarray) -> bool:
    """Return whether every list of every row is as long as in the first."""
    place = 0
    for each in element.properties:
        if each.length_kind and len(rows):
            if (rows[:, place] != rows[0, place]).any():
                return False
            place += _count(rows[0, place])
        place += 1
    return True


def _number_kind(kind: str) -> str:
    """Return the type that text of a kind is kept as: floats exactly."""
    return "f8" if kind.startswith("f") else kind


def _count(number: float) -> int:
    if not 0 <= number <= 10**6:
        raise ValueError(f"a list of {number:g} numbers")
    return int(number)
