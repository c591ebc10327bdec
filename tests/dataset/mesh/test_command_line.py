"""Meshes on the command line: which way is up, and what is said of them."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.dataset.mesh.figure import BOXES, level, obj_text
from toonset.dataset.mesh.load import load_mesh, save_obj
from toonset.mesh import Z_UP, Mesh

SMALL = ("--views", "3", "--cell", "80")


def lying(mesh: Mesh) -> bytes:
    """Return a mesh's file with +Z up, front -Y."""
    return save_obj(Mesh(mesh.vertices @ Z_UP, mesh.faces))


@pytest.fixture
def figure(tmp_path: Path) -> Path:
    """Return the file of a figure that lies on its back."""
    (tmp_path / "standing.obj").write_text(obj_text())
    (tmp_path / "lying.obj").write_bytes(lying(load_mesh(tmp_path / "standing.obj")))
    return tmp_path / "lying.obj"


def test_synth_stands_a_mesh_up(toonset, figure, tmp_path):
    plain = toonset("synth", figure, *SMALL, "-o", tmp_path / "plain")
    assert plain.code == 0
    assert "lying.obj: is 1.7 deep and 0.3 high: if it lies on its back" in plain.err
    done = toonset("synth", figure, *SMALL, "--up", "z", "-o", tmp_path / "turned")
    assert done.code == 0
    assert "lies on its back" not in done.err
    own = load_mesh(tmp_path / "turned" / "mannequin.obj")
    np.testing.assert_allclose(own.bounds, load_mesh(figure.with_name("standing.obj")).bounds)
    assert toonset("synth", figure, "--up", "x", "-o", tmp_path / "none").code == 2


def test_synth_says_what_is_missing_and_left_out(toonset, tmp_path):
    text = "mtllib gone.mtl\n" + obj_text([("Plane", level(4))])
    (tmp_path / "a.obj").write_text(text)
    done = toonset("synth", tmp_path / "a.obj", *SMALL, "-o", tmp_path / "out")
    assert done.code == 0
    lines = done.err.splitlines()
    assert "a.obj: names files that are not beside it: gone.mtl; their colours are lost" in lines
    assert "a.obj: left out Plane: flat, and wider than the rest is tall" in lines
    assert set(load_mesh(tmp_path / "out" / "mannequin.obj").part_names) == set(BOXES)


def test_calibrate_stands_a_mesh_up_and_records_it(toonset, drawn, calibrated, tmp_path):
    mesh = tmp_path / "lying.obj"
    mesh.write_bytes(lying(load_mesh(drawn / "mannequin.obj")))
    bundle = tmp_path / "bundle"
    sheet = drawn / "sheet.png"
    done = toonset("calibrate", sheet, "--mesh", mesh, "--up", "z", "-o", bundle, "--json", "-q")
    assert done.code == 0
    own, other = done.json["views"], calibrated[1].json["views"]
    for one, two in zip(own, other, strict=True):
        np.testing.assert_allclose(
            one["camera"]["camera_from_world_rotation"],
            two["camera"]["camera_from_world_rotation"],
            atol=1e-3,
        )
    options = json.loads((bundle / "calibration.json").read_text())["options"]
    assert options["up"] == "z"
    assert "up" not in calibrated[1].json["options"]


def test_export_stands_a_mesh_up(toonset, bundle, drawn, tmp_path):
    mesh = tmp_path / "lying.obj"
    mesh.write_bytes(lying(load_mesh(drawn / "mannequin.obj")))
    out = tmp_path / "out"
    done = toonset("export", bundle, "--to", "gltf", "--mesh", mesh, "--up", "z", "-o", out)
    assert done.code == 0
    own, given = load_mesh(out / "mannequin.obj"), load_mesh(drawn / "mannequin.obj")
    np.testing.assert_allclose(own.bounds, given.bounds, atol=1e-9)
