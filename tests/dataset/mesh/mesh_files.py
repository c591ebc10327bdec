"""A cube in every format, and glTF documents made of arrays."""

import base64
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from toonset.dataset.mesh.load import load_mesh
from toonset.mesh import Mesh

CUBE = trimesh.creation.box(extents=(1, 2, 3)).subdivide()
CUBE.apply_translation((0.1, 1 / 3, -2.0))
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def exported(mesh: Any, kind: str, **options: Any) -> bytes:
    data = mesh.export(file_type=kind, **options)
    return data.encode() if isinstance(data, str) else bytes(data)


def load(tmp_path: Path, name: str, data: bytes | str) -> Mesh:
    file = tmp_path / name
    file.write_bytes(data.encode() if isinstance(data, str) else data)
    return load_mesh(file)


def gltf(document: dict[str, Any], *arrays: np.ndarray) -> dict[str, Any]:
    """Return a glTF whose accessor i is array i, all in one data URI."""
    views, accessors, blob = [], [], b""
    types = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
    codes = {"float32": 5126, "uint16": 5123, "uint32": 5125, "uint8": 5121}
    for array in arrays:
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
        kind = types[1 if array.ndim == 1 else array.shape[1]]
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": codes[array.dtype.name],
                "count": len(array),
                "type": kind,
            }
        )
        blob += array.tobytes() + b"\0" * (-array.nbytes % 4)
    uri = "data:application/octet-stream;base64," + base64.b64encode(blob).decode()
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(blob), "uri": uri}],
        "bufferViews": views,
        "accessors": accessors,
        **document,
    }


POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)
FACES = np.array([0, 2, 1, 0, 1, 3], dtype=np.uint16)


def one_primitive(**more: int) -> list[dict[str, Any]]:
    """Return the meshes of a glTF with one mesh, with more attributes of accessors."""
    material = {"material": more.pop("material")} if "material" in more else {}
    return [{"primitives": [{"attributes": {"POSITION": 0, **more}, "indices": 1, **material}]}]


ONE_NODE: dict[str, Any] = {
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": one_primitive(),
}
