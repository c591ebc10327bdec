"""Exports: what another program reads is what the bundle says, format by format."""

import ast
import json
import math
import runpy
import shlex
import shutil
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
import trimesh

import toonset as ts
from tests.dataset.exporters.exported_views import (
    MODELS,
    RADIUS,
    SHOWN,
    TARGET,
    around,
    bundle_of,
    egg,
    off_px,
    views_all_round,
)
from toonset import __version__
from toonset.dataset.exporters.blender_addon import ADDON
from toonset.dataset.exporters.blender_synthetic import write_blender_synthetic
from toonset.dataset.exporters.common import read_views
from toonset.dataset.exporters.nerfstudio import write_transforms
from toonset.dataset.exporters.pinhole import centre_view, common_lens, square_pixels
from toonset.dataset.exporters.points import TrackedPoints, encode_ply
from toonset.dataset.images.picture import load_rgba
from toonset.errors import BundleError


def where_is_spot(rgba: np.ndarray) -> np.ndarray:
    height, width = rgba.shape[:2]
    v, u = np.mgrid[:height, :width] + 0.5
    weight = rgba[..., 3].astype(float)
    return np.array([(u * weight).sum(), (v * weight).sum()]) / weight.sum()


def through(pose: np.ndarray, focal: tuple[float, float], center: np.ndarray) -> np.ndarray:
    """Project the points as a NeRF program does: world_from_camera with OpenGL axes."""
    local = (around(TARGET) - pose[:3, 3]) @ pose[:3, :3]
    return local[:, :2] * [1, -1] / -local[:, 2:] * np.array(focal) + center


@MODELS
def test_centring_moves_picture_and_camera_together(k: float) -> None:
    for view in views_all_round(k=k):
        moved = centre_view(view)
        np.testing.assert_allclose(moved.camera.center, np.array(moved.camera.size_wh) / 2)
        assert moved.rgba.shape[1::-1] == moved.camera.size_wh
        shown = moved.camera.project(SHOWN)[0][0]
        np.testing.assert_allclose(where_is_spot(moved.rgba), shown, atol=0.05)
        shift = shown - view.camera.project(SHOWN)[0][0]
        points = around(view.camera.target)
        pixels = moved.camera.project(points)[0] - shift
        np.testing.assert_allclose(pixels, view.camera.project(points)[0], atol=1e-9)
        if k == 0:
            np.testing.assert_array_equal(moved.rgba, view.rgba)


def test_a_moved_target_still_covers_the_body_in_its_bound() -> None:
    for view in views_all_round():
        moved = centre_view(view)
        points = around(view.camera.target)
        off = moved.pinhole.project(points)[0] - moved.camera.project(points)[0]
        assert np.linalg.norm(off, axis=1).max() <= moved.error_px


@MODELS
@pytest.mark.parametrize("aspect", [1.0, 1.25])
def test_a_common_lens_is_one_lens(k: float, aspect: float) -> None:
    views = views_all_round(k=k, aspect=aspect)
    result = common_lens(views)
    focals = [view.pinhole.K[[0, 1], [0, 1]] for view in result]
    np.testing.assert_allclose(focals, np.full((len(views), 2), focals[0][0]), rtol=1e-12)
    assert len({view.camera.size_wh for view in result}) == 1
    for old, new in zip(views, result, strict=True):
        np.testing.assert_allclose(new.camera.center, np.array(new.camera.size_wh) / 2)
        shown = new.camera.project(SHOWN)[0][0]
        np.testing.assert_allclose(where_is_spot(new.rgba), shown, atol=0.05)
        assert new.distance >= old.distance * (1 - 1e-12) or k > 0
        if k == 0 and aspect == 1:
            kept = new.rgba[new.rgba[..., 3] > 0]
            np.testing.assert_array_equal(kept, old.rgba[old.rgba[..., 3] > 0])


