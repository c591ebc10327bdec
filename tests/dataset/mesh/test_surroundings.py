"""What nobody sees of a mesh, or what a figure only stands on, is left out, and said."""

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.dataset.mesh.figure import (
    BOXES,
    FLOOR,
    box_points,
    level,
    obj_text,
    scene,
    strand_picture,
    upright,
)
from tests.dataset.mesh.mesh_files import load
from toonset.errors import MeshError
from toonset.mesh import Mesh

FACES, TALL, WIDE = 12 * len(BOXES), 1.7, 0.82
TURN = np.array([[np.cos(0.5), 0, np.sin(0.5)], [0, 1, 0], [-np.sin(0.5), 0, np.cos(0.5)]])


def is_figure(mesh: Mesh) -> bool:
    extents = mesh.bounds[1] - mesh.bounds[0]
    return len(mesh.faces) == FACES and np.allclose(extents[:2], [0.82 - 0.02, TALL], atol=0.03)


SURROUNDINGS = {
    "floor": [("Plane", level(4))],
    "floor just below the feet": [("Plane", level(4, -0.01))],
    "deep floor": [("Plane", level(3, -2.0))],
    "backdrop": [("Back", upright(4, -2))],
    "backdrop in front": [("Back", upright(4, 2))],
    "turned backdrop": [("Back", upright(3, -2) @ TURN.T)],
    "huge backdrop": [("Back", upright(8, -3))],
    "floor and backdrop": [("Plane", level(5)), ("Back", upright(5, -3))],
    "round floor": [
        (
            "Disc",
            np.array([[2 * np.cos(a), 0, 2 * np.sin(a)] for a in np.arange(40) / 40 * 2 * np.pi]),
        )
    ],
}


@pytest.mark.parametrize("objects", [True, False])
@pytest.mark.parametrize("kind", SURROUNDINGS)
def test_floors_and_backdrops_are_left_out(kind: str, objects: bool, tmp_path: Path) -> None:
    mesh = load(tmp_path, "a.obj", obj_text(SURROUNDINGS[kind], objects=objects))
    assert is_figure(mesh)
    (said,) = mesh.remarks
    assert said.startswith("a.obj: left out ")
    assert said.endswith(": flat, and wider than the rest is tall")
    if objects:
        assert all(name in said for name, _ in SURROUNDINGS[kind])
        assert set(mesh.part_names) == set(BOXES)


def test_a_slab_of_many_pieces_is_left_out_as_one_part(tmp_path: Path) -> None:
    tiles = [np.add(level(0.9), (2 * x, -0.02, 2 * z)) for x in (-1, 0, 1) for z in (-1, 0, 1)]
    text = obj_text()
    start = text.count("\nv ") + text.startswith("v ")
    text += "o tiles\n"
    for tile in tiles:
        text += "".join("v " + " ".join(map(str, p)) + "\n" for p in tile.tolist())
        text += "f " + " ".join(str(start + i) for i in range(1, 5)) + "\n"
        start += 4
    assert is_figure(load(tmp_path, "a.obj", text))


KEPT = {
    "pedestal": [("Base", level(0.6))],
    "pedestal as wide as the figure is tall": [("Base", level(TALL / 2 - 0.01))],
    "wings": [
        (
            "Wings",
            np.array([[-1.2, 0.6, -0.2], [1.2, 0.6, -0.2], [1.2, 1.7, -0.2], [-1.2, 1.7, -0.2]]),
        )
    ],
    "sword": [("Sword", np.array([[0.6, 1, 0.1], [0.7, 1, 0.1], [0.7, 1, 3], [0.6, 1, 3]]))],
    "board through the middle": [("Board", level(2, 0.85))],
    "ceiling": [("Top", level(2, 1.7))],
}


@pytest.mark.parametrize("kind", KEPT)
def test_what_is_no_floor_stays(kind: str, tmp_path: Path) -> None:
    mesh = load(tmp_path, "a.obj", obj_text(KEPT[kind]))
    assert len(mesh.faces) == FACES + 2
    assert not any("left out" in said for said in mesh.remarks)


def test_a_mesh_of_sheets_alone_stays_whole(tmp_path: Path) -> None:
    text = (
        "".join("v " + " ".join(map(str, p)) + "\n" for p in upright(1, 0).tolist()) + "f 1 2 3 4\n"
    )
    assert len(load(tmp_path, "a.obj", text).faces) == 2


def invisible(**said: Any) -> str:
    return scene((upright(0.7, -0.4), {"name": "extra", **said}))


def test_hidden_nodes_and_what_is_below_them_are_left_out(tmp_path: Path) -> None:
    shut = {"extensions": {"KHR_node_visibility": {"visible": False}}}
    assert is_figure(load(tmp_path, "a.gltf", invisible(**shut)))
    below = scene((upright(0.7, -0.4), {"name": "extra"}), (level(0.1), {"children": [1], **shut}))
    mesh = load(tmp_path, "a.gltf", below)
    assert is_figure(mesh)
    assert mesh.remarks == ("a.gltf: left out what is hidden or transparent: extra",)
    seen = invisible(extensions={"KHR_node_visibility": {"visible": True}})
    assert len(load(tmp_path, "a.gltf", seen).faces) == FACES + 2


