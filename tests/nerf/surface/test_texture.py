"""The drawn look on a mesh whose paint is known: an egg with two eyes, a belt and a patch."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.nerf.look.painted import AXES, INK, PALETTE, camera_at, paint_of
from toonset.dataset.mesh.gltf_file import open_gltf
from toonset.dataset.mesh.load import load_mesh
from toonset.errors import OutputError, SetupError
from toonset.nerf.look.drawing import Drawing, levels_of
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.look.outline import Outline
from toonset.nerf.surface import unwrap as unwrapping
from toonset.nerf.surface.files import Surface
from toonset.nerf.surface.paint import paint_of as as_paint
from toonset.nerf.surface.texture import painted
from toonset.nerf.surface.textured_files import TexturedSurface
from toonset.nerf.surface.unwrap import GUTTER, parts_of, texel_faces, texel_places


@pytest.fixture(scope="module")
def shell() -> Surface:
    ball = trimesh.creation.icosphere(subdivisions=4)
    vertices, faces = np.asarray(ball.vertices) * AXES, np.asarray(ball.faces)
    return Surface(vertices, faces, paint_of(vertices[faces].mean(axis=1)), PALETTE)


@pytest.fixture(scope="module")
def textured(shell: Surface, egg: Drawings) -> TexturedSurface:
    return painted(shell, egg, outline=True)


def middles(textured: TexturedSurface) -> np.ndarray:
    """Return the picture's colour at the middle of every face."""
    places = textured.atlas.uv[textured.atlas.faces].mean(axis=1)
    columns, rows = np.floor(places).astype(int).T
    return textured.picture[rows, columns].astype(int)


def test_every_face_has_its_own_paint(textured: TexturedSurface) -> None:
    surface = textured.surface
    corners = surface.vertices[surface.faces]
    kinds = np.column_stack([paint_of(corners[:, i]) for i in range(3)])
    inner = (kinds == kinds[:, :1]).all(axis=1) & (textured.source >= 0)
    apart = np.abs(middles(textured) - PALETTE[kinds[:, 0]].astype(int)).max(axis=1)
    assert inner.mean() > 0.7
    assert (apart[inner] <= 12).mean() > 0.97


def test_what_no_drawing_shows_is_the_fields(textured: TexturedSurface) -> None:
    unseen = textured.source < 0
    own = PALETTE[textured.surface.labels[unseen]]
    height = np.abs(textured.surface.vertices[textured.surface.faces[unseen]][..., 1])
    assert unseen.any()
    assert height.min() > 0.8 * AXES[1]  # above and below, where level drawings see nothing
    assert np.array_equal(middles(textured)[unseen], own)


def test_outlines_are_not_on_the_picture(textured: TexturedSurface) -> None:
    off = np.abs(textured.picture.astype(int) - INK).max(axis=-1)
    assert off.min() > 20  # the darkest paint is 40 above the ink


def test_an_eye_comes_from_one_drawing(textured: TexturedSurface) -> None:
    surface = textured.surface
    middle = surface.vertices[surface.faces].mean(axis=1)
    for side in (-1, 1):
        eye = (paint_of(middle) == 1) & (np.sign(middle[:, 0]) == side)
        assert eye.sum() > 20
        assert len(np.unique(textured.source[eye])) == 1


def test_frontal_drawings_are_taken(textured: TexturedSurface, egg: Drawings) -> None:
    surface = textured.surface
    a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    ways = np.stack([view.camera.rotation[2] for view in egg.views])
    level = np.abs(normal[:, 1]) < 0.3
    shown = (textured.source >= 0) & level
    frontal = -(normal[shown] * ways[textured.source[shown]]).sum(axis=1)
    assert shown.sum() == level.sum()
    assert frontal.min() > np.cos(np.radians(60))
    assert np.median(frontal) > np.cos(np.radians(25))  # eight views: 22.5 at most, were it free


def test_charts_lie_beside_each_other(textured: TexturedSurface) -> None:
    atlas, surface = textured.atlas, textured.surface
    assert np.array_equal(atlas.vertex[atlas.faces], surface.faces)
    one, two = (atlas.uv[atlas.faces][:, i] - atlas.uv[atlas.faces][:, 0] for i in (1, 2))
    area = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / 2
    face, near, _ = texel_faces(atlas)
    places = texel_places(atlas, face)
    inside = (places >= 0).all(axis=-1) & near
    assert inside.sum() == pytest.approx(area.sum(), rel=0.02)  # overlaps would count once
    assert atlas.uv.min() >= 0
    assert (atlas.uv.max(axis=0) <= atlas.size_wh).all()


def test_gutters_go_on_as_the_chart_does(textured: TexturedSurface) -> None:
    face, near, _ = texel_faces(textured.atlas)
    inside = (texel_places(textured.atlas, face) >= 0).all(axis=-1)
    gutter = near & ~inside
    off = np.abs(textured.picture[gutter].astype(int)[:, None] - PALETTE.astype(int)).max(axis=-1)
    assert gutter.sum() > inside.sum() * 0.02 * GUTTER
    assert (off.min(axis=1) < 40).mean() > 0.9  # paint, neither black nor a mean of charts