def test_views_without_a_common_lens_are_refused() -> None:
    mixed = (*views_all_round(2), *views_all_round(2, k=0.2))
    with pytest.raises(BundleError, match="one for all is needed; export to a format with a lens"):
        common_lens(mixed)
    near, far = views_all_round(2, k=0.2)[0], views_all_round(2, k=0.02)[1]
    with pytest.raises(BundleError, match="focal lengths from 235 to 2400 px"):
        common_lens((near, far))


def test_a_principal_point_far_outside_is_refused() -> None:
    view = views_all_round(1, k=0.2)[0]
    with pytest.raises(BundleError, match="at most 80 megapixels"):
        centre_view(replace(view, camera=replace(view.camera, center=np.array([6e5, 6e5]))))


def test_square_pixels_enlarge_the_shorter_direction() -> None:
    for aspect in (0.8, 1.25):
        view = views_all_round(1, aspect=aspect)[0]
        square = square_pixels(view)
        assert square.camera.pixel_aspect == pytest.approx(1)
        assert square.camera.size_wh >= view.camera.size_wh
        shown = square.camera.project(SHOWN)[0][0]
        np.testing.assert_allclose(where_is_spot(square.rgba), shown, atol=0.05)
    view = views_all_round(1)[0]
    assert square_pixels(view) is view


@MODELS
@pytest.mark.parametrize("instant_ngp", [False, True])
def test_transforms_hold_every_lens(tmp_path: Path, k: float, instant_ngp: bool) -> None:
    views = views_all_round(k=k)
    write_transforms(tmp_path / "out", views, instant_ngp=instant_ngp, pinholes=not instant_ngp)
    content = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert content["camera_model"] == "OPENCV"
    for frame, view in zip(content["frames"], views, strict=True):
        focal = (frame["fl_x"], frame["fl_y"])
        center = np.array([frame["cx"], frame["cy"]])
        pixels = through(np.array(frame["transform_matrix"]), focal, center)
        assert off_px(pixels, view.pinhole) < 1e-6
        assert off_px(pixels, view.camera) <= view.error_px + 1e-6
        picture = load_rgba(tmp_path / "out" / frame["file_path"])
        np.testing.assert_array_equal(picture, view.rgba)
        assert picture.shape == (frame["h"], frame["w"], 4)
        assert "mask_path" not in frame  # it would hide the empty background from training


