"""Polygons of any shape and size become the triangles that cover them, in every format."""

import struct
from pathlib import Path

import numpy as np
import pytest

from tests.dataset.mesh.figure import BOXES, COLORS, QUADS, box_points
from tests.dataset.mesh.mesh_files import load
from toonset.dataset.mesh.polygons import triangulate
from toonset.mesh import Mesh

OUTLINES = {
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "arrow": [(0, 0), (2, -1), (1, 0), (2, 1)],
    "arrow from its notch": [(1, 0), (2, 1), (0, 0), (2, -1)],
    "L": [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
    "comb": [
        (0, 0),
        (5, 0),
        (5, 3),
        (4, 3),
        (4, 1),
        (3, 1),
        (3, 3),
        (2, 3),
        (2, 1),
        (1, 1),
        (1, 3),
        (0, 3),
    ],
    "star": [
        ((1 + i % 2) * np.cos(i * np.pi / 5), (1 + i % 2) * np.sin(i * np.pi / 5))
        for i in range(10)
    ],
    "hole through a slit": [
        (0, 0),
        (3, 0),
        (3, 3),
        (0, 3),
        (0, 0),
        (1, 1),
        (1, 2),
        (2, 2),
        (2, 1),
        (1, 1),
    ],
    "corner in a straight edge": [(0, 0), (1, 0), (2, 0), (2, 2), (1, 1), (0, 2)],
}
PLANES = {
    "xy": [[1, 0, 0], [0, 1, 0]],
    "zx": [[0, 0, 1], [1, 0, 0]],
    "tilted": [[0.6, 0, 0.8], [0, 1, 0.3]],
}


def area(points: np.ndarray) -> np.ndarray:
    x, y = points[..., 0], points[..., 1]
    return (x * np.roll(y, -1, axis=-1) - y * np.roll(x, -1, axis=-1)).sum(axis=-1) / 2


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("name", OUTLINES)
def test_a_polygon_is_covered_once(name: str, plane: str, turned: bool) -> None:
    flat = np.array(OUTLINES[name][::-1] if turned else OUTLINES[name], dtype=np.float64)
    found = triangulate(flat @ np.array(PLANES[plane]), np.arange(len(flat)), np.array([len(flat)]))
    assert len(found.corners) == len(flat) - 2
    own = area(flat[found.corners])
    assert (own * area(flat) >= 0).all()  # none is turned over, so none lies upon another
    np.testing.assert_allclose(own.sum(), area(flat))


def test_polygons_of_all_sizes_keep_their_order() -> None:
    sizes = np.array([3, 2, 4, 0, 5, 3, 1])
    points = np.random.default_rng(0).normal(size=(18, 3))
    found = triangulate(points, np.arange(18), sizes)
    assert found.polygons.tolist() == [0, 2, 2, 4, 4, 4, 5]
    assert found.corners[0].tolist() == [0, 1, 2]
    assert found.corners[-1].tolist() == [14, 15, 16]


def test_a_polygon_that_crosses_itself_is_still_divided() -> None:
    points = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0], [0.5, 3, 0]], dtype=np.float64)
    assert len(triangulate(points, np.arange(5), np.array([5])).corners) == 3


@pytest.mark.parametrize("kind", ["obj", "ply", "off"])
def test_concave_polygons_of_files(kind: str, tmp_path: Path) -> None:
    outline = OUTLINES["comb"]
    count, rows = len(outline), "".join(f"{x} {y} 0\n" for x, y in outline)
    indices = " ".join(map(str, range(count)))
    text = {
        "obj": "".join(f"v {row}\n" for row in rows.splitlines())
        + "f "
        + " ".join(map(str, range(1, count + 1)))
        + "\n",
        "ply": f"ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\n"
        "property float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
        f"{rows}{count} {indices}\n",
        "off": f"OFF\n{count} 1 0\n{rows}{count} {indices}\n",
    }[kind]
    mesh = load(tmp_path, f"a.{kind}", text)
    np.testing.assert_allclose(
        area(mesh.vertices[mesh.faces]).sum(), area(np.array(outline, float))
    )
    assert len(mesh.faces) == count - 2


POINTS = np.concatenate([box_points(box) for box in BOXES.values()])
NAMES = [*BOXES]


def polygons(kind: str) -> list[tuple[list[int], list[int]]]:
    """Return the corners and the colour of the figure's faces as quads, triangles, or both."""
    found = []
    for number, name in enumerate(NAMES):
        rgb = list(bytes.fromhex(COLORS[name]))
        for place, quad in enumerate(QUADS):
            own = [8 * number + i for i in quad]
            if kind == "quads" or (kind == "mixed" and place % 2):
                found.append((own, rgb))
            elif kind == "five corners":
                found.append(([*own[:2], own[1], *own[2:]], rgb))
            else:
                found += [([own[0], own[1], own[2]], rgb), ([own[0], own[2], own[3]], rgb)]
    return found


