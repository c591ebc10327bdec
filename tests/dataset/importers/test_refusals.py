"""Imports: what cannot be honoured, or contradicts itself, is refused by name."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap
import pytest

from tests.dataset.importers.imported_views import (
    OWN_CAMERAS,
    WRITERS,
    change,
    tetrahedron,
    views_all_round,
)
from toonset.dataset.exporters.colmap import write_colmap
from toonset.dataset.exporters.gltf import write_gltf
from toonset.dataset.exporters.nerfstudio import write_transforms
from toonset.dataset.exporters.opencv import write_opencv
from toonset.dataset.images.picture import encode_png
from toonset.dataset.importers.detect import read_import
from toonset.dataset.importers.to_bundle import write_imported
from toonset.errors import BundleError, ToonsetError
from toonset.write import write_bytes


@pytest.fixture
def opencv(tmp_path: Path) -> Path:
    write_opencv(tmp_path / "out", views_all_round(2, k=0.2))
    (tmp_path / "out" / "toonset.json").unlink()
    return tmp_path / "out"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("data: [ 0., 0., 0., 0., 0. ]", "data: [ .1, 0., 0., 0., 0. ]", "undistort the pictures"),
        ("images/000.png", "../000.png", "lies outside of the folder"),
        ("images/000.png", "images/9.png", "the picture does not exist"),
        ("image_width: 90", "image_width: 91", "its camera says 91 x 120"),
        ("image_width: 90", "image_width: -1", "must be positive"),
        ("image_width: 90", "image_width: 2000000000", "megapixels"),
        ("views:", "shots:", "0 entries in its list `views`"),
        ("camera_matrix:", "lens:", "camera_matrix is missing or no matrix"),
        ("tvec: !!opencv", "t: !!opencv", "tvec is missing"),
        ("rows: 3", "rows: 9999999", "no OpenCV YAML"),
        ("%YAML 1.2", "hello", "no OpenCV YAML"),
        ("%YAML 1.2", "<?xml version='1.0'?>", "no OpenCV YAML"),
        ("0., 0., 1. ]", ".Nan, 0., 1. ]", "not finite"),
        ("data: [ 235", "data: [ -235", "camera_matrix is not"),
        ("-\n      name", "name", "no OpenCV YAML"),
    ],
)
def test_damaged_opencv_files_are_refused(toonset, opencv, tmp_path, old, new, words):
    file = opencv / "cameras.yml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    assert words in toonset("import", opencv, "-o", tmp_path / "b").reason
    assert not (tmp_path / "b").exists()


def test_an_opencv_file_with_one_of_both_rotations_is_enough(toonset, opencv: Path, tmp_path: Path):
    file = opencv / "cameras.yml"
    whole = read_import(opencv)
    file.write_text(file.read_text().replace("R: !!opencv", "Q: !!opencv"))
    for old, new in zip(whole.views, read_import(opencv).views, strict=True):
        np.testing.assert_allclose(new.camera.rotation, old.camera.rotation, atol=1e-9)


def test_cut_off_opencv_files_are_refused_or_whole(toonset, opencv: Path, tmp_path: Path) -> None:
    data = (opencv / "cameras.yml").read_bytes()
    rng = np.random.default_rng(2)
    codes = set()
    for number in range(40):
        cut = bytearray(data[: rng.integers(1, len(data))])
        for _ in range(3):
            cut[rng.integers(len(cut))] = rng.integers(256)
        (opencv / "cameras.yml").write_bytes(cut)
        done = toonset("import", opencv, "-o", tmp_path / f"b{number}")
        codes.add(done.code)
        assert done.code == 0 or "cameras.yml" in done.reason or "images" in done.reason
    assert 2 in codes


@pytest.mark.parametrize("kind", OWN_CAMERAS)
def test_cameras_that_were_changed_beside_toonset_json_are_refused(tmp_path, kind):
    WRITERS[kind](tmp_path / "out", views_all_round(k=0.2), tetrahedron())

    def edit(content: dict[str, Any]) -> None:
        content["views"][1]["camera"]["target"][0] += 0.3

    change(tmp_path / "out" / "toonset.json", edit)
    with pytest.raises(BundleError, match=r"disagree; remove toonset\.json"):
        read_import(tmp_path / "out")


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda c: c.update(schema="toonset-export/2"), "newer than this toonset"),
        (lambda c: c["views"][0].update(picture="../../etc/passwd"), "lies outside"),
        (lambda c: c["views"][0].pop("camera"), "field views.0.camera"),
        (lambda c: c["views"][0]["camera"].update(scale=-1), "must be positive"),
        (lambda c: c["views"][0].update(pinhole_distance=0), "pinhole_distance"),
        (lambda c: c.update(views=[]), "views"),
    ],
)
def test_damaged_records_are_refused(tmp_path, edit, words):
    write_gltf(tmp_path / "out", views_all_round(2))
    change(tmp_path / "out" / "toonset.json", edit)
    with pytest.raises(ToonsetError, match=words):
        read_import(tmp_path / "out")


def test_what_holds_no_cameras_is_refused(toonset, opencv: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "x.png").write_bytes(encode_png(np.zeros((2, 2, 4), np.uint8)))
    write_imported(tmp_path / "bundle", read_import(opencv), None)
    for name, words in (
        ("empty", "holds no cameras"),
        ("none", "does not exist"),
        ("x.png", "holds no cameras"),
        ("bundle", "is of a bundle already"),
    ):
        assert words in toonset("import", tmp_path / name, "-o", tmp_path / "b").reason
    assert not (tmp_path / "b").exists()


def test_distorted_colmap_cameras_are_refused_by_name(toonset, tmp_path: Path) -> None:
    write_colmap(tmp_path / "out", views_all_round(2, k=0.2))
    sparse = tmp_path / "out" / "sparse" / "0"
    model = pycolmap.Reconstruction(sparse)
    lens = model.cameras[1]
    lens.model = pycolmap.CameraModelId.SIMPLE_RADIAL
    lens.params = [100.0, 50.0, 60.0, 0.1]
    model.write(sparse)
    reason = toonset("import", tmp_path / "out", "-o", tmp_path / "b").reason
    assert "SIMPLE_RADIAL camera, PINHOLE or SIMPLE_PINHOLE" in reason
    assert "undistort" in reason


def test_equal_names_in_one_folder_are_refused(tmp_path: Path) -> None:
    views = views_all_round(2, k=0.2)
    write_transforms(tmp_path / "out", views)
    (tmp_path / "out" / "toonset.json").unlink()
    write_bytes(tmp_path / "out" / "images" / "000.bmp", b"")

    def edit(content: dict[str, Any]) -> None:
        content["frames"][1]["file_path"] = "images/000.bmp"

    change(tmp_path / "out" / "transforms.json", edit)
    with pytest.raises(BundleError, match=r"2 pictures would be named images_000\.png"):
        read_import(tmp_path / "out")


def test_pictures_of_another_size_are_refused(toonset, tmp_path: Path) -> None:
    views = views_all_round(2, k=0.2)
    write_colmap(tmp_path / "out", views)
    small = replace(views[0], rgba=views[0].rgba[:9, :9])
    write_bytes(tmp_path / "out" / "images" / "000.png", encode_png(small.rgba))
    reason = toonset("import", tmp_path / "out", "-o", tmp_path / "b").reason
    assert "is 9 x 9 px, its camera says 90 x 120" in reason
    assert not (tmp_path / "b").exists()
