"""The template bank on disk: the same templates, whatever happens to the cache."""

import os
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from toonset.calib.outline.mesh_edges import Surface, prepare_surface
from toonset.calib.outline.occluding_contour import mask_at
from toonset.calib.outline.pose import Pose, project
from toonset.calib.search import template_cache, templates
from toonset.calib.search.template_cache import bank_path, load_bank
from toonset.calib.search.templates import Templates, build_templates
from toonset.dataset.mesh.rasterize import silhouette_mask
from toonset.mesh import Mesh


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("TOONSET_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="module")
def surface() -> Surface:
    shape = trimesh.creation.capsule(1.0, 0.3, count=(10, 10))
    return prepare_surface(Mesh(np.array(shape.vertices)[:, [0, 2, 1]], np.array(shape.faces)))


def assert_bitwise_equal(a: Templates, b: Templates) -> None:
    for name in ("rotations", "masks", "boxes"):
        x, y = getattr(a, name), getattr(b, name)
        assert x.dtype == y.dtype
        assert x.tobytes() == y.tobytes()


def test_cached_equals_fresh_bit_for_bit_and_nothing_is_built_twice(surface, monkeypatch):
    fresh = build_templates(surface)
    assert_bitwise_equal(load_bank(surface), fresh)
    monkeypatch.setattr(template_cache, "build_templates", None)
    assert_bitwise_equal(load_bank(surface), fresh)


@pytest.mark.parametrize(
    "damage", ["empty", "cut", "flipped", "head", "text", "huge", "other arrays", "pickle"]
)
def test_a_damaged_file_is_built_again(surface, damage):
    fresh = load_bank(surface)
    path = bank_path(surface)
    assert path is not None
    data = path.read_bytes()
    arrays = {"other arrays": np.full((3, 3), 9), "pickle": np.array([{}], dtype=object)}
    if damage in arrays:
        np.savez(path, quarters=arrays[damage], boxes=np.zeros((1, 4)))
    else:
        middle = len(data) // 2
        flipped = data[:middle] + bytes([data[middle] ^ 255]) + data[middle + 1 :]
        head = bytes([*data[:70], data[70] ^ 64, *data[71:]])  # not even a Python literal
        wrong = {"empty": b"", "cut": data[:middle], "flipped": flipped, "head": head}
        wrong["text"] = b"hello"
        path.write_bytes(wrong.get(damage, data + bytes(template_cache.MOST_BYTES)))
    assert_bitwise_equal(load_bank(surface), fresh)
    assert path.read_bytes() == data  # and whole again


def test_a_folder_that_cannot_be_written_means_no_cache(surface, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("TOONSET_CACHE", str(tmp_path / "file"))
    assert_bitwise_equal(load_bank(surface), build_templates(surface))


def test_another_mesh_or_other_settings_have_a_file_of_their_own(surface, monkeypatch):
    moved = replace(surface, vertices=surface.vertices * 1.01)
    assert bank_path(moved) != bank_path(surface)
    before = bank_path(surface)
    monkeypatch.setattr(templates, "CELL_PX", 64)
    assert bank_path(surface) != before


def test_the_cache_follows_the_system(surface, monkeypatch, tmp_path):
    monkeypatch.delenv("TOONSET_CACHE")
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    path = bank_path(surface)
    assert path is not None
    assert path.parent == tmp_path / "xdg" / "toonset"


def test_only_the_newest_files_stay(surface, monkeypatch):
    monkeypatch.setattr(template_cache, "MOST_FILES", 3)
    paths = []
    for i in range(5):
        other = replace(surface, vertices=surface.vertices * (1 + i))
        load_bank(other)
        path = bank_path(other)
        assert path is not None
        if path.exists():
            os.utime(path, (i, i))
        paths.append(path)
    assert [path.exists() for path in paths] == [False, False, True, True, True]


def test_templates_show_what_the_triangles_cover(surface):
    pose = Pose(templates.grid()[17], np.array([48.0, 48.0]), 40.0)
    plain = silhouette_mask(project(pose, surface.vertices), surface.faces, (96, 96))
    assert (mask_at(surface, pose, (96, 96)) != plain).sum() <= 2
