"""Meshes: exact coordinates, colours and parts come in; everything odd is refused by name."""

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from toonset.dataset.mesh_file import load_mesh, save_obj
from toonset.errors import MeshError, ToonsetError
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


def corners(mesh: Mesh) -> np.ndarray:
    return mesh.vertices[mesh.faces]


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
ONE_NODE: dict[str, Any] = {
    "scenes": [{"nodes": [0]}],
    "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
}


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "glb", "off"])
def test_every_format_gives_the_same_welded_surface(kind: str, tmp_path: Path) -> None:
    options = {"digits": 17} if kind in ("obj", "off") else {}
    mesh = load(tmp_path, f"cube.{kind}", exported(CUBE, kind, **options))
    assert len(mesh.vertices) == len(CUBE.vertices)
    np.testing.assert_allclose(corners(mesh), CUBE.triangles, atol=2e-7)  # stl, glb: float32
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # closed


def test_obj_coordinates_are_exact_and_come_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    vertices = rng.normal(size=(50, 3)) * 10.0 ** rng.integers(-3, 3, (50, 1))
    faces = rng.permutation(50)[:48].reshape(-1, 3)
    mesh = Mesh(vertices, faces)
    again = load(tmp_path, "a.obj", save_obj(mesh))
    assert np.array_equal(corners(again), corners(mesh))


def test_saved_colours_and_parts_come_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    colors = rng.integers(0, 256, (len(CUBE.faces), 3), dtype=np.uint8)
    parts = np.arange(len(CUBE.faces)) % 3
    mesh = Mesh(CUBE.vertices, CUBE.faces, colors, parts, ("head", "left arm", "leg"))
    again = load(tmp_path, "a.obj", save_obj(mesh))
    assert again.part_names == ("head", "left_arm", "leg")
    assert len(again.vertices) == len(CUBE.vertices)
    assert again.face_colors is not None
    assert again.face_parts is not None
    order = np.argsort(parts, kind="stable")  # faces are written part by part
    assert np.array_equal(corners(again), corners(mesh)[order])
    assert np.array_equal(again.face_colors, colors[order])
    assert np.array_equal(again.face_parts, parts[order])


