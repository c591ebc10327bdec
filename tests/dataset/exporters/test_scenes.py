"""Exports of 3D scenes: cameras, drawings and mannequin stand in register in glTF and Blender."""

import json
import math
import runpy
import struct
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
import trimesh

from tests.dataset.exporters.exported_views import (
    MODELS,
    TARGET,
    around,
    egg,
    off_px,
    views_all_round,
)
from toonset.camera import Camera
from toonset.dataset.exporters.blender import write_blender_script
from toonset.dataset.exporters.gltf import write_gltf
from toonset.dataset.mesh.gltf_file import open_gltf


def opened(path: Path) -> tuple[Any, dict[str, Any], np.ndarray]:
    """Return a scene's content, its nodes by name, and the size of its window."""
    content = open_gltf(path.read_bytes(), path, 10**6)
    nodes = {node["name"]: node for node in content.json["nodes"]}
    return content, nodes, np.array(content.json["scenes"][0]["extras"]["window_px"])


def world_matrix(node: dict) -> np.ndarray:
    return np.array(node["matrix"]).reshape(4, 4).T


@MODELS
def test_gltf_cameras_see_mannequin_and_drawing_in_register(tmp_path: Path, k: float) -> None:
    views = views_all_round(k=k)
    write_gltf(tmp_path / "out", views, egg())
    content, nodes, window = opened(tmp_path / "out" / "scene.glb")
    for view in views:
        node = nodes[f"camera {view.name}"]
        lens = content.json["cameras"][node["camera"]]
        clip = view_volume(lens, window)
        points = around(view.camera.target)
        # a pinhole's window is around its principal point, a drawing's around its middle
        middle = np.array(view.camera.size_wh) / 2 if k == 0 else view.camera.center
        pixels, inside = seen_by(node, lens, points, window)
        assert inside.all(), clip
        assert off_px(pixels - window / 2 + middle, view.camera) < 0.01
        plane = nodes[f"drawing {view.name}"]
        primitive = content.json["meshes"][plane["mesh"]]["primitives"][0]["attributes"]
        corners = content.array(primitive["POSITION"]) + np.array(plane["translation"])
        uv = content.array(primitive["TEXCOORD_0"])
        pixels, inside = seen_by(node, lens, corners, window)
        expected = uv * np.array(view.camera.size_wh)
        np.testing.assert_allclose(pixels - window / 2 + middle, expected, atol=0.01)
        assert inside.all()
        assert node["extras"]["toonset"]["model"] == ("pinhole" if k else "orthographic")


def view_volume(lens: dict, window: np.ndarray) -> dict:
    """Return the lens's own block; its shape must be the window's."""
    block = lens[lens["type"]]
    shape = block["xmag"] / block["ymag"] if "xmag" in block else block["aspectRatio"]
    assert shape == pytest.approx(window[0] / window[1])
    return block


