"""Meshes: exact coordinates, colours and parts come in, from every format."""

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from tests.dataset.mesh.mesh_files import (
    CUBE,
    FACES,
    ONE_NODE,
    POINTS,
    TRIANGLE,
    exported,
    gltf,
    load,
    one_primitive,
)
from toonset.dataset.mesh.load import load_mesh, save_obj
from toonset.mesh import Mesh


def corners(mesh: Mesh) -> np.ndarray:
    return mesh.vertices[mesh.faces]


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
    nodes = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "name": "arm", "rotation": [0, 0, half, half]},
        {"mesh": 0, "name": "leg", "scale": [-2, 2, 2]},
    ]
    document = gltf(ONE_NODE | {"nodes": nodes}, POINTS, FACES)
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
    painted = ONE_NODE | {"materials": [surface], "meshes": one_primitive(material=0)}
    mesh = load(tmp_path, "a.gltf", json.dumps(gltf(painted, POINTS, FACES)))
    assert mesh.face_colors is not None
    assert (mesh.face_colors == (0x80, 0x20, 0xF0)).all()


def test_gltf_texture_is_sampled(tmp_path: Path) -> None:
    picture = io.BytesIO()
    Image.fromarray(np.array([[[10, 20, 30], [200, 100, 50]]], dtype=np.uint8)).save(picture, "PNG")
    uri = "data:image/png;base64," + base64.b64encode(picture.getvalue()).decode()
    surface = {
        "images": [{"uri": uri}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": one_primitive(TEXCOORD_0=2, material=0),
    }
    uv = np.array([[0.9, 0], [0.9, 1], [0.8, 0.5], [-0.9, 0.5]], dtype=np.float32)
    mesh = load(tmp_path, "a.gltf", json.dumps(gltf(ONE_NODE | surface, POINTS, FACES, uv)))
    assert mesh.face_colors is not None
    assert mesh.face_colors.tolist() == [[200, 100, 50], [10, 20, 30]]


def test_gltf_skin_is_shown_in_its_rest_pose(tmp_path: Path) -> None:
    inverse = np.eye(4, dtype=np.float32).T.reshape(1, 16)
    joints = np.zeros((4, 4), dtype=np.uint8)
    weights = np.tile(np.array([1, 0, 0, 0], dtype=np.float32), (4, 1))
    skinned = {
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"mesh": 0, "skin": 0, "translation": [99, 99, 99]},
            {"translation": [0, 5, 0], "scale": [2, 2, 2]},
        ],
        "skins": [{"joints": [1], "inverseBindMatrices": 2}],
        "meshes": one_primitive(JOINTS_0=3, WEIGHTS_0=4),
    }
    document = gltf(skinned, POINTS, FACES, inverse, joints, weights)
    mesh = load(tmp_path, "a.gltf", json.dumps(document))
    np.testing.assert_allclose(corners(mesh), (2 * POINTS + [0, 5, 0])[FACES.reshape(-1, 3)])


def test_equal_faces_are_one_and_two_sides_are_two(tmp_path: Path) -> None:
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    faces = "f 1 2 3\nf 2 3 1\nf 1 3 2\nf 1 2 4\nf 3 1 2\n"
    (tmp_path / "a.obj").write_text(corners + faces)
    assert load_mesh(tmp_path / "a.obj").faces.tolist() == [[0, 1, 2], [0, 2, 1], [0, 1, 3]]
