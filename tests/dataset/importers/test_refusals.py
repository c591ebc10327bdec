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
from toonset.dataset.images.picture import encode_png
from toonset.dataset.importers.detect import read_import
from toonset.dataset.importers.to_bundle import write_imported
from toonset.errors import BundleError, ToonsetError
from toonset.write import write_bytes


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
        (lambda c: c["views"][0].update(radius=1e6), "reaches the pinholes, .*; export it again"),
        (lambda c: c["views"][0].update(radius=1e300), "radius"),
        (lambda c: c.update(views=[]), "views"),
    ],
)
def test_damaged_records_are_refused(tmp_path, edit, words):
    write_gltf(tmp_path / "out", views_all_round(2))
    change(tmp_path / "out" / "toonset.json", edit)
    with pytest.raises(ToonsetError, match=words):
        read_import(tmp_path / "out")


def test_what_holds_no_cameras_is_refused(toonset, tmp_path: Path) -> None:
    write_transforms(tmp_path / "out", views_all_round(2, k=0.2))
    (tmp_path / "empty").mkdir()
    (tmp_path / "x.png").write_bytes(encode_png(np.zeros((2, 2, 4), np.uint8)))
    write_imported(tmp_path / "bundle", read_import(tmp_path / "out"), None)
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