def seen_by(
    node: dict, lens: dict, points: np.ndarray, window: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return pixels in the window and whether they lie in it: glTF 2.0, section 3.10.3."""
    block = lens[lens["type"]]
    local = np.c_[points, np.ones(len(points))] @ np.linalg.inv(world_matrix(node)).T
    x, y, depth = local[:, 0], local[:, 1], -local[:, 2]
    if lens["type"] == "orthographic":
        ndc = np.stack([x / block["xmag"], y / block["ymag"]], axis=1)
    else:
        f = 1 / math.tan(block["yfov"] / 2)
        ndc = np.stack([x * f / block["aspectRatio"], y * f], axis=1) / depth[:, None]
    within = (depth > block["znear"]) & (depth < block["zfar"])
    return (ndc * [1, -1] + 1) / 2 * window, within


@MODELS
def test_no_drawing_hangs_between_another_camera_and_the_mannequin(tmp_path, k):
    mesh, views = egg(), views_all_round(8, k=k)
    write_gltf(tmp_path / "out", views, mesh)
    content, nodes, window = opened(tmp_path / "out" / "scene.glb")
    steps = np.linspace(0, 1, 21)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    for view in views:
        camera = nodes[f"camera {view.name}"]
        lens = content.json["cameras"][camera["camera"]]
        for other in views:
            if other is view:
                continue
            plane = nodes[f"drawing {other.name}"]
            attributes = content.json["meshes"][plane["mesh"]]["primitives"][0]["attributes"]
            a, b, c, d = content.array(attributes["POSITION"]) + np.array(plane["translation"])
            u, v = grid[:, :1], grid[:, 1:]
            points = (1 - u) * (1 - v) * a + (1 - u) * v * b + u * v * c + u * (1 - v) * d
            local = np.c_[points, np.ones(len(points))] @ np.linalg.inv(world_matrix(camera)).T
            before = local[:, 2] < 0
            if before.any():
                pixels, _ = seen_by(camera, lens, points[before], window)
                seen = ((pixels > 0) & (pixels < window)).all(axis=1)
                assert not seen.any(), (view.name, other.name)


def test_trimesh_reads_the_scene(tmp_path: Path) -> None:
    body = egg()
    red = np.tile(np.array([[200, 30, 20]], np.uint8), (len(body.faces), 1))
    red[: len(red) // 2] = (20, 30, 200)
    mesh = replace(body, face_colors=red)
    write_gltf(tmp_path / "out", views_all_round(3), mesh)
    scene = trimesh.load(tmp_path / "out" / "scene.glb")
    assert isinstance(scene, trimesh.Scene)
    shape = scene.geometry["GLTF"] if "GLTF" in scene.geometry else scene.geometry["mannequin"]
    assert isinstance(shape, trimesh.Trimesh)
    np.testing.assert_allclose(shape.bounds, mesh.bounds, atol=1e-6)
    assert len(shape.faces) == len(mesh.faces)
    assert sum(name.startswith("drawing") for name in scene.graph.nodes_geometry) == 3


def test_gltf_without_mannequin_still_places_every_drawing(tmp_path: Path) -> None:
    write_gltf(tmp_path / "out", views_all_round(2))
    data = (tmp_path / "out" / "scene.glb").read_bytes()
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    names = [node["name"] for node in open_gltf(data, Path("scene.glb"), 100).json["nodes"]]
    assert names == ["camera 000.png", "drawing 000.png", "camera 001.png", "drawing 001.png"]


@MODELS
def test_blender_script_holds_every_view(tmp_path: Path, k: float) -> None:
    """Blender's own rules: shift in window widths to the right and up, lens in sensor widths."""
    views = views_all_round(k=k)
    write_blender_script(tmp_path / "out", views, egg())
    text = (tmp_path / "out" / "import_cameras.py").read_text()
    compile(text, "import_cameras.py", "exec")
    records = json.loads(text.split('VIEWS = json.loads(r"""', 1)[1].split('"""', 1)[0])
    window = np.array([max(v.camera.size_wh[axis] for v in views) for axis in (0, 1)])
    assert f"WINDOW = ({window[0]}, {window[1]})" in text
    for record, view in zip(records, views, strict=True):
        assert record["orthographic"] == view.camera.is_orthographic
        pose = np.array(record["world_from_camera"])
        points = around(TARGET)
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        plane = local[:, :2] / record["width_world"]
        if not record["orthographic"]:
            plane = local[:, :2] / -local[:, 2:] * record["focal_widths"]
        right, up = record["shift"]
        pixels = np.stack([plane[:, 0] - right, -(plane[:, 1] - up)], axis=1) * window[0]
        assert off_px(pixels + np.array(view.camera.size_wh) / 2, view.camera) < 1e-6
        near, far = record["clip"]
        assert near < -local[:, 2].max() < -local[:, 2].min() < far
        assert (tmp_path / "out" / "images" / record["name"]).is_file()
        size = np.array(view.camera.size_wh)
        fitted = size * (window / size).min()  # Blender's FIT: as large as the window holds
        np.testing.assert_allclose(fitted * record["of_window"], size)


def test_the_turning_camera_holds_every_side(tmp_path: Path) -> None:
    views = views_all_round()
    write_blender_script(tmp_path / "out", views, egg())
    text = (tmp_path / "out" / "import_cameras.py").read_text()
    turn = json.loads(text.split('TURN = json.loads(r"""', 1)[1].split('"""', 1)[0])
    window = np.array([max(v.camera.size_wh[axis] for v in views) for axis in (0, 1)])
    scale = window[0] / turn["width_world"]
    vertices = egg().vertices
    near, far = turn["clip"]
    for yaw in np.linspace(0, 2 * np.pi, 12, endpoint=False):
        target = np.array(turn["target"])
        camera = Camera.looking_at(target, yaw, turn["elevation"], scale, tuple(window))
        pixels = camera.project(vertices)[0]
        assert (pixels > 0).all()
        assert (pixels < window).all()
        depth = (vertices - target) @ camera.rotation[2] + turn["distance"]
        assert near < depth.min() < depth.max() < far


@pytest.fixture
def blender(monkeypatch: pytest.MonkeyPatch) -> MagicMock:
    """Return a stand-in for Blender's module: it takes anything."""
    stand_in = MagicMock()
    stand_in.app.version, stand_in.app.version_string = (5, 0, 1), "5.0.1"
    stand_in.app.background = True
    monkeypatch.setitem(sys.modules, "bpy", stand_in)
    monkeypatch.setitem(sys.modules, "mathutils", MagicMock())
    return stand_in


def test_blender_script_opens_the_painted_body(tmp_path: Path, blender: MagicMock) -> None:
    write_blender_script(tmp_path / "out", views_all_round(2), egg(), body=b"glTF body")
    assert (tmp_path / "out" / "body.glb").read_bytes() == b"glTF body"
    runpy.run_path(str(tmp_path / "out" / "import_cameras.py"))
    files = [call.kwargs["filepath"] for call in blender.ops.import_scene.gltf.call_args_list]
    assert files == [str(tmp_path / "out" / name) for name in ("scene.glb", "body.glb")]


def test_a_blender_that_cannot_do_it_is_told_in_one_line(tmp_path, blender, monkeypatch, capsys):
    write_blender_script(tmp_path / "out", views_all_round(2), egg())
    script = str(tmp_path / "out" / "import_cameras.py")
    blender.app.version = (3, 3, 1)
    with pytest.raises(SystemExit, match=r"needs Blender 3\.4 or later"):
        runpy.run_path(script)
    blender.app.version = (3, 4, 1)
    monkeypatch.setitem(sys.modules, "numpy", None)
    with pytest.raises(SystemExit, match=r"has no numpy, .* install it"):
        runpy.run_path(script)
    blender.app.background = False  # to leave would close the window
    runpy.run_path(script)
    assert capsys.readouterr().err.count("\n") == 1
    blender.data.scenes.new.assert_not_called()


def test_blender_script_shows_a_scene_of_its_own(tmp_path: Path, blender: MagicMock) -> None:
    """Blender starts with a cube where the character stands; it must not be in the picture."""
    write_blender_script(tmp_path / "out", views_all_round(2), egg())
    started_with, own = blender.context.scene, blender.data.scenes.new.return_value
    runpy.run_path(str(tmp_path / "out" / "import_cameras.py"))
    assert blender.context.window.scene is own
    scene = str(tmp_path / "out" / "scene.glb")
    blender.ops.import_scene.gltf.assert_called_once_with(filepath=scene)
    assert started_with.mock_calls == []
