"""The container of a glTF or GLB file: JSON, buffers, accessors; nothing outside the file."""

from __future__ import annotations

import base64
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toonset.dataset.mesh.validate import VERTICES_PER_FACE, check_counts
from toonset.errors import MeshError

JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
UNREADABLE_EXTENSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")


@dataclass(frozen=True, eq=False)
class GltfFile:
    """An opened file.

    Attributes:
        json: its description.
        buffers: its binary data.
        path: for messages.
        max_items: no accessor may be longer.
    """

    json: dict[str, Any]
    buffers: tuple[bytes, ...]
    path: Path
    max_items: int

    def count(self, index: int) -> int:
        """Return the number of items of an accessor.

        Raises:
            MeshError: more than any mesh of the allowed size needs.
        """
        count = self.json["accessors"][index]["count"]
        if not isinstance(count, int) or not 0 <= count <= self.max_items:
            raise MeshError(
                f"{self.path}: announces {count} items of one kind, at most {self.max_items:,} "
                "are read; simplify the mesh (or the file is damaged)"
            )
        return count

    def array(self, index: int) -> np.ndarray:
        """Return an accessor as (count, width); normalised integers become floats.

        Raises:
            MeshError: sparse or compressed data, or data that ends too early.
        """
        accessor = self.json["accessors"][index]
        count, width = self.count(index), WIDTHS[accessor["type"]]
        if "sparse" in accessor or "bufferView" not in accessor:
            raise MeshError(
                f"{self.path}: sparse or compressed glTF data is not supported; export it plain"
            )
        dtype = np.dtype(DTYPES[accessor["componentType"]])
        data, stride = self.view(accessor["bufferView"])
        stride = stride or dtype.itemsize * width
        start = accessor.get("byteOffset", 0)
        end = start + (count - 1) * stride + dtype.itemsize * width if count else start
        if start < 0 or stride < dtype.itemsize * width or end > len(data):
            raise MeshError(f"{self.path}: the glTF data is cut off; export it again")
        raw = np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize))
        return _normalised(raw) if accessor.get("normalized") else raw

    def view(self, index: int) -> tuple[bytes, int]:
        """Return the bytes of a buffer view and its stride (0 = packed)."""
        view = self.json["bufferViews"][index]
        start, length = view.get("byteOffset", 0), view["byteLength"]
        data = self.buffers[view["buffer"]]
        if start < 0 or length < 0 or start + length > len(data):
            raise MeshError(f"{self.path}: the glTF data is cut off; export it again")
        return data[start : start + length], view.get("byteStride", 0)


def open_gltf(data: bytes, path: Path, max_faces: int) -> GltfFile:
    """Return the opened file.

    Raises:
        MeshError: damaged, cut off, needs other files or an extension that is not supported.
    """
    text, binary = _chunks(data, path) if data.startswith(b"glTF") else (data, b"")
    try:
        description = json.loads(text.removeprefix(b"\xef\xbb\xbf"))
    except (ValueError, RecursionError) as error:
        raise MeshError(
            f"{path}: its glTF description is damaged ({error}); export it again"
        ) from error
    if not isinstance(description, dict) or "asset" not in description:
        raise MeshError(f"{path}: is JSON but no glTF; export the mesh again")
    if str(description["asset"].get("version", "2")).split(".")[0] != "2":
        raise MeshError(f"{path}: is glTF 1; export it as glTF 2 (.glb)")
    for name in UNREADABLE_EXTENSIONS:
        if name in description.get("extensionsRequired", []):
            raise MeshError(f"{path}: needs {name}; export it without compression")
    check_counts(path, 0, len(description.get("nodes", [])), max_faces)
    buffers = tuple(_buffer(buffer, binary, path) for buffer in description.get("buffers", []))
    return GltfFile(description, buffers, path, VERTICES_PER_FACE * max_faces)


def data_of_uri(uri: str, path: Path) -> bytes:
    """Return the bytes of a data URI.

    Raises:
        MeshError: the URI names another file.
    """
    if not uri.startswith("data:"):
        raise MeshError(
            f"{path}: refers to another file ({uri[:40]}); export it in one piece, as .glb"
        )
    return base64.b64decode(uri.partition(",")[2])


def _buffer(buffer: dict[str, Any], binary: bytes, path: Path) -> bytes:
    return data_of_uri(buffer["uri"], path) if "uri" in buffer else binary


def _chunks(data: bytes, path: Path) -> tuple[bytes, bytes]:
    """Return the JSON and the binary chunk of a GLB."""
    if len(data) < 20:
        raise MeshError(f"{path}: the GLB file is cut off; export it again")
    _, version, length = struct.unpack_from("<4sII", data)
    if version != 2:
        raise MeshError(f"{path}: is GLB version {version}; export it as glTF 2")
    if length > len(data):
        raise MeshError(
            f"{path}: the GLB file is cut off ({len(data)} of {length} bytes); export it again"
        )
    found: dict[int, bytes] = {}
    position = 12
    while position + 8 <= length:
        size, kind = struct.unpack_from("<II", data, position)
        if position + 8 + size > length:
            raise MeshError(f"{path}: the GLB file is cut off; export it again")
        found.setdefault(kind, data[position + 8 : position + 8 + size])
        position += 8 + size
    if JSON_CHUNK not in found:
        raise MeshError(f"{path}: the GLB file has no description; export it again")
    return found[JSON_CHUNK], found.get(BINARY_CHUNK, b"")


def _normalised(raw: np.ndarray) -> np.ndarray:
    if raw.dtype.kind == "f":
        return raw
    return np.maximum(raw.astype(np.float64) / np.iinfo(raw.dtype).max, -1.0)