def parallel_ray(frame: dict[str, Any], pixel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return start and direction as nerfstudio 1.1.5 has them of its ORTHOPHOTO, in float32."""
    pose = np.array(frame["transform_matrix"], np.float32)[:3]
    u, v = pixel.astype(np.float32)
    x = (u - np.float32(frame["cx"])) / np.float32(frame["fl_x"])
    y = (v - np.float32(frame["cy"])) / np.float32(frame["fl_y"])
    start = pose @ np.array([x, -y, 0, 1], np.float32)
    return start, pose[:, :3] @ np.array([0, 0, -1], np.float32)


@pytest.mark.parametrize("aspect", [1.0, 1.25])
def test_nerfstudio_sees_orthographic_views_as_such(tmp_path: Path, aspect: float) -> None:
    views = views_all_round(aspect=aspect)
    write_transforms(tmp_path / "out", views)
    content = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert content["camera_model"] == "ORTHOPHOTO"
    for frame, view in zip(content["frames"], views, strict=True):
        points = around(view.camera.target)
        for point, pixel in zip(points, view.camera.project(points)[0], strict=True):
            start, direction = parallel_ray(frame, pixel)
            along = (point - start) @ direction
            assert along > 0.05  # nerfacto's near plane
            assert np.linalg.norm(point - start - along * direction) < 1e-5
        picture = load_rgba(tmp_path / "out" / frame["file_path"])
        np.testing.assert_array_equal(picture, view.rgba)


def test_one_model_holds_for_all_frames_of_nerfstudio(tmp_path: Path) -> None:
    mixed = (*views_all_round(2), replace(views_all_round(1, k=0.2)[0], name="other.png"))
    write_transforms(tmp_path / "out", mixed)
    content = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert content["camera_model"] == "OPENCV"
    for frame, view in zip(content["frames"], mixed, strict=True):
        pose, center = np.array(frame["transform_matrix"]), np.array([frame["cx"], frame["cy"]])
        pixels = through(pose, (frame["fl_x"], frame["fl_y"]), center)
        assert off_px(pixels, view.pinhole) < 1e-6


@pytest.mark.parametrize("aspect", [1.0, 1.25])
def test_orthographic_frames_of_another_program_are_read_and_written(
    tmp_path: Path, aspect: float, toonset
) -> None:
    views = views_all_round(4, aspect=aspect)
    write_transforms(tmp_path / "out", views)
    (tmp_path / "out" / "toonset.json").unlink()  # nobody says more than transforms.json
    for read, view in zip(read_views(tmp_path / "out"), views, strict=True):
        assert read.camera.is_orthographic
        assert read.radius > 0.9 * RADIUS
        points = read.camera.target + read.radius * around(np.zeros(3))
        seen = read.camera.project(points)[0]
        np.testing.assert_allclose(seen, view.camera.project(points)[0], atol=1e-9)
        off = read.pinhole.project(points)[0] - seen
        assert 0 < np.linalg.norm(off, axis=1).max() <= read.error_px
    done = toonset("import", tmp_path / "out", "-o", tmp_path / "bundle")
    assert done.code == 0, done
    for item, view in zip(ts.ViewDataset(tmp_path / "bundle"), views, strict=True):
        exact = np.column_stack([around(TARGET), np.ones(len(around(TARGET)))])
        u, v, w = item["image_from_world"].numpy() @ exact.T
        assert off_px(np.stack([u / w, v / w], axis=1), view.camera) < 1e-9
    items = ts.ViewDataset(tmp_path / "out")
    assert all(item["orthographic"] and item["pinhole_error_px"] > 0 for item in items)


@MODELS
def test_instant_ngp_sees_the_same_in_its_unit_cube(tmp_path: Path, k: float) -> None:
    """Its loader in float32: p' = p scale + offset, principal point as a part of the size."""
    mesh = egg()
    views = views_all_round(k=k)
    write_transforms(tmp_path / "out", views, mesh=mesh, instant_ngp=True)
    content = json.loads((tmp_path / "out" / "transforms.json").read_text())
    scale, offset = np.float32(content["scale"]), np.array(content["offset"], np.float32)
    cube = mesh.vertices * content["scale"] + offset
    assert cube.min() > 0
    assert cube.max() < 1
    assert np.ptp(cube, axis=0).max() > 0.8
    assert (content["aabb_scale"], content["up"]) == (1, [0, 1, 0])
    points = around(TARGET) * content["scale"] + content["offset"]
    for frame, view in zip(content["frames"], views, strict=True):
        pose = np.array(frame["transform_matrix"], np.float32)
        pose[:3, 3] = pose[:3, 3] * scale + offset
        local = (points.astype(np.float32) - pose[:3, 3]) @ pose[:3, :3]
        principal = np.array([frame["cx"], frame["cy"]], np.float32)
        size = np.array([frame["w"], frame["h"]], np.float32)
        focal = np.array([frame["fl_x"], frame["fl_y"]], np.float32)
        ray = np.stack([local[:, 0], -local[:, 1]], axis=1) / -local[:, 2:]
        pixels = (ray * focal / size + principal / size) * size
        assert off_px(pixels, view.pinhole) < 0.01


@MODELS
def test_synthetic_scene_follows_from_one_angle(tmp_path: Path, k: float) -> None:
    views = write_blender_synthetic(tmp_path / "out", views_all_round(k=k))
    for split in ("train", "val", "test"):
        content = json.loads((tmp_path / "out" / f"transforms_{split}.json").read_text())
        assert len(content["frames"]) == len(views)
    for frame, view in zip(content["frames"], views, strict=True):
        picture = load_rgba(tmp_path / "out" / (frame["file_path"] + ".png"))
        height, width = picture.shape[:2]
        focal = 0.5 * width / math.tan(0.5 * content["camera_angle_x"])
        middle = np.array([width, height]) / 2
        pixels = through(np.array(frame["transform_matrix"]), (focal, focal), middle)
        assert off_px(pixels, view.pinhole) < 0.01
        assert off_px(pixels, view.camera) <= view.error_px + 0.01


def test_ply_is_read_back_by_trimesh() -> None:
    rng = np.random.default_rng(3)
    xyz, rgb = rng.normal(size=(50, 3)), rng.integers(0, 256, (50, 3)).astype(np.uint8)
    points = TrackedPoints(xyz, rgb, np.ones((1, 50), bool), np.zeros((1, 50, 2)))
    data = encode_ply(points)
    cloud = trimesh.load(trimesh.util.wrap_as_stream(data), file_type="ply")
    assert isinstance(cloud, trimesh.PointCloud)
    np.testing.assert_allclose(cloud.vertices, xyz, atol=1e-6)
    np.testing.assert_array_equal(np.asarray(cloud.colors)[:, :3], rgb)


FORMATS = ["colmap", "nerfstudio", "instant-ngp", "blender-synthetic", "blender", "gltf"]


@MODELS
def test_views_keep_distance_and_radius_of_their_bundle(tmp_path: Path, k: float) -> None:
    views = views_all_round(3, k=k)
    for read, view in zip(read_views(bundle_of(views, tmp_path)), views, strict=True):
        assert read.distance == pytest.approx(view.distance)
        assert read.radius == pytest.approx(RADIUS if k == 0 else 0)
        assert read.error_px == pytest.approx(view.error_px)


@pytest.mark.parametrize("to", FORMATS)
def test_every_format_is_written_whole_and_replaced_only_by_force(toonset, tmp_path, to):
    bundle = bundle_of(views_all_round(3), tmp_path / "bundle", egg())
    out = tmp_path / "out"
    first = toonset("export", bundle, "--to", to, "-o", out, "--json")
    assert first.code == 0, first
    assert first.json["views"] == 3
    assert (first.json["pinhole_error_px"] == 0) == (to in ("blender", "gltf", "nerfstudio"))
    before = {path.name for path in out.iterdir()}
    assert {"toonset.json", "mannequin.obj"} < before
    assert "exists already" in toonset("export", bundle, "--to", to, "-o", out).reason
    again = toonset("export", bundle, "--to", to, "-o", out, "--force", "-q")
    assert (again.code, again.err) == (0, "")
    assert {path.name for path in out.iterdir()} == before
    (out / "mine.txt").write_text("keep")
    refused = toonset("export", bundle, "--to", to, "-o", out, "--force").reason
    assert "holds 'mine.txt'" in refused


def test_the_nerfstudio_line_has_pictures_to_evaluate_on(toonset, tmp_path: Path) -> None:
    """By nerfstudio's usual fraction of 0.9, eight views are all trained on."""
    bundle, out = bundle_of(views_all_round(3), tmp_path / "bundle", egg()), tmp_path / "a b"
    said = toonset("export", bundle, "--to", "nerfstudio", "-o", out).err.splitlines()[-1]
    words = shlex.split(said.partition(": ")[2])
    assert words[:2] == ["ns-train", "nerfacto"]
    parser = words[words.index("nerfstudio-data") :]
    assert dict(zip(parser[1::2], parser[2::2], strict=True)) == {
        "--data": str(out),
        "--orientation-method": "none",
        "--center-method": "none",
        "--auto-scale-poses": "False",
        "--eval-mode": "all",
    }


def test_splatfacto_gets_far_pinholes(toonset, tmp_path: Path) -> None:
    bundle, out = bundle_of(views_all_round(3), tmp_path / "bundle", egg()), tmp_path / "out"
    said = toonset("export", bundle, "--to", "nerfstudio", "-o", out)
    assert "orthographic (ORTHOPHOTO); for splatfacto, which knows none, add --pinholes" in said.err
    again = toonset("export", bundle, "--to", "nerfstudio", "-o", out, "--pinholes", "--force")
    assert "3 orthographic, written as far pinholes: at most " in again.err
    assert json.loads((out / "transforms.json").read_text())["camera_model"] == "OPENCV"
    refused = toonset("export", bundle, "--to", "colmap", "-o", tmp_path / "c", "--pinholes")
    assert refused.code == 2
    assert "--pinholes belongs to --to nerfstudio" in " ".join(refused.err.split())


def test_options_of_colmap_are_refused_elsewhere(toonset, tmp_path: Path) -> None:
    for option in (["--text"], ["--centre"], ["--layout", "old"]):
        done = toonset("export", tmp_path, "--to", "gltf", "-o", tmp_path / "out", *option)
        assert done.code == 2
        assert "belong to --to colmap" in " ".join(done.err.replace("│", " ").split())


def test_the_addon_is_one_file_that_belongs_to_no_bundle(toonset, tmp_path: Path) -> None:
    out, asked = tmp_path / "addon.zip", ("export", "--to", "blender-addon", "-o")
    assert toonset(*asked, out).code == 0
    with zipfile.ZipFile(out) as archive:
        assert archive.namelist() == ["toonset_sheet/__init__.py"]
        text = archive.read("toonset_sheet/__init__.py").decode()
    assert len(text.splitlines()) < 400
    (info,) = [
        ast.literal_eval(node.value)
        for node in ast.parse(text).body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "bl_info"
    ]
    assert ".".join(map(str, info["version"])) in __version__
    assert info["blender"] == (3, 4, 0)
    before = out.read_bytes()
    assert "exists already" in toonset(*asked, out).reason
    assert toonset(*asked, out, "--force").code == 0
    assert out.read_bytes() == before
    assert "end -o in .zip" in toonset(*asked, tmp_path / "addon").reason
    assert "needs a BUNDLE" in toonset("export", "--to", "gltf", "-o", tmp_path / "x").reason
    assert "leave out BUNDLE" in toonset(*asked, tmp_path / "x.zip", tmp_path).reason
    assert [path.name for path in tmp_path.iterdir()] == ["addon.zip"]


class Typed:
    """A base of Blender's, without what Blender does."""


def test_what_the_addon_types_is_understood(drawn, toonset, tmp_path, monkeypatch) -> None:
    blender = MagicMock()
    blender.path.abspath = lambda path: path
    for name in ("AddonPreferences", "PropertyGroup", "Operator", "Panel"):
        setattr(blender.types, name, Typed)
    monkeypatch.setitem(sys.modules, "bpy", blender)
    monkeypatch.setitem(sys.modules, "mathutils", MagicMock())
    file = tmp_path / "addon.py"
    file.write_text(ADDON.replace("@RELEASE@", "0, 1, 0"))
    addon = runpy.run_path(str(file))
    for name in ("sheet.png", "mannequin.obj"):
        shutil.copy(drawn / name, tmp_path / name)
    said = [SimpleNamespace(yaw=math.radians(angle), said=angle < 60) for angle in (0, 45, 90)]
    said += [SimpleNamespace(yaw=math.radians(-90), said=True), SimpleNamespace(yaw=3, said=False)]
    sheet = SimpleNamespace(
        path=str(tmp_path / "sheet.png"), mannequin=str(tmp_path / "mannequin.obj"), drawings=said
    )
    words = addon["calibrate_words"](sheet)
    assert words[-2:] == ["--views", "0.0,45.0,?,270.0,?"]
    sheet.drawings = []
    assert "--views" not in addon["calibrate_words"](sheet)
    assert toonset(*addon["calibrate_words"](sheet)).code in addon["FINE"]
    assert toonset(*addon["export_words"](sheet)).code == 0
    place = Path(addon["folder_of"](sheet))
    assert place == tmp_path / "sheet_toonset"
    assert (place / "scene" / "import_cameras.py").is_file()


def test_centre_is_offered_where_it_matters(toonset, tmp_path: Path) -> None:
    bundle = bundle_of(views_all_round(3), tmp_path / "bundle", egg())
    plain = toonset("export", bundle, "--to", "colmap", "-o", tmp_path / "plain")
    assert "principal points up to 3.7 px off" in plain.err
    done = toonset("export", bundle, "--to", "colmap", "-o", tmp_path / "centre_view", "--centre")
    assert "principal points" not in done.err