def ply(kind: str, form: str, color: str, name: str = "red green blue", more: str = "") -> bytes:
    """Return the figure with a colour per face; `more` is a property that follows."""
    faces = polygons(kind)
    header = f"ply\nformat {form} 1.0\ncomment by hand\nelement vertex {len(POINTS)}\n"
    header += "".join(f"property double {axis}\n" for axis in "xyz")
    header += f"element face {len(faces)}\nproperty list uchar int vertex_index\n"
    header += "".join(f"property {color} {each}\n" for each in name.split())
    header += f"property {more}\n" if more else ""
    body = b""
    order = ">" if "big" in form else "<"
    scale = {"uchar": 1, "float": 1 / 255, "ushort": 257}[color]
    code = {"uchar": "B", "float": "f", "ushort": "H"}[color]
    for point in POINTS:
        text = " ".join(map(repr, point.tolist())) + "\n"
        body += text.encode() if form == "ascii" else struct.pack(f"{order}3d", *point)
    for own, rgb in faces:
        shown = [value * scale for value in rgb]
        shown = shown if color == "float" else [round(value) for value in shown]
        if form == "ascii":
            words = [len(own), *own, *shown, *([2, 7, 8] if more else [])]
            body += (" ".join(map(str, words)) + "\n").encode()
        else:
            body += struct.pack(f"{order}B{len(own)}i3{code}", len(own), *own, *shown)
            body += struct.pack(f"{order}B2h", 2, 7, 8) if more else b""
    return (header + "end_header\n").encode() + body


def check_colors(mesh: Mesh, slack: int = 0) -> None:
    """Check that the figure has its colours where they belong."""
    assert mesh.face_colors is not None
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    for name, (low, high) in BOXES.items():
        inside = ((middles >= np.array(low) - 1e-6) & (middles <= np.array(high) + 1e-6)).all(
            axis=1
        )
        assert inside.sum() == 12
        rgb = np.array(list(bytes.fromhex(COLORS[name])))
        assert np.abs(mesh.face_colors[inside].astype(int) - rgb).max() <= slack


@pytest.mark.parametrize("color", ["uchar", "float", "ushort"])
@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("kind", ["triangles", "quads", "five corners", "mixed"])
def test_ply_polygons_keep_the_colours_of_their_faces(
    kind: str, form: str, color: str, tmp_path: Path
) -> None:
    mesh = load(tmp_path, "a.ply", ply(kind, form, color))
    assert len(mesh.faces) == 12 * len(BOXES)
    assert len(mesh.vertices) == len(POINTS)
    check_colors(mesh)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_ply_colours_by_another_name_and_lists_besides(form: str, tmp_path: Path) -> None:
    names = "diffuse_red diffuse_green diffuse_blue"
    data = ply("mixed", form, "uchar", names, "list uchar short others")
    check_colors(load(tmp_path, "a.ply", data))


