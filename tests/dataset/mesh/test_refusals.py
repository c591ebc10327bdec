"""Meshes: what is damaged, too large or something else is refused by name."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tests.dataset.mesh.mesh_files import (
    CUBE,
    FACES,
    ONE_NODE,
    POINTS,
    TRIANGLE,
    exported,
    gltf,
    load,
)
from toonset.dataset.mesh.load import load_mesh
from toonset.errors import MeshError, ToonsetError


def edited(change: dict[str, Any], extra: dict[str, Any] | None = None) -> str:
    document = gltf(ONE_NODE, POINTS, FACES) | change
    for key, value in (extra or {}).items():
        document["accessors"][0][key] = value
    return json.dumps(document)


GLB, PLY, STL = (exported(CUBE, kind) for kind in ("glb", "ply", "stl"))
ASCII_PLY = exported(CUBE, "ply", encoding="ascii")
HUGE_PLY = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float x\n"
    b"property float y\nproperty float z\nelement face 1\n"
    b"property list uchar int vertex_indices\nend_header\n"
)
CLOUD = trimesh.PointCloud(CUBE.vertices)
BAD_FILES: dict[str, tuple[str, bytes | str, str]] = {
    "empty": ("a.obj", b"", r"is empty \(0 bytes\)"),
    "zip": ("a.obj", b"PK\x03\x04" + bytes(50), "is a zip archive"),
    "gzip": ("a.obj", b"\x1f\x8b" + bytes(50), "is a gzip archive"),
    "blend": ("a.blend", b"BLENDER-v300", "is a Blender file, no mesh that can be read"),
    "fbx": ("a.fbx", b"Kaydara FBX Binary  \0", "is an FBX file"),
    "picture": ("a.obj", b"\x89PNG\r\n\x1a\n" + bytes(50), "is a PNG picture"),
    "unknown extension": ("a.dae", "<COLLADA>", "is text, no mesh that can be read"),
    "text": ("a.obj", "hello\n" * 5, "has no vertices; is it really an OBJ"),
    "point cloud": ("a.obj", TRIANGLE, "and no faces"),
    "lines": ("a.obj", TRIANGLE + "l 1 2\n", "and no faces"),
    "nan": ("a.obj", "v nan 0 0\n" + TRIANGLE + "f 1 2 3\n", "1 of 4 vertices are NaN"),
    "inf": ("a.obj", "v 0 inf 0\n" + TRIANGLE + "f 2 3 4\n", "1 of 4 vertices are NaN or inf"),
    "overflow": ("a.obj", "v 1e999 0 0\n" + TRIANGLE + "f 2 3 4\n", "1 of 4 vertices are NaN"),
    "huge": ("a.obj", "v 1e308 0 0\nv -1e308 0 0\nv 0 1 0\nf 1 2 3\n", "extent inf world units"),
    "far": ("a.obj", TRIANGLE + "v 1e7 0 0\nf 1 2 4\nf 1 2 3\n", "extent 1e.07 world units"),
    "index 0": ("a.obj", TRIANGLE + "f 0 1 2\n", "line 4: 'f 0 1 2': face index 0, but OBJ counts"),
    "index high": ("a.obj", TRIANGLE + "f 1 2 9\n", "refers to vertex 8 of 3"),
    "index low": ("a.obj", TRIANGLE + "f -9 1 2\n", "line 4: .* face index -9, but only 3 came"),
    "index word": ("a.obj", TRIANGLE + "f a b c\n", "line 4: 'f a b c': not a face index"),
    "two corners": ("a.obj", TRIANGLE + "f 1 2\n", "a face with 2 corners"),
    "comma": ("a.obj", "v 1,5 0 0\n", "line 1: 'v 1,5 0 0': not a number"),
    "short": ("a.obj", "v 1 0\n", "line 1: .*2 numbers, 3 are needed"),
    "cut obj": ("a.obj", (TRIANGLE + "f 1 2 3\nv 1 2")[:], "line 5: .*2 numbers"),
    "degenerate": ("a.obj", TRIANGLE + "f 1 1 2\n", "every face is a line or a point"),
    "flat point": ("a.obj", "v 0 0 0\n" * 3 + "f 1 2 3\n", "extent 0 world units"),
    "huge ply": ("a.ply", HUGE_PLY, "announces 2,000,000,000 vertices, at most 15,000,000"),
    "cut ply": ("a.ply", PLY[: len(PLY) // 2], "PLY file is damaged or cut off"),
    "cut ascii ply": ("a.ply", ASCII_PLY[: len(ASCII_PLY) // 2], "cut off"),
    "cloud ply": ("a.ply", exported(CLOUD, "ply"), "and no faces"),
    "empty ply": ("a.ply", "ply\n", "PLY file is damaged|and no faces"),
    "cut stl": ("a.stl", STL[:500], r"STL file is cut off \(500 bytes for 48 faces\)"),
    "short stl": ("a.stl", STL[:60], "STL file is cut off"),
    "text stl": ("a.stl", "hello\n" * 40, "and no faces"),
    "ascii stl without faces": ("a.stl", "solid a\nendsolid a\n", "STL|no faces"),
    "huge off": ("a.off", "OFF\n2000000000 5 0\n0 0 0\n", "announces 2,000,000,000 vertices"),
    "cut off file": ("a.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n", "OFF file is damaged|cut off"),
    "text off": ("a.off", "hello", "OFF file is damaged"),
    "cut glb": ("a.glb", GLB[: len(GLB) // 2], "GLB file is cut off"),
    "cut glb header": ("a.glb", GLB[:10], "damaged or cut off"),
    "glb 1": ("a.glb", b"glTF\1\0\0\0" + bytes(40), "GLB version 1"),
    "glb without json": (
        "a.glb",
        struct.pack("<4sII", b"glTF", 2, 20) + bytes(8),
        "damaged or cut off .KeyError",
    ),
    "json": ("a.gltf", "[1, 2]", "is JSON but no glTF"),
    "not json": ("a.gltf", "{", "damaged or cut off .JSONDecodeError"),
    "deep json": ("a.gltf", "[" * 100_000, "damaged or cut off .RecursionError"),
    "gltf 1": ("a.gltf", edited({"asset": {"version": "1.0"}}), "is glTF 1"),
    "gltf buffer file": (
        "a.gltf",
        edited({"buffers": [{"uri": "../x.bin", "byteLength": 9}]}),
        r"refers to another file \(../x.bin\)",
    ),
    "gltf buffer url": (
        "a.gltf",
        edited({"buffers": [{"uri": "http://x/y", "byteLength": 9}]}),
        "refers to another file",
    ),
    "gltf draco": (
        "a.gltf",
        edited({"extensionsRequired": ["KHR_draco_mesh_compression"]}),
        "needs KHR_draco_mesh_compression",
    ),
    "gltf huge count": (
        "a.gltf",
        edited({}, {"count": 2_000_000_000}),
        "announces 2,000,000,000 vertices",
    ),
    "gltf long count": ("a.gltf", edited({}, {"count": 1000}), "damaged or cut off .ValueError"),
    "gltf negative offset": (
        "a.gltf",
        edited({}, {"byteOffset": -8}),
        "damaged or cut off .ValueError",
    ),
    "gltf sparse": ("a.gltf", edited({}, {"sparse": {}}), "sparse or compressed"),
    "gltf bad index": (
        "a.gltf",
        json.dumps(gltf(ONE_NODE, POINTS, FACES + np.uint16(7))),
        "refers to vertex 10, but it has 4",
    ),
    "gltf nan": (
        "a.gltf",
        json.dumps(gltf(ONE_NODE, POINTS * np.float32("nan"), FACES)),
        "vertices are NaN",
    ),
    "gltf loop": (
        "a.gltf",
        edited({"nodes": [{"mesh": 0, "children": [0]}]}),
        "its nodes form a loop",
    ),
    "gltf strip": (
        "a.gltf",
        edited({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}]}),
        "node 0 has strips; export it as plain triangles",
    ),
    "gltf no mesh": ("a.gltf", edited({"nodes": [{}]}), "and no faces"),
    "gltf missing key": ("a.gltf", edited({"meshes": [{}]}), "damaged or cut off .KeyError"),
    "gltf wrong type": ("a.gltf", edited({"nodes": 5}), "glTF file is damaged"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_files_are_refused_by_name(case: str, tmp_path: Path) -> None:
    name, data, fragment = BAD_FILES[case]
    with pytest.raises(MeshError, match=fragment) as caught:
        load(tmp_path, name, data)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_nan_in_ply(tmp_path: Path) -> None:
    points = CUBE.vertices.copy()
    points[0, 0] = np.nan
    broken = trimesh.Trimesh(points, CUBE.faces, process=False, validate=False)
    with pytest.raises(MeshError, match=r"1 of .* vertices are NaN"):
        load(tmp_path, "a.ply", exported(broken, "ply"))


def test_caps(tmp_path: Path) -> None:
    file = tmp_path / "a.obj"
    file.write_bytes(exported(CUBE, "obj"))
    with pytest.raises(MeshError, match="announces 48 faces, at most 10 are read"):
        load_mesh(file, max_faces=10)
    with pytest.raises(MeshError, match="at most 0 MB is read"):
        load_mesh(file, max_bytes=100)


def test_places_that_are_no_files(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="no such file; check the name of the mesh"):
        load_mesh(tmp_path / "none.obj")
    with pytest.raises(MeshError, match="is a folder, a mesh file is needed"):
        load_mesh(tmp_path)


@pytest.mark.parametrize("kind", ["glb", "ply", "stl", "obj", "off"])
def test_damaged_bytes_end_in_an_error_or_a_mesh(kind: str, tmp_path: Path) -> None:
    data = exported(CUBE, kind)
    rng = np.random.default_rng(7)
    outcomes = set()
    for _ in range(60):
        broken = bytearray(data)
        for place in rng.integers(0, len(data), 8):
            broken[place] = rng.integers(0, 256)
        try:
            mesh = load(tmp_path, f"a.{kind}", bytes(broken))
            outcomes.add("mesh")
            assert np.isfinite(mesh.vertices).all()
        except ToonsetError:
            outcomes.add("error")
    assert outcomes