def test_small_parts_stay_in_the_chart_around_them(shell: Surface) -> None:
    parts = parts_of(shell.vertices, shell.faces, shell.labels)
    middle = shell.vertices[shell.faces].mean(axis=1)
    face = (paint_of(middle) == 0) & (middle[:, 1] > 0) & (middle[:, 2] > 0)
    assert len(np.unique(parts)) == len(np.unique(parts[shell.labels != 1]))  # no part for an eye
    assert len(np.unique(parts[face])) == 1


def test_other_colours(shell: Surface, egg: Drawings) -> None:
    other = PALETTE.copy()
    other[2] = (40, 200, 40)  # the belt
    result = painted(replace(shell, palette=other), replace(egg, repaint=other))
    belt = (paint_of(shell.vertices[shell.faces].mean(axis=1)) == 2) & (result.source >= 0)
    assert np.median(np.abs(middles(result)[belt] - other[2].astype(int)).max(axis=1)) <= 12
    assert result.pen is None


def test_the_same_bytes(shell: Surface, egg: Drawings, tmp_path: Path) -> None:
    sums = []
    for name in ("a.glb", "b.glb"):
        painted(shell, egg).save(tmp_path / name)
        sums.append(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert sums[0] == sums[1]


@pytest.mark.parametrize("name", ["egg.glb", "my egg.obj"])
def test_files_hold_the_picture(textured: TexturedSurface, tmp_path: Path, name: str) -> None:
    sizes = replace(textured, pen=None).save(tmp_path / name)
    assert {path.name: path.stat().st_size for path in tmp_path.iterdir()} == sizes
    mesh = load_mesh(tmp_path / name)
    assert mesh.face_colors is not None
    assert len(mesh.faces) == len(textured.surface.faces)
    apart = np.abs(mesh.face_colors.astype(int) - middles(textured)).max(axis=1)
    assert (apart <= 30).mean() > 0.95


def test_outline_is_a_hull_turned_inside_out(textured: TexturedSurface, tmp_path: Path) -> None:
    path = tmp_path / "egg.glb"
    textured.save(path)
    file = open_gltf(path.read_bytes(), path, 10**6)
    assert textured.pen is not None
    volumes, bounds = [], []
    for mesh in file.json["meshes"]:
        [primitive] = mesh["primitives"]
        material = file.json["materials"][primitive["material"]]
        assert "KHR_materials_unlit" in material["extensions"]
        assert material["doubleSided"] is False
        places = file.array(primitive["attributes"]["POSITION"]).astype(float)
        a, b, c = np.moveaxis(places[file.array(primitive["indices"]).reshape(-1, 3)], 1, 0)
        volumes.append(float((a * np.cross(b, c)).sum() / 6))
        bounds.append(np.ptp(places, axis=0))
    assert volumes[0] > 0 > volumes[1]
    assert bounds[1] - bounds[0] == pytest.approx(2 * textured.pen.width, rel=0.25)
    assert textured.pen.width * 0.5 * 120 == pytest.approx(2.0, abs=0.5)  # the line's pixels


def test_what_files_cannot_hold_is_refused(textured: TexturedSurface, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"holds no texture; end -o in \.glb, \.obj"):
        textured.save(tmp_path / "egg.ply")
    with pytest.raises(OutputError, match=r"end -o in \.glb for --outline"):
        textured.save(tmp_path / "egg.obj")
    assert not list(tmp_path.iterdir())


def test_without_the_package(monkeypatch: pytest.MonkeyPatch, shell: Surface) -> None:
    monkeypatch.setattr(unwrapping, "find_spec", lambda name: None)
    with pytest.raises(SetupError, match="pip install xatlas"):
        unwrapping.unwrap(shell.vertices, shell.faces, np.zeros(len(shell.faces), dtype=int), 10.0)


SIDE = 80


def lined(step: float) -> tuple[Drawings, np.ndarray]:
    """Return a square, two colours with ink between them and an eye, and its depth with a step."""
    rgba = np.zeros((SIDE, SIDE, 4), dtype=np.uint8)
    rgba[8:-8, 8:-8] = (*PALETTE[0], 255)
    rgba[8:-8, 40:-8, :3] = PALETTE[2]
    rgba[8:-8, 38:41, :3] = INK
    rows, columns = np.mgrid[:SIDE, :SIDE]
    rgba[np.hypot(rows - 40, columns - 48) < 4, :3] = INK
    rgba[20:24, 16:30, :3] = INK  # a brow, far from the step
    inside = rgba[..., 3] > 0
    depth = np.where(inside, np.where(columns < 40, 0.0, step), np.nan)
    camera = replace(camera_at(0.0, side=SIDE), scale=float(SIDE))
    view = Drawing(camera, rgba, rgba[..., :3], levels_of(depth, (-1.0, 1.0)))
    line = Outline(INK, 3.0)
    return Drawings((view,), (), line, line, PALETTE, 0.8, (-1.0, 1.0), False), depth


@pytest.mark.parametrize("step", [0.0, 0.3])
def test_ink_goes_where_the_drawing_steps_in_depth(step: float) -> None:
    drawn, depth = lined(step)
    paint = as_paint(drawn.textures[0], depth, drawn).texture.paint
    ink = np.abs(paint * 255 - INK).max(axis=-1) < 60
    assert ink[20:60, 36:43].any() == (step == 0.0)
    assert ink[39:42, 46:51].all()  # the eye is whole either way
    assert ink[21:23, 18:28].all()  # and what is painted elsewhere stays
