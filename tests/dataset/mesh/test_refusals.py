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


def edited(change: dict[str, Any], **extra: Any) -> str:
    document = gltf(ONE_NODE, POINTS, FACES) | change
    document["accessors"][0] |= extra
    return json.dumps(document)


def nan_ply() -> bytes:
    points = CUBE.vertices.copy()
    points[0, 0] = np.nan
    return exported(trimesh.Trimesh(points, CUBE.faces, process=False, validate=False), "ply")


GLB, PLY, STL = (exported(CUBE, kind) for kind in ("glb", "ply", "stl"))
ASCII_PLY = exported(CUBE, "ply", encoding="ascii")
HUGE_PLY = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty float x\n"
    b"property float y\nproperty float z\nelement face 1\n"
    b"property list uchar int vertex_indices\nend_header\n"
)
CLOUD = trimesh.PointCloud(CUBE.vertices)
BAD_FILES: list[tuple[str, bytes | str, str]] = [
    ("a.obj", b"", r"is empty \(0 bytes\)"),
    ("a.obj", b"PK\x03\x04" + bytes(50), "is a zip archive"),
    ("a.obj", b"\x1f\x8b" + bytes(50), "is a gzip archive"),
    ("a.blend", b"BLENDER-v300", "is a Blender file, no mesh that can be read"),
    ("a.fbx", b"Kaydara FBX Binary  \0", "is an FBX file"),
    ("a.obj", b"\x89PNG\r\n\x1a\n" + bytes(50), "is a PNG picture"),
    ("a.dae", "<COLLADA>", "is text, no mesh that can be read"),
    ("a.obj", "hello\n" * 5, "has no vertices; is it really an OBJ"),
    ("a.obj", TRIANGLE, "and no faces"),
    ("a.obj", TRIANGLE + "l 1 2\n", "and no faces"),
    ("a.obj", "v nan 0 0\n" + TRIANGLE + "f 1 2 3\n", "1 of 4 vertices are NaN"),
    ("a.obj", "v 0 inf 0\n" + TRIANGLE + "f 2 3 4\n", "1 of 4 vertices are NaN or inf"),
    ("a.obj", "v 1e999 0 0\n" + TRIANGLE + "f 2 3 4\n", "1 of 4 vertices are NaN"),
    ("a.obj", "v 1e308 0 0\nv -1e308 0 0\nv 0 1 0\nf 1 2 3\n", "extent inf world units"),
    ("a.obj", TRIANGLE + "v 1e7 0 0\nf 1 2 4\nf 1 2 3\n", "extent 1e.07 world units"),
    ("a.obj", TRIANGLE + "f 0 1 2\n", "line 4: 'f 0 1 2': face index 0, but OBJ counts"),
    ("a.obj", TRIANGLE + "f 1 2 9\n", "refers to vertex 8 of 3"),
    ("a.obj", TRIANGLE + f"f 1 2 {10**23}\n", "face index 1e.23, and no mesh has so many"),
    ("a.obj", TRIANGLE + f"f 1 2 {10**400}\n", "face index inf, and no mesh has so many"),
    ("a.obj", TRIANGLE + "f -9 1 2\n", "line 4: .* face index -9, but only 3 came"),
    ("a.obj", TRIANGLE + "f a b c\n", "line 4: 'f a b c': not a face index"),
    ("a.obj", TRIANGLE + "f 1 2\n", "a face with 2 corners"),
    ("a.obj", "v 1,5 0 0\n", "line 1: 'v 1,5 0 0': not a number"),
    ("a.obj", "v 1 0\n", "line 1: .*2 numbers, 3 are needed"),
    ("a.obj", (TRIANGLE + "f 1 2 3\nv 1 2")[:], "line 5: .*2 numbers"),
    ("a.obj", TRIANGLE + "f 1 1 2\n", "every face is a line or a point"),
    ("a.obj", "v 0 0 0\n" * 3 + "f 1 2 3\n", "extent 0 world units"),
    ("a.ply", HUGE_PLY, "announces 2,000,000,000 vertices, at most 3,000,000"),
    ("a.ply", PLY[: len(PLY) // 2], "PLY file is damaged or cut off"),
    ("a.ply", ASCII_PLY[: len(ASCII_PLY) // 2], "cut off"),
    ("a.ply", exported(CLOUD, "ply"), "and no faces"),
    ("a.ply", "ply\n", "PLY file is damaged|and no faces"),
    ("a.obj", "v 0 0 0\nv 0 1 0\nv 0 2 0\nf 1 2 3\n", "every face is a line or a point"),
    ("a.ply", nan_ply(), r"1 of .* vertices are NaN"),
    ("a.stl", STL[:500], r"STL file is cut off \(500 bytes for 48 faces\)"),
    ("a.stl", STL[:60], "STL file is cut off"),
    ("a.stl", "hello\n" * 40, "and no faces"),
    ("a.stl", "solid a\nendsolid a\n", "STL|no faces"),
    ("a.off", "OFF\n2000000000 5 0\n0 0 0\n", "announces 2,000,000,000 vertices"),
    ("a.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n", "OFF file is damaged|cut off"),
    ("a.off", "hello", "OFF file is damaged"),
    ("a.glb", GLB[: len(GLB) // 2], "GLB file is cut off"),
    ("a.glb", GLB[:10], "damaged or cut off"),
    ("a.glb", b"glTF\1\0\0\0" + bytes(40), "GLB version 1"),
    ("a.glb", struct.pack("<4sII", b"glTF", 2, 20) + bytes(8), "damaged or cut off .KeyError"),
    ("a.gltf", "[1, 2]", "is JSON but no glTF"),
    ("a.gltf", "{", "damaged or cut off .JSONDecodeError"),
    ("a.gltf", "[" * 100_000, "damaged or cut off .RecursionError"),
    ("a.gltf", edited({"asset": {"version": "1.0"}}), "is glTF 1"),
    (
        "a.gltf",
        edited({"buffers": [{"uri": "../x.bin", "byteLength": 9}]}),
        r"refers to another file \(../x.bin\)",
    ),
    (
        "a.gltf",
        edited({"buffers": [{"uri": "http://x/y", "byteLength": 9}]}),
        "refers to another file",
    ),
    (
        "a.gltf",
        edited({"extensionsRequired": ["KHR_draco_mesh_compression"]}),
        "needs KHR_draco_mesh_compression",
    ),
    ("a.gltf", edited({}, count=2_000_000_000), "announces 2,000,000,000 vertices"),
    ("a.gltf", edited({}, count=1000), "damaged or cut off .ValueError"),
    ("a.gltf", edited({}, count=1).replace('"count": 1,', '"count": 1e999,'), "OverflowError"),
    (
        "a.gltf",
        edited({"nodes": [{"mesh": 0, "translation": [0] * 100_000}]}),  # squared: 80 GB
        "damaged or cut off .ValueError",
    ),
    ("a.gltf", edited({}, byteOffset=-8), "damaged or cut off .ValueError"),
    ("a.gltf", edited({}, sparse={}), "damaged or cut off .KeyError"),
    (
        "a.gltf",
        json.dumps(gltf(ONE_NODE, POINTS, FACES + np.uint16(7))),
        "refers to vertex 10, but it has 4",
    ),
    ("a.gltf", json.dumps(gltf(ONE_NODE, POINTS * np.float32("nan"), FACES)), "vertices are NaN"),
    ("a.gltf", edited({"nodes": [{"mesh": 0, "children": [0]}]}), "its nodes form a loop"),
    (
        "a.gltf",
        edited({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}]}),
        "node 0 has strips; export it as plain triangles",
    ),
    ("a.gltf", edited({"nodes": [{}]}), "and no faces"),
    ("a.gltf", edited({"meshes": [{}]}), "damaged or cut off .KeyError"),
    ("a.gltf", edited({"nodes": 5}), "glTF file is damaged"),
]


@pytest.mark.parametrize(("name", "data", "fragment"), BAD_FILES, ids=range(len(BAD_FILES)))
def test_bad_files_are_refused_by_name(name, data, fragment, tmp_path):
    with pytest.raises(MeshError, match=fragment) as caught:
        load(tmp_path, name, data)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


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
