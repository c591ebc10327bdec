"""Open glTF 2.0 and GLB files: their description and their arrays.

Refused by name: other files, compressed data. Source: Khronos glTF 2.0 specification.
"""

from __future__ import annotations

import base64
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toonset.dataset.mesh.raw_triangles import check_counts
from toonset.errors import MeshError

JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")


@dataclass(frozen=True, eq=False)
class GltfFile:
    """An opened file.

    Attributes:
        json: its description.
        buffers: its binary data.
        path: for messages.
        max_faces: three times as many items are read of an accessor.
    """

    json: dict[str, Any]
    buffers: tuple[bytes, ...]
    path: Path
    max_faces: int

    def array(self, index: int) -> np.ndarray:
        """Return an accessor as (count, width); normalised integers become floats.

        Raises:
            MeshError: compressed or too long.
            TypeError, ValueError: data that ends too early.
        """
        accessor = self.json["accessors"][index]
        count, width = int(accessor["count"]), WIDTHS[accessor["type"]]
        check_counts(self.path, count, 0, self.max_faces)
        dtype = np.dtype(DTYPES[accessor["componentType"]])
        if "bufferView" in accessor:
            values = self._values(accessor, dtype, count, width)
        elif "sparse" in accessor:
            values = np.zeros((count, width), dtype)
        else:
            raise MeshError(
                f"{self.path}: compressed glTF data is not supported; export it without compression"
            )
        if "sparse" in accessor:
            values = self._replaced(accessor["sparse"], values)
        if accessor.get("normalized") and dtype.kind != "f":
            return np.maximum(values.astype(np.float64) / np.iinfo(dtype).max, -1.0)
        return values

    def _replaced(self, sparse: dict[str, Any], values: np.ndarray) -> np.ndarray:
        """Return an array with some of its rows replaced."""
        count = int(sparse["count"])
        if not 0 <= count <= len(values):
            raise ValueError("sparse data for more items than there are")
        rows = self._values(
            sparse["indices"], np.dtype(DTYPES[sparse["indices"]["componentType"]]), count, 1
        )
        replaced = values.copy()
        replaced[rows.ravel().astype(np.int64)] = self._values(
            sparse["values"], values.dtype, count, values.shape[1]
        )
        return replaced

    def _values(self, place: dict[str, Any], dtype: Any, count: int, width: int) -> np.ndarray:
        """Return rows of a buffer view."""
        stride = self.json["bufferViews"][place["bufferView"]].get("byteStride")
        strides = (stride or dtype.itemsize * width, dtype.itemsize)
        data, start = self.view(place["bufferView"]), place.get("byteOffset", 0)
        return np.ndarray((count, width), dtype, data, start, strides)

    def view(self, index: int) -> bytes:
        """Return the bytes of a buffer view; fewer where the buffer is cut off."""
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.buffers[view["buffer"]][start : start + view["byteLength"]]


def open_gltf(data: bytes, path: Path, max_faces: int) -> GltfFile:
    """Return the opened file.

    Raises:
        MeshError: cut off, of another version, needs other files or compression.
        Exception: damaged; see `read_gltf` for what Python says then.
    """
    text, binary = _chunks(data, path) if data.startswith(b"glTF") else (data, b"")
    description = json.loads(text.removeprefix(b"\xef\xbb\xbf"))
    if not isinstance(description, dict) or "asset" not in description:
        raise MeshError(f"{path}: is JSON but no glTF; export the mesh again")
    if str(description["asset"].get("version", "2")).split(".")[0] != "2":
        raise MeshError(f"{path}: is glTF 1; export it as glTF 2 (.glb)")
    for name in COMPRESSED:
        if name in description.get("extensionsRequired", []):
            raise MeshError(f"{path}: needs {name}; export it without compression")
    check_counts(path, len(description.get("nodes", [])), 0, max_faces)
    buffers = description.get("buffers", [])
    found = tuple(of_uri(one["uri"], path) if "uri" in one else binary for one in buffers)
    return GltfFile(description, found, path, max_faces)


def _chunks(data: bytes, path: Path) -> tuple[bytes, bytes]:
    """Return the JSON and the binary chunk of a GLB."""
    version, length = struct.unpack_from("<II", data, 4)
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
        found.setdefault(kind, data[position + 8 : position + 8 + size])
        position += 8 + size
    return found[JSON_CHUNK], found.get(BINARY_CHUNK, b"")


def of_uri(uri: str, path: Path) -> bytes:
    """Return the bytes that a data URI holds.

    Raises:
        MeshError: it names another file.
    """
    if not uri.startswith("data:"):
        raise MeshError(
            f"{path}: refers to another file ({uri[:40]}); export it in one piece, as .glb"
        )
    return base64.b64decode(uri.partition(",")[2])