@pytest.mark.parametrize(
    ("mode", "alpha", "is_seen"),
    [
        ("BLEND", 0.0, False),
        ("MASK", 0.0, False),
        ("MASK", 0.4, False),
        ("MASK", 0.6, True),
        ("BLEND", 0.3, True),
        ("OPAQUE", 0.0, True),
    ],
)
def test_transparent_materials_are_left_out(
    mode: str, alpha: float, is_seen: bool, tmp_path: Path
) -> None:
    surface = {"baseColorFactor": [1, 0, 0, alpha]}
    material = {"name": "glass", "alphaMode": mode, "pbrMetallicRoughness": surface}
    text = scene((upright(0.7, -0.4), {"primitive": {"material": 0}}), materials=[material])
    mesh = load(tmp_path, "a.gltf", text)
    assert len(mesh.faces) == FACES + (2 if is_seen else 0)
    assert any("glass" in said for said in mesh.remarks) is not is_seen


def test_a_file_of_nothing_that_is_seen_says_so(tmp_path: Path) -> None:
    material = {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}}
    text = scene(materials=[material]).replace('"indices": 1}', '"indices": 1, "material": 0}')
    with pytest.raises(MeshError, match="all of it is hidden or transparent"):
        load(tmp_path, "a.gltf", text)


CARD = [(-0.8, 0.4, -0.2), (0.8, 0.4, -0.2), (0.8, 1.7, -0.2), (-0.8, 1.7, -0.2)]
CARD_UV = [(0, 1), (1, 1), (1, 0), (0, 0)]


@pytest.mark.parametrize("mode", ["MASK", "BLEND"])
def test_hair_cards_are_cut_along_their_strands(mode: str, tmp_path: Path) -> None:
    picture = io.BytesIO()
    strand_picture().save(picture, "PNG")
    uri = "data:image/png;base64," + base64.b64encode(picture.getvalue()).decode()
    surface = {"baseColorTexture": {"index": 0}}
    text = scene(
        (np.array(CARD), {"primitive": {"material": 0}, "uv": CARD_UV}),
        images=[{"uri": uri}],
        textures=[{"source": 0}],
        materials=[{"name": "hair", "alphaMode": mode, "pbrMetallicRoughness": surface}],
    )
    mesh = load(tmp_path, "a.gltf", text)
    strand = mesh.vertices[np.unique(mesh.faces[FACES:])]
    np.testing.assert_allclose(np.abs(strand[:, 0]).max(), 0.2, atol=0.06)  # a piece is 0.1 wide
    np.testing.assert_allclose(np.ptp(strand[:, 1]), 1.3, atol=1e-6)
    assert mesh.face_colors is not None
    assert (mesh.face_colors[FACES:] == (124, 72, 48)).all()
    assert mesh.remarks == ("a.gltf: left out what is hidden or transparent: parts of hair",)
    opaque = text.replace(f'"alphaMode": "{mode}"', '"alphaMode": "OPAQUE"')
    assert len(load(tmp_path, "a.gltf", opaque).faces) == FACES + 2


@pytest.mark.parametrize(
    ("said", "is_seen"),
    [
        ("d 0", False),
        ("Tr 1", False),
        ("d 0.0\nTr 0", False),
        ("d 1\nTr 1", True),
        ("Tr 1\nd 1", True),
        ("d 0.4", True),
        ("Tr 0", True),
        ("", True),
    ],
)
def test_transparent_obj_materials_are_left_out(said: str, is_seen: bool, tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text(f"newmtl extra\nKd 1 0 0\n{said}\nnewmtl head\nKd 0 1 0\n")
    text = "mtllib a.mtl\n" + obj_text([("extra", upright(0.7, -0.4))])
    mesh = load(tmp_path, "a.obj", text)
    assert len(mesh.faces) == FACES + (2 if is_seen else 0)
    if not is_seen:
        assert mesh.remarks == ("a.obj: left out what is transparent of extra",)


def test_a_mesh_that_would_vanish_is_seen(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("".join(f"newmtl {name}\nTr 1\n" for name in BOXES))
    assert len(load(tmp_path, "a.obj", "mtllib a.mtl\n" + obj_text()).faces) == FACES


@pytest.mark.parametrize("alpha", ["alpha", "grey"])
def test_obj_hair_cards_are_cut_by_map_d(alpha: str, tmp_path: Path) -> None:
    picture = strand_picture()
    (picture if alpha == "alpha" else picture.getchannel("A")).save(tmp_path / "mask.png")
    (tmp_path / "a.mtl").write_text("newmtl hair\nKd 1 0 0\nmap_d mask.png\n")
    points = "".join("v " + " ".join(map(str, p)) + "\n" for p in CARD)
    uvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    box = "".join("v " + " ".join(map(str, p)) + "\n" for p in box_points(BOXES["torso"]).tolist())
    text = f"mtllib a.mtl\n{points}{uvs}usemtl hair\nf 1/1 2/2 3/3 4/4\n{box}usemtl x\nf 5 6 8 7\n"
    mesh = load(tmp_path, "a.obj", text)
    hair = mesh.vertices[np.unique(mesh.faces[:-2])]
    np.testing.assert_allclose(np.abs(hair[:, 0]).max(), 0.2, atol=0.06)
    assert mesh.face_colors is not None
    assert (mesh.face_colors[:-2] == (255, 0, 0)).all()


def test_a_floor_hides_no_feet(tmp_path: Path) -> None:
    text = obj_text([("Plane", level(FLOOR[1][0]))])
    bare, floored = load(tmp_path, "a.obj", obj_text()), load(tmp_path, "b.obj", text)
    np.testing.assert_array_equal(
        np.unique(bare.vertices, axis=0), np.unique(floored.vertices, axis=0)
    )
