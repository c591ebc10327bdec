"""Imports: other programs' folders become bundles, with the cameras that they had."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
import pytest

from tests.dataset.exporters.exported_views import MODELS, TARGET, around
from tests.dataset.importers.imported_views import (
    OWN_CAMERAS,
    WRITERS,
    change,
    tetrahedron,
    views_all_round,
)
from toonset.camera import Camera
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.exporters.blender_synthetic import write_blender_synthetic
from toonset.dataset.exporters.colmap import write_colmap
from toonset.dataset.exporters.nerfstudio import write_transforms
from toonset.dataset.images.picture import encode_png, load_rgba
from toonset.dataset.importers.detect import read_import, turned
from toonset.dataset.importers.to_bundle import write_imported
from toonset.dataset.mesh.load import load_mesh
from toonset.write import write_bytes, write_json

EVERY = pytest.mark.parametrize("kind", WRITERS)


def off_px(a: Camera, b: Camera) -> float:
    points = around(TARGET)
    return float(np.linalg.norm(a.project(points)[0] - b.project(points)[0], axis=1).max())


@MODELS
@EVERY
def test_exact_cameras_return_from_every_export(tmp_path: Path, kind: str, k: float) -> None:
    views = views_all_round(k=k)
    written = WRITERS[kind](tmp_path / "out", views, tetrahedron())
    expected = written if isinstance(written, tuple) else views
    write_imported(tmp_path / "back", read_import(tmp_path / "out"), None)
    frames = read_scene(tmp_path / "back").frames
    for frame, view in zip(frames, expected, strict=True):
        assert frame.name == view.name
        assert off_px(frame.camera, view.camera) < 1e-9
        assert frame.camera.is_orthographic == (k == 0)
        opaque = view.rgba[..., 3] == 255
        np.testing.assert_array_equal(frame.rgba[..., 3] == 255, opaque)
        np.testing.assert_array_equal(frame.rgba[opaque], view.rgba[opaque])


@MODELS
@pytest.mark.parametrize("kind", OWN_CAMERAS)
def test_cameras_return_as_the_format_has_them(tmp_path: Path, kind: str, k: float) -> None:
    """Without toonset.json an export is what any other program would have written."""
    views = views_all_round(k=k)
    written = WRITERS[kind](tmp_path / "out", views, tetrahedron())
    expected = written if isinstance(written, tuple) else views
    (tmp_path / "out" / "toonset.json").unlink()
    if kind.startswith("colmap"):
        rigs = list((tmp_path / "out" / "sparse" / "0").glob("rigs.*"))
        assert len(rigs) == (kind != "colmap-old")
    write_imported(tmp_path / "back", read_import(tmp_path / "out"), None)
    frames = read_scene(tmp_path / "back").frames
    for frame, view in zip(frames, expected, strict=True):
        assert (view.error_px > 0) == (k == 0)
        if kind == "nerfstudio" and k == 0:
            assert frame.camera.is_orthographic
            assert off_px(frame.camera, view.camera) < 1e-9
            continue
        assert not frame.camera.is_orthographic
        assert off_px(frame.camera, view.pinhole) < 0.01
        assert off_px(frame.camera, view.camera) <= view.error_px + 0.01


def test_far_pinholes_of_a_round_trip_stand_where_they_stood(tmp_path: Path) -> None:
    views = views_all_round()
    write_transforms(tmp_path / "out", views)
    write_imported(tmp_path / "back", read_import(tmp_path / "out"), None)
    frames = json.loads((tmp_path / "back" / "transforms.json").read_text())["frames"]
    for frame, view in zip(frames, views, strict=True):
        assert frame["toonset"]["pinhole_error_px"] == pytest.approx(view.error_px)
        centre = np.array(frame["transform_matrix"])[:3, 3]
        np.testing.assert_allclose(centre, view.pinhole.world_from_camera[:3, 3], atol=1e-6)


def test_a_whole_synthetic_scene_is_one_bundle(tmp_path: Path) -> None:
    """Pictures of train, val and test, each once, though val and train share names."""
    written = write_blender_synthetic(tmp_path / "out", views_all_round(k=0.2))
    out = tmp_path / "out"
    (out / "toonset.json").unlink()
    shutil.copytree(out / "train", out / "val")
    content = json.loads((out / "transforms_val.json").read_text())
    for frame in content["frames"]:
        frame["file_path"] = frame["file_path"].replace("train", "val")
    write_json(out / "transforms_val.json", content)
    imported = read_import(out)
    assert len(imported.views) == 2 * len(written)
    names = [view.name for view in imported.views]
    assert {"train_000.png", "val_000.png"} < set(names)


def test_masks_become_alpha(toonset, tmp_path: Path) -> None:
    views = views_all_round(k=0.2)
    write_colmap(tmp_path / "out", views)
    shutil.move(tmp_path / "out" / "masks", tmp_path / "masks")
    bare = toonset("import", tmp_path / "out", "-o", tmp_path / "bare", "--json")
    assert len(bare.json["opaque"]) == 4
    assert "the whole picture counts as figure; give --masks" in bare.err
    done = toonset(
        *("import", tmp_path / "out", "-o", tmp_path / "back", "--json"),
        *("--masks", tmp_path / "masks"),
    )
    assert (done.json["opaque"], done.json["masked"]) == ([], 4)
    for view in views:
        alpha = load_rgba(tmp_path / "back" / "images" / view.name)[..., 3]
        np.testing.assert_array_equal(alpha, view.rgba[..., 3])


def test_mask_path_of_nerfstudio_is_used(tmp_path: Path) -> None:
    views = views_all_round(k=0.2)
    write_transforms(tmp_path / "out", views)
    (tmp_path / "out" / "toonset.json").unlink()

    def edit(content: dict[str, Any]) -> None:
        for frame, view in zip(content["frames"], views, strict=True):
            frame["mask_path"] = f"masks/{view.name}"
            half = np.zeros(view.rgba.shape[:2], np.uint8)
            half[:40] = 255
            write_bytes(tmp_path / "out" / "masks" / view.name, encode_png(half))

    change(tmp_path / "out" / "transforms.json", edit)
    write_imported(tmp_path / "back", read_import(tmp_path / "out"), None)
    for view in views:
        alpha = load_rgba(tmp_path / "back" / "images" / view.name)[..., 3]
        np.testing.assert_array_equal(alpha[:40], view.rgba[:40, :, 3])
        assert (alpha[40:] == 0).all()


def test_colmap_pictures_in_folders_elsewhere(tmp_path: Path) -> None:
    views = views_all_round(2, k=0.2)
    write_colmap(tmp_path / "out", views)
    sparse = tmp_path / "out" / "sparse" / "0"
    model = pycolmap.Reconstruction(sparse)
    for number, image in model.images.items():
        image.name = f"rig{number}/shot.png"
        write_bytes(tmp_path / "photos" / image.name, encode_png(views[number - 1].rgba))
    model.write(sparse)
    imported = read_import(sparse, tmp_path / "photos")
    assert [view.name for view in imported.views] == ["rig1_shot.png", "rig2_shot.png"]


def test_z_up_worlds_are_turned(tmp_path: Path) -> None:
    """A camera before a character that faces -Y in a world with +Z up is at yaw 0 afterwards."""
    facing_y = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    blender = Camera(facing_y, np.array([0, 0, 0.9]), 40.0, np.array([30.0, 40.0]), (60, 80), 0.2)
    ours = turned(blender)
    np.testing.assert_allclose(ours.angles, (0, 0, 0), atol=1e-12)
    np.testing.assert_allclose(ours.target, (0, 0.9, 0))
    head_and_nose = np.array([[0, 0, 1.8], [0, -0.2, 1.7]])
    turned_points = np.array([[0, 1.8, 0], [0, 1.7, 0.2]])
    np.testing.assert_allclose(ours.project(turned_points)[0], blender.project(head_and_nose)[0])


def test_the_mannequin_turns_with_its_world(toonset, tmp_path: Path) -> None:
    write_transforms(tmp_path / "out", views_all_round(2, k=0.2), None, tetrahedron())
    own = toonset("import", tmp_path / "out", "-o", tmp_path / "back", "--up", "z")
    assert "leave out --up z" in own.reason
    (tmp_path / "out" / "toonset.json").unlink()
    done = toonset("import", tmp_path / "out", "-o", tmp_path / "back", "--up", "z", "--json")
    assert done.code == 0, done
    vertices = load_mesh(tmp_path / "back" / "mannequin.obj").vertices
    expected = tetrahedron().vertices[:, [0, 2, 1]] * [1, 1, -1]
    np.testing.assert_allclose(np.sort(vertices, axis=0), np.sort(expected, axis=0))


@pytest.fixture
def colmap(tmp_path: Path) -> Path:
    views = views_all_round(6, k=0.2)
    for view in views:
        view.rgba[..., :3] = (200, 30, 20)
    write_colmap(tmp_path / "out", views, None, tetrahedron())
    return tmp_path / "out"


def test_an_imported_bundle_is_a_bundle(toonset, colmap: Path, tmp_path: Path) -> None:
    done = toonset("import", colmap, "-o", tmp_path / "b")
    assert (done.code, done.out.strip()) == (0, str(tmp_path / "b"))
    assert "6 views of COLMAP, exact cameras of toonset.json" in done.err
    assert "exists already" in toonset("import", colmap, "-o", tmp_path / "b").reason
    assert toonset("palette", tmp_path / "b", "-q").code == 0
    assert toonset("check", tmp_path / "b").code == 0
    assert toonset("info", tmp_path / "b").code == 0


@pytest.mark.slow
def test_an_imported_bundle_trains(toonset, colmap: Path, tmp_path: Path) -> None:
    assert toonset("import", colmap, "-o", tmp_path / "b").code == 0
    few = ("--steps", 2, "--threads", 1, "--device", "cpu", "-q")
    assert toonset("train", tmp_path / "b", *few, "--strict").code == 3  # weak: two steps