@pytest.mark.parametrize(
    "names", ["red green blue alpha", "diffuse_red diffuse_green diffuse_blue", "r g b"]
)
@pytest.mark.parametrize("kind", ["uchar", "float"])
def test_ply_vertex_colours(names: str, kind: str, tmp_path: Path) -> None:
    header = f"ply\nformat ascii 1.0\nelement vertex {len(POINTS)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += "".join(f"property {kind} {each}\n" for each in names.split())
    faces = polygons("quads")
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = []
    for number, point in enumerate(POINTS.tolist()):
        rgb = [*bytes.fromhex(COLORS[NAMES[number // 8]]), 255][: len(names.split())]
        rows.append([*point, *(rgb if kind == "uchar" else [value / 255 for value in rgb])])
    rows += [[4, *own] for own, _ in faces]
    text = header + "".join(" ".join(map(str, row)) + "\n" for row in rows)
    check_colors(load(tmp_path, "a.ply", text))


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize("kind", ["quads", "mixed"])
def test_ply_that_is_cut_off_is_refused(kind: str, form: str, tmp_path: Path) -> None:
    data = ply(kind, form, "uchar")
    start = data.index(b"end_header")
    for part in (0.1, 0.5, 0.9):
        with pytest.raises(Exception, match="PLY file is damaged or cut off"):
            load(tmp_path, "a.ply", data[: start + int(part * (len(data) - start))])


def off(header: str, of_face: str, of_vertex: str) -> str:
    """Return the figure; colours in the form asked for, "" for none."""

    def said(rgb: list[int], form: str) -> str:
        fractions = " ".join(f"{value / 255:.5f}" for value in rgb)
        words = {"": "", "int": " ".join(map(str, rgb)), "float": fractions}
        return words[form.removesuffix("a")] + {True: " 1" if "float" in form else " 255"}.get(
            form.endswith("a"), ""
        )

    faces, lines = polygons("mixed"), [header, "# by hand"]
    lines.append(f"{len(POINTS)} {len(faces)} 0")
    for number, point in enumerate(POINTS.tolist()):
        rgb = list(bytes.fromhex(COLORS[NAMES[number // 8]]))
        normal = "0 0 1 " if "N" in header else ""
        lines.append(" ".join(map(str, point)) + f" {normal}" + said(rgb, of_vertex))
    lines += [f"{len(own)} {' '.join(map(str, own))} {said(rgb, of_face)}" for own, rgb in faces]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("header", "of_face", "of_vertex"),
    [
        ("OFF", "int", ""),
        ("OFF", "inta", ""),
        ("OFF", "float", ""),
        ("OFF", "floata", ""),
        ("COFF", "", "inta"),
        ("COFF", "", "floata"),
        ("COFF", "", "int"),
        ("CNOFF", "", "inta"),
        ("COFF", "int", "inta"),
    ],
)
def test_off_colours(header: str, of_face: str, of_vertex: str, tmp_path: Path) -> None:
    check_colors(load(tmp_path, "a.off", off(header, of_face, of_vertex)))


def test_off_without_colours_and_of_other_kinds(tmp_path: Path) -> None:
    assert load(tmp_path, "a.off", off("OFF", "", "")).face_colors is None
    assert load(tmp_path, "a.off", off("NOFF", "", "")).face_colors is None
    with pytest.raises(Exception, match="OFF of another kind"):
        load(tmp_path, "a.off", off("4OFF", "", ""))


SOLID_NAMES = {
    "names": ["body", "head", "arm"],
    "none": ["", "", ""],
    "the same": ["part", "part", "part"],
    "spaces": ["left arm", "right arm", "solid gold"],
}


def stl(names: list[str], blank: str = "\n", case: str = "lower") -> str:
    """Return three boxes as ASCII STL, a solid each."""
    text = ""
    for number, name in enumerate(names):
        points = POINTS[8 * number : 8 * number + 8]
        text += f"solid {name}{blank}"
        for quad in QUADS:
            for triangle in ((quad[0], quad[1], quad[2]), (quad[0], quad[2], quad[3])):
                corners = "".join(
                    "      vertex " + " ".join(f"{x:e}" for x in points[i]) + "\n" for i in triangle
                )
                text += f"  facet normal 0 0 0\n    outer loop\n{corners}    endloop\n  endfacet\n"
        text += f"endsolid {name}{blank}"
    return text if case == "lower" else text.upper()


@pytest.mark.parametrize("case", ["lower", "upper"])
@pytest.mark.parametrize("blank", ["\n", "\n\n\n", "\r\n"])
@pytest.mark.parametrize("kind", SOLID_NAMES)
def test_ascii_stl_of_several_solids(kind: str, blank: str, case: str, tmp_path: Path) -> None:
    mesh = load(tmp_path, "a.stl", stl(SOLID_NAMES[kind], blank, case))
    assert (len(mesh.vertices), len(mesh.faces)) == (24, 36)
    assert mesh.face_parts is not None
    assert np.bincount(mesh.face_parts).tolist() == [12, 12, 12]
    assert len(set(mesh.part_names)) == 3
    if kind == "names" and case == "lower":
        assert mesh.part_names == ("body", "head", "arm")


def test_stl_of_one_solid_and_of_empty_ones(tmp_path: Path) -> None:
    one = load(tmp_path, "a.stl", stl(["only"]))
    assert (len(one.faces), one.face_parts, one.part_names) == (12, None, ("body",))
    empty = "solid nothing\nendsolid nothing\n"
    assert len(load(tmp_path, "a.stl", empty + stl(["a", "b"]) + empty).faces) == 24


@pytest.mark.parametrize("part", [0.3, 0.5, 0.95])
def test_ascii_stl_that_is_cut_off_is_refused(part: float, tmp_path: Path) -> None:
    text = stl(["a", "b", "c"])
    with pytest.raises(Exception, match="STL file is damaged or cut off"):
        load(tmp_path, "a.stl", text[: int(part * len(text))])


def test_binary_stl_that_begins_with_solid(tmp_path: Path) -> None:
    corners = POINTS[np.array(QUADS)[:, :3]].astype("<f4")
    faces = b"".join(struct.pack("<12fH", 0, 0, 1, *own.ravel(), 0) for own in corners)
    data = b"solid made by a slicer".ljust(80) + struct.pack("<I", len(corners)) + faces
    assert len(load(tmp_path, "a.stl", data).faces) == len(corners)