@pytest.mark.parametrize(
    "text",
    [
        TRIANGLE + "f 1 2 3\n",
        TRIANGLE + "f -3 -2 -1\n",
        "\ufeff" + TRIANGLE + "f 1/1/1 2//2 3\n",
        TRIANGLE.replace("\n", "\r\n") + "f 1 2 \\\r\n3\r\n",
        TRIANGLE + "v 9 9 9\nf 1 2 3 # the unused vertex is dropped\nl 1 4\n",
        TRIANGLE + "f 1 2 3\nf 1 1 2\n",
    ],
)
def test_obj_dialects_give_the_same_triangle(text: str, tmp_path: Path) -> None:
    mesh = load(tmp_path, "a.obj", text)
    assert np.array_equal(corners(mesh), [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    assert len(mesh.vertices) == 3


def test_obj_in_latin_1_and_polygons(tmp_path: Path) -> None:
    text = "# H\xfclle\no K\xf6rper\n" + TRIANGLE + "v 1 1 0\nf 1 2 4 3\n"
    mesh = load(tmp_path, "a.obj", text.encode("latin-1"))
    assert len(mesh.faces) == 2


def test_obj_material_and_texture_colours(tmp_path: Path) -> None:
    picture = np.zeros((2, 2, 3), dtype=np.uint8)
    picture[0, 0], picture[1, 1] = (9, 8, 7), (200, 100, 50)  # upper left, lower right
    Image.fromarray(picture).save(tmp_path / "skin.png")
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0.2\nnewmtl skin\nmap_Kd skin.png\n")
    uvs = "vt 0.1 0.9\nvt 0.2 0.9\nvt 0.1 0.8\nvt 1.9 0.1\nvt 1.8 0.1\nvt 1.9 0.2\n"
    faces = "usemtl red\nf 1 2 3\nusemtl skin\nf 1/1 2/2 4/3\nf 2/4 3/5 4/6\nusemtl none\nf 1 3 4\n"
    mesh = load(tmp_path, "a.obj", "mtllib a.mtl\n" + TRIANGLE + "v 0 0 1\n" + uvs + faces)
    assert mesh.face_colors is not None
    expected = [[255, 0, 51], [9, 8, 7], [200, 100, 50], [204, 204, 204]]
    assert mesh.face_colors.tolist() == expected


def test_obj_opens_no_material_outside_its_folder(tmp_path: Path) -> None:
    (tmp_path / "secret.mtl").write_text("newmtl red\nKd 1 0 0\n")
    inner = tmp_path / "inner"
    inner.mkdir()
    for name in ("../secret.mtl", str(tmp_path / "secret.mtl"), "none.mtl", "/dev/zero"):
        text = f"mtllib {name}\n{TRIANGLE}usemtl red\nf 1 2 3\n"
        assert load(inner, "a.obj", text).face_colors is None


@pytest.mark.parametrize("kind", ["ply", "glb"])
def test_vertex_colours_become_face_colours(kind: str, tmp_path: Path) -> None:
    colored: Any = trimesh.Trimesh(CUBE.vertices, CUBE.faces, process=False)
    colored.visual.vertex_colors = np.tile([0, 255, 0, 255], (len(CUBE.vertices), 1))
    mesh = load(tmp_path, f"a.{kind}", exported(colored, kind))
    assert mesh.face_colors is not None
    assert (mesh.face_colors == (0, 255, 0)).all()


def test_gltf_applies_transforms_and_names_parts(tmp_path: Path) -> None:
    half = 0.5**0.5
    document = gltf(
        ONE_NODE
        | {
            "nodes": [
                {"children": [1, 2], "translation": [10, 0, 0]},
                {"mesh": 0, "name": "arm", "rotation": [0, 0, half, half]},
                {"mesh": 0, "name": "leg", "scale": [-2, 2, 2]},
            ]
        },
        POINTS,
        FACES,
    )
    mesh = load(tmp_path, "a.gltf", json.dumps(document))
    assert mesh.part_names == ("arm", "leg")
    turned = np.stack([10 - POINTS[:, 1], POINTS[:, 0], POINTS[:, 2]], axis=1)
    mirrored = POINTS * [-2, 2, 2] + [10, 0, 0]
    faces = FACES.reshape(-1, 3)
    np.testing.assert_allclose(corners(mesh)[:2], turned[faces], atol=1e-12)
    np.testing.assert_allclose(corners(mesh)[2:], mirrored[faces[:, ::-1]], atol=1e-12)


def test_gltf_colours_are_converted_from_linear_light(tmp_path: Path) -> None:
    linear = ((np.array([0x80, 0x20, 0xF0]) / 255 + 0.055) / 1.055) ** 2.4
    surface = {"pbrMetallicRoughness": {"baseColorFactor": [*linear.tolist(), 1]}}
    document = gltf(ONE_NODE | {"materials": [surface]}, POINTS, FACES)
    document["meshes"][0]["primitives"][0]["material"] = 0
    mesh = load(tmp_path, "a.gltf", json.dumps(document))
    assert mesh.face_colors is not None
    assert (mesh.face_colors == (0x80, 0x20, 0xF0)).all()


def test_gltf_texture_is_sampled(tmp_path: Path) -> None:
    picture = io.BytesIO()
    Image.fromarray(np.array([[[10, 20, 30], [200, 100, 50]]], dtype=np.uint8)).save(picture, "PNG")
    uri = "data:image/png;base64," + base64.b64encode(picture.getvalue()).decode()
    document = gltf(
        {
            **ONE_NODE,
            "images": [{"uri": uri}],
            "textures": [{"source": 0}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            "meshes": [
                {
                    "primitives": [
                        {
                            "attributes": {"POSITION": 0, "TEXCOORD_0": 2},
                            "indices": 1,
                            "material": 0,
                        }
                    ]
                }
            ],
        },
        POINTS,
        FACES,
        np.array([[0.9, 0], [0.9, 1], [0.8, 0.5], [-0.9, 0.5]], dtype=np.float32),
    )
    mesh = load(tmp_path, "a.gltf", json.dumps(document))
    assert mesh.face_colors is not None
    assert mesh.face_colors.tolist() == [[200, 100, 50], [10, 20, 30]]


def test_gltf_skin_is_shown_in_its_rest_pose(tmp_path: Path) -> None:
    inverse = np.eye(4, dtype=np.float32).T.reshape(1, 16)
    joints = np.zeros((4, 4), dtype=np.uint8)
    weights = np.tile(np.array([1, 0, 0, 0], dtype=np.float32), (4, 1))
    document = gltf(
        {
            "scenes": [{"nodes": [0, 1]}],
            "nodes": [
                {"mesh": 0, "skin": 0, "translation": [99, 99, 99]},
                {"translation": [0, 5, 0], "scale": [2, 2, 2]},
            ],
            "skins": [{"joints": [1], "inverseBindMatrices": 2}],
            "meshes": [
                {
                    "primitives": [
                        {
                            "attributes": {"POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 4},
                            "indices": 1,
                        }
                    ]
                }
            ],
        },
        POINTS,
        FACES,
        inverse,
        joints,
        weights,
    )
    mesh = load(tmp_path, "a.gltf", json.dumps(document))
    np.testing.assert_allclose(corners(mesh), (2 * POINTS + [0, 5, 0])[FACES.reshape(-1, 3)])


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
    "point cloud": ("a.obj", TRIANGLE, r"has 3 vertices but no faces \(a point cloud\)"),
    "lines": ("a.obj", TRIANGLE + "l 1 2\n", "but no faces"),
    "nan": ("a.obj", "v nan 0 0\n" + TRIANGLE + "f 1 2 3\n", "1 of 4 vertices are NaN"),
    "inf": ("a.obj", "v 0 inf 0\n" + TRIANGLE + "f 2 3 4\n", "1 of 4 vertices are NaN or inf"),
    "overflow": ("a.obj", "v 1e999 0 0\n" + TRIANGLE + "f 2 3 4\n", "1 of 4 vertices are NaN"),
    "huge": (
        "a.obj",
        "v 1e308 0 0\nv -1e308 0 0\nv 0 1 0\nf 1 2 3\n",
        r"coordinates up to 1e\+308 world units",
    ),
    "far": ("a.obj", TRIANGLE + "v 1e7 0 0\nf 1 2 4\nf 1 2 3\n", "extent 1e.07 world units"),
    "index 0": ("a.obj", TRIANGLE + "f 0 1 2\n", "line 4: 'f 0 1 2': face index 0, but OBJ counts"),
    "index high": ("a.obj", TRIANGLE + "f 1 2 9\n", "refers to vertex 8, but the file has 3"),
    "index low": ("a.obj", TRIANGLE + "f -9 1 2\n", "line 4: .* face index -9, but only 3 came"),
    "index word": ("a.obj", TRIANGLE + "f a b c\n", "line 4: 'f a b c': not a face index"),
    "two corners": ("a.obj", TRIANGLE + "f 1 2\n", "a face with 2 corners"),
    "comma": ("a.obj", "v 1,5 0 0\n", "line 1: 'v 1,5 0 0': not a number"),
    "short": ("a.obj", "v 1 0\n", "line 1: .*2 numbers, 3 are needed"),
    "cut obj": ("a.obj", (TRIANGLE + "f 1 2 3\nv 1 2")[:], "line 5: .*2 numbers"),
    "degenerate": ("a.obj", TRIANGLE + "f 1 1 2\n", "every face is a line or a point"),
    "flat point": ("a.obj", "v 0 0 0\n" * 3 + "f 1 2 3\n", "every face is a line or a point"),
    "huge ply": ("a.ply", HUGE_PLY, "announces 2,000,000,000 vertices, at most 15,000,000"),
    "cut ply": ("a.ply", PLY[: len(PLY) // 2], "PLY file is damaged or cut off"),
    "cut ascii ply": ("a.ply", ASCII_PLY[: len(ASCII_PLY) // 2], "cut off"),
    "cloud ply": ("a.ply", exported(CLOUD, "ply"), "but no faces"),
    "empty ply": ("a.ply", "ply\n", "PLY file is damaged|has no faces"),
    "cut stl": ("a.stl", STL[:500], r"STL file is cut off \(500 bytes for 48 faces\)"),
    "short stl": ("a.stl", STL[:60], "STL file is cut off"),
    "text stl": ("a.stl", "hello\n" * 40, "has no faces"),
    "ascii stl without faces": ("a.stl", "solid a\nendsolid a\n", "STL|no faces"),
    "huge off": ("a.off", "OFF\n2000000000 5 0\n0 0 0\n", "announces 2,000,000,000 vertices"),
    "cut off file": ("a.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n", "OFF file is damaged|cut off"),
    "text off": ("a.off", "hello", "OFF file is damaged"),
    "cut glb": ("a.glb", GLB[: len(GLB) // 2], "GLB file is cut off"),
    "cut glb header": ("a.glb", GLB[:10], "GLB file is cut off"),
    "glb 1": ("a.glb", b"glTF\1\0\0\0" + bytes(40), "GLB version 1"),
    "glb without json": (
        "a.glb",
        struct.pack("<4sII", b"glTF", 2, 20) + bytes(8),
        "has no description",
    ),
    "json": ("a.gltf", "[1, 2]", "is JSON but no glTF"),
    "not json": ("a.gltf", "{", "its glTF description is damaged"),
    "deep json": ("a.gltf", "[" * 100_000, "description is damaged"),
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
        "announces 2000000000 items",
    ),
    "gltf long count": ("a.gltf", edited({}, {"count": 1000}), "glTF data is cut off"),
    "gltf negative offset": ("a.gltf", edited({}, {"byteOffset": -8}), "glTF data is cut off"),
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
    "gltf no mesh": ("a.gltf", edited({"nodes": [{}]}), "has no faces"),
    "gltf missing key": ("a.gltf", edited({"meshes": [{}]}), "glTF file is damaged .KeyError"),
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
    with pytest.raises(MeshError, match="announces 11 faces, at most 10 are read"):
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
