"""Colours come from the file that is meant, however it is named, and what is missing is said."""

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.dataset.mesh.figure import BOXES, COLORS, obj_text, rgb_of
from tests.dataset.mesh.mesh_files import (
    FACES,
    ONE_NODE,
    POINTS,
    TRIANGLE,
    gltf,
    load,
    one_primitive,
)
from tests.dataset.mesh.test_polygons import check_colors
from toonset.dataset.mesh.mtl import read_map
from toonset.dataset.mesh.obj import material_files
from toonset.errors import MeshError
from toonset.mesh import Mesh

TEAL, RED, BLUE = (38, 138, 140), (217, 84, 48), (46, 58, 104)
UVS = "vt 0.4 0.4\nvt 0.45 0.4\nvt 0.4 0.45\n"


def picture(path: Path, *rgb: tuple[int, int, int]) -> None:
    """Write a picture with one column per colour."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.array([rgb], dtype=np.uint8)).save(path)


def textured(tmp_path: Path, line: str, mtl: str = "a.mtl", library: str = "a.mtl") -> Mesh:
    """Return a triangle whose material holds a line."""
    (tmp_path / mtl).write_text(f"newmtl skin\nKd 1 1 1\n{line}\n", encoding="utf-8")
    faces = "usemtl skin\nf 1/1 2/2 3/3\n"
    return load(tmp_path, "a.obj", f"mtllib {library}\n{TRIANGLE}{UVS}{faces}")


def color_of(mesh: Mesh) -> tuple[int, ...] | None:
    return None if mesh.face_colors is None else tuple(mesh.face_colors[0].tolist())


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("tex.png", "map_Kd tex.png"),
        ("tex.png", "map_KD tex.png"),
        ("tex.png", "MAP_KD  tex.png  "),
        ("tex.png", "\tmap_Kd\ttex.png"),
        ("tex.png", "map_Kd TEX.PNG"),
        ("Tex.PNG", "map_Kd tex.png"),
        ("body tex.png", "map_Kd body tex.png"),
        ("body  tex.png", "map_Kd body  tex.png"),
        ("body tex.png", 'map_Kd "body tex.png"'),
        ("body tex.png", "map_Kd body%20tex.png"),
        ("tex.png", r"map_Kd C:\work\char\tex.png"),
        ("textures/tex.png", r"map_Kd C:\work\char\textures\tex.png"),
        ("textures/tex.png", r"map_Kd Textures\Tex.png"),
        ("tex.png", "map_Kd /shows/artist/char/tex.png"),
        ("tex.png", "map_Kd //server/share/tex.png"),
        ("tex.png", "map_Kd ../textures/tex.png"),
        ("tex.png", "map_Kd ./tex.png"),
        ("körper.png", "map_Kd körper.png"),
        ("ko\u0308rper.png", "map_Kd k\u00f6rper.png"),
        ("tex.png", "map_Kd -clamp on -bm 0.5 -blendu off tex.png"),
        ("my tex.png", "map_Kd -o 0 0 0 -s 1 1 1 -mm 0 1 my tex.png"),
        ("2 tex.png", "map_Kd -s 1 1 1 2 tex.png"),
        ("-odd.png", "map_Kd -odd.png"),
    ],
)
def test_a_texture_is_found_however_it_is_named(file: str, line: str, tmp_path: Path) -> None:
    picture(tmp_path / file, TEAL)
    if file != "tex.png":
        picture(tmp_path / "zzz.png", RED)
    mesh = textured(tmp_path, line)
    assert color_of(mesh) == TEAL
    assert mesh.remarks == ()


def test_the_texture_that_is_named_is_not_another(tmp_path: Path) -> None:
    picture(tmp_path / "tex.png", RED)
    picture(tmp_path / "body tex.png", BLUE)
    assert color_of(textured(tmp_path, "map_Kd body tex.png")) == BLUE
    (tmp_path / "body tex.png").unlink()
    mesh = textured(tmp_path, "map_Kd body tex.png")
    assert color_of(mesh) == (255, 255, 255)
    assert mesh.remarks == (
        "a.obj: names files that are not beside it: body tex.png; their colours are lost",
    )


@pytest.mark.parametrize(
    ("line", "rgb"),
    [
        ("map_Kd -o 0.5 0 tex.png", TEAL),
        ("map_Kd -s 2 1 1 tex.png", TEAL),
        ("map_Kd -s 0.5 tex.png", RED),
        ("map_Kd tex.png", RED),
    ],
)
def test_options_move_the_texture(line: str, rgb: tuple[int, ...], tmp_path: Path) -> None:
    picture(tmp_path / "tex.png", RED, TEAL)
    assert color_of(textured(tmp_path, line)) == rgb


def test_options_of_a_map() -> None:
    assert read_map("-s 2 3 -o 0.5 a.png") is not None
    assert read_map("-s 2 3 -o 0.5 a.png").__dict__ == {
        **{"name": "a.png", "scale": (2.0, 3.0), "offset": (0.5, 0.0)}
    }
    assert read_map("-bm 1") is None
    assert read_map("") is None


@pytest.mark.parametrize(
    ("mtl", "library"),
    [
        ("my lib.mtl", "my lib.mtl"),
        ("my lib.mtl", '"my lib.mtl"'),
        ("a.mtl", "none.mtl a.mtl"),
        ("a.mtl", "a.mtl none.mtl"),
        ("a.mtl", r"C:\work\a.mtl"),
        ("a.mtl", "/shows/artist/a.mtl"),
        ("A.MTL", "a.mtl"),
        ("a.mtl", "a.mtl # of the old one"),
        ("a.mtl", "./a.mtl"),
    ],
)
def test_a_library_is_found_however_it_is_named(mtl: str, library: str, tmp_path: Path) -> None:
    picture(tmp_path / "tex.png", TEAL)
    mesh = textured(tmp_path, "map_Kd tex.png", mtl, library)
    assert color_of(mesh) == TEAL
    assert len(mesh.remarks) == ("none" in library)


def test_several_libraries(tmp_path: Path) -> None:
    lines = [
        f"newmtl {name}\nKd " + " ".join(str(c / 255) for c in rgb_of(name)) for name in COLORS
    ]
    (tmp_path / "a.mtl").write_text("\n".join(lines[:2]))
    (tmp_path / "b b.mtl").write_text("\n".join(lines[2:]))
    for names in ("mtllib a.mtl b b.mtl\n", "mtllib a.mtl\nmtllib b b.mtl\n"):
        check_colors(load(tmp_path, "a.obj", names + obj_text()))


def test_missing_libraries_are_said_in_one_line(tmp_path: Path) -> None:
    names = "".join(f"mtllib {number}.mtl\n" for number in range(5))
    mesh = load(tmp_path, "a.obj", names + obj_text())
    assert mesh.face_colors is None
    assert mesh.remarks == (
        "a.obj: names files that are not beside it: 0.mtl, 1.mtl, 2.mtl and 2 more; their colours "
        "are lost",
    )


@pytest.mark.parametrize("used", ["Skin", "SKIN", "Skin #2", "Skin # the new one"])
def test_material_names(used: str, tmp_path: Path) -> None:
    name = used if "#2" in used else "Skin"
    (tmp_path / "a.mtl").write_text(f"newmtl {name}\nkd 1 0 0\n")
    mesh = load(tmp_path, "a.obj", f"mtllib a.mtl\n{TRIANGLE}usemtl {used}\nf 1 2 3\n")
    assert color_of(mesh) == (255, 0, 0)


def test_mtl_in_latin_1_and_with_a_byte_order_mark(tmp_path: Path) -> None:
    for encoding in ("latin-1", "utf-8-sig", "utf-16"):
        (tmp_path / "a.mtl").write_bytes("newmtl Körper\nKd 1 0 0\n".encode(encoding))
        text = f"mtllib a.mtl\n{TRIANGLE}usemtl Körper\nf 1 2 3\n"
        assert color_of(load(tmp_path, "a.obj", text.encode("latin-1"))) == (255, 0, 0)


def test_mtl_that_glows(tmp_path: Path) -> None:
    picture(tmp_path / "tex.png", TEAL)
    for lines, rgb in (
        ("Kd 0 0 0\nKe 1 0 0", (255, 0, 0)),
        ("Kd 0 0 0\nmap_Ke tex.png", TEAL),
        ("Kd 0 1 0\nKe 1 0 0", (0, 255, 0)),
        ("Kd 0 0 0\nKe 0 0 0", (0, 0, 0)),
    ):
        assert color_of(textured(tmp_path, lines)) == rgb


def tinted(*more: float, scale: float = 1.0, white: bool = False) -> str:
    """Return the figure with colours of its vertices, and more numbers behind them."""
    names = [name for name in BOXES for _ in range(8)]
    lines = []
    for line in obj_text().splitlines():
        if line.startswith("v "):
            rgb = [255 * scale] * 3 if white else [c * scale for c in rgb_of(names[len(lines)])]
            lines.append(line)
            line = " ".join([line, *(f"{c:.6g}" for c in (*rgb, *more))])
            lines[-1] = line
    rest = [line for line in obj_text().splitlines() if not line.startswith("v ")]
    return "\n".join([*lines, *rest]) + "\n"


@pytest.mark.parametrize(
    ("more", "scale"), [((), 1 / 255), ((1,), 1 / 255), ((), 1), ((255,), 1), ((0.5,), 1 / 255)]
)
def test_obj_vertex_colours_with_and_without_alpha(
    more: tuple[float, ...], scale: float, tmp_path: Path
) -> None:
    check_colors(load(tmp_path, "a.obj", tinted(*more, scale=scale)))


def test_white_vertices_leave_the_materials_their_colours(tmp_path: Path) -> None:
    lines = [
        f"newmtl {name}\nKd " + " ".join(str(c / 255) for c in rgb_of(name)) for name in COLORS
    ]
    (tmp_path / "a.mtl").write_text("\n".join(lines))
    check_colors(load(tmp_path, "a.obj", "mtllib a.mtl\n" + tinted(scale=1 / 255, white=True)))


def test_files_that_are_fetched_with_a_mesh() -> None:
    files = {
        "a.mtl": b"newmtl x\nmap_Kd -s 1 1 body tex.png\nmap_d gone.png\n",
        "body tex.png": b"",
    }
    text = b"# mtllib no.mtl\nmtllib none.mtl a.mtl\nmtllib gone.mtl\n"
    found = material_files(text, lambda name: name if name in files else None, files.__getitem__)
    assert found == ["a.mtl", "body tex.png"]


def uri_of(kind: str = "PNG") -> str:
    """Return a picture as a data URI: red on the left, teal on the right."""
    data = io.BytesIO()
    Image.fromarray(np.array([[RED, TEAL]] * 2, dtype=np.uint8).repeat(8, 0).repeat(8, 1)).save(
        data, kind, lossless=True
    )
    return "data:image/x;base64," + base64.b64encode(data.getvalue()).decode()


def painted(
    material: dict[str, Any], tmp_path: Path, kind: str = "PNG", *, root: Any = None
) -> Mesh:
    """Return a mesh whose texture coordinates lie on the left, second ones on the right."""
    left = np.array([[0.2, 0.5], [0.3, 0.5], [0.25, 0.4], [0.2, 0.4]], dtype=np.float32)
    document = {
        "images": [{"uri": uri_of(kind)}],
        "textures": [{"source": 0}],
        "materials": [material],
        "meshes": one_primitive(TEXCOORD_0=2, TEXCOORD_1=3, material=0),
        **(root or {}),
    }
    arrays = (POINTS, FACES, left, left + np.array([0.5, 0], dtype=np.float32))
    return load(tmp_path, "a.gltf", json.dumps(gltf(ONE_NODE | document, *arrays)))


def moved(**said: Any) -> dict[str, Any]:
    extensions = {"extensions": {"KHR_texture_transform": said}}
    return {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **extensions}}}


@pytest.mark.parametrize(
    ("said", "rgb"),
    [
        ({}, RED),
        ({"offset": [0.5, 0]}, TEAL),
        ({"offset": [0, 0.4]}, RED),
        ({"scale": [3, 1]}, TEAL),
        ({"rotation": np.pi}, TEAL),
        ({"rotation": np.pi / 2}, RED),  # u becomes v: 0.4 to 0.5
        ({"rotation": -np.pi / 2}, TEAL),  # u becomes -v
        ({"rotation": np.pi / 2, "offset": [0.2, 0]}, TEAL),
        ({"rotation": np.pi / 2, "scale": [1, 1.5]}, TEAL),  # scaled first
        ({"texCoord": 1}, TEAL),
        ({"texCoord": 1, "offset": [0.5, 0]}, RED),
    ],
)
def test_gltf_texture_transform(said: dict[str, Any], rgb: tuple[int, ...], tmp_path: Path) -> None:
    assert color_of(painted(moved(**said), tmp_path)) == rgb


TEXTURED = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}


def test_gltf_webp_and_other_textures(tmp_path: Path) -> None:
    webp = {"textures": [{"extensions": {"EXT_texture_webp": {"source": 0}}}]}
    assert color_of(painted(TEXTURED, tmp_path, "WEBP", root=webp)) == RED
    both = {"textures": [{"source": 0, "extensions": {"KHR_texture_basisu": {"source": 7}}}]}
    assert color_of(painted(TEXTURED, tmp_path, root=both)) == RED
    for name in ("KHR_texture_basisu", "MSFT_texture_dds"):
        alone = {"textures": [{"extensions": {name: {"source": 0}}}]}
        with pytest.raises(MeshError, match=f"has textures of {name}, which are not read"):
            painted(TEXTURED, tmp_path, root=alone)
    assert color_of(painted(TEXTURED, tmp_path, root={"textures": [{}]})) == (255, 255, 255)


SPECULAR = "KHR_materials_pbrSpecularGlossiness"
LINEAR_RED = (((np.array(RED) / 255 + 0.055) / 1.055) ** 2.4).tolist()


@pytest.mark.parametrize(
    ("material", "rgb"),
    [
        ({"extensions": {SPECULAR: {"diffuseFactor": [*LINEAR_RED, 1]}}}, RED),
        ({"extensions": {SPECULAR: {"diffuseTexture": {"index": 0, "texCoord": 1}}}}, TEAL),
        ({"extensions": {SPECULAR: {}}}, (255, 255, 255)),
        (
            {
                "extensions": {
                    SPECULAR: {"diffuseFactor": [0, 0, 0, 1], "specularFactor": LINEAR_RED}
                }
            },
            RED,
        ),
        (
            {
                "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
                "emissiveFactor": LINEAR_RED,
            },
            RED,
        ),
        ({"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0, "texCoord": 1}}, TEAL),
        (
            {
                "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
                "emissiveFactor": [1, 1, 1],
                "emissiveTexture": {"index": 0},
            },
            RED,
        ),
        ({**TEXTURED, "emissiveFactor": [0.2, 0.2, 0.2]}, RED),
        ({"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}}, (0, 0, 0)),
        ({}, (255, 255, 255)),
        ({"extensions": {"KHR_materials_unlit": {}}, **TEXTURED}, RED),
    ],
)
def test_gltf_materials(material: dict[str, Any], rgb: tuple[int, ...], tmp_path: Path) -> None:
    assert color_of(painted(material, tmp_path)) == rgb
