"""Meshes that face away or lie on their back are turned or spoken of; morph targets are applied."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.dataset.mesh.figure import obj_text, scene
from tests.dataset.mesh.mesh_files import FACES, ONE_NODE, POINTS, gltf, load
from toonset.dataset.mesh.load import load_mesh

CORNERS = FACES.reshape(-1, 3)
MOVES = np.array([[0, 0, 1.3], [0, 2.1, 0], [3.7, 0, 0], [0, 0, -1.9]], dtype=np.float32)


def test_vrm_0_is_turned_and_vrm_1_is_not(tmp_path: Path) -> None:
    plain = load(tmp_path, "a.gltf", scene())
    first = load(tmp_path, "b.gltf", scene(extensions={"VRM": {"specVersion": "0.0"}}))
    np.testing.assert_array_equal(
        first.vertices[first.faces], (plain.vertices * [-1, 1, -1])[plain.faces]
    )
    assert first.remarks == ("b.gltf: is VRM 0, which faces -Z: turned by 180 degrees about +Y",)
    both = {"VRMC_vrm": {"specVersion": "1.0"}}
    for extensions in (both, {**both, "VRM": {}}):
        second = load(tmp_path, "c.gltf", scene(extensions=extensions))
        np.testing.assert_array_equal(second.vertices, plain.vertices)
        assert second.remarks == ()


def lying(tmp_path: Path) -> Path:
    """Return the figure's file with +Z up, front -Y."""
    lines = []
    for line in obj_text().splitlines():
        key, *words = line.split()
        if key == "v":
            x, y, z = map(float, words)
            line = f"v {x} {-z} {y}"
        lines.append(line)
    (tmp_path / "lying.obj").write_text("\n".join(lines))
    return tmp_path / "lying.obj"


def test_up_z_stands_a_mesh_up(tmp_path: Path) -> None:
    file = lying(tmp_path)
    standing = load(tmp_path, "a.obj", obj_text())
    turned = load_mesh(file, up="z")
    np.testing.assert_allclose(turned.vertices[turned.faces], standing.vertices[standing.faces])
    assert (turned.up, turned.remarks) == ("z", ())
    assert standing.up == "y"


def test_a_mesh_on_its_back_is_spoken_of(tmp_path: Path) -> None:
    (said,) = load_mesh(lying(tmp_path)).remarks
    assert said.startswith("lying.obj: is 1.7 deep and 0.3 high")
    assert said.endswith("give --up z")
    assert load(tmp_path, "a.obj", obj_text()).remarks == ()


def morphed(tmp_path: Path, of_mesh: Any, of_node: Any, **target: Any) -> np.ndarray:
    document = gltf(ONE_NODE, POINTS, FACES, MOVES, POINTS * np.float32(0.5))
    primitive = document["meshes"][0]["primitives"][0]
    primitive["targets"] = [{"POSITION": 2}, {"POSITION": 3}, {"NORMAL": 3}]
    document["meshes"] = [{"primitives": [primitive], "weights": of_mesh}]
    document["nodes"] = [{"mesh": 0, "weights": of_node}]
    document["accessors"][2] |= target
    for holder in (document["meshes"][0], document["nodes"][0]):
        if holder["weights"] is None:
            del holder["weights"]
    mesh = load(tmp_path, "a.gltf", json.dumps(document))
    return mesh.vertices[mesh.faces]


@pytest.mark.parametrize(
    ("of_mesh", "of_node", "weights"),
    [
        ([1, 0, 0], None, (1, 0)),
        ([0.5, 0, 0], None, (0.5, 0)),
        ([0.5, 1, 1], None, (0.5, 1)),
        ([1, 0, 0], [0, 0.25, 0], (0, 0.25)),
        (None, [-1, 0, 0], (-1, 0)),
        ([0, 0, 0], None, (0, 0)),
        ([1], None, (1, 0)),
        (None, None, (0, 0)),
    ],
)
def test_default_morph_weights(of_mesh: Any, of_node: Any, weights: Any, tmp_path: Path) -> None:
    expected = POINTS + weights[0] * MOVES + weights[1] * 0.5 * POINTS
    np.testing.assert_allclose(morphed(tmp_path, of_mesh, of_node), expected[CORNERS], atol=1e-6)


def test_sparse_morph_targets(tmp_path: Path) -> None:
    document = gltf(ONE_NODE, POINTS, FACES, MOVES[[1, 3]], np.array([1, 3], dtype=np.uint16))
    values, indices = document["accessors"][2], document["accessors"][3]
    sparse = {
        "count": 2,
        "indices": {"bufferView": indices["bufferView"], "componentType": 5123},
        "values": {"bufferView": values["bufferView"]},
    }
    document["accessors"].append(
        {"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse}
    )
    document["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 4}]
    document["meshes"][0]["weights"] = [0.5]
    mesh = load(tmp_path, "a.gltf", json.dumps(document))
    expected = POINTS.copy()
    expected[[1, 3]] += 0.5 * MOVES[[1, 3]]
    np.testing.assert_allclose(mesh.vertices[mesh.faces], expected[CORNERS], atol=1e-6)
    for broken in ({"count": 9}, {"indices": {"bufferView": 99, "componentType": 5123}}):
        document["accessors"][4]["sparse"] = sparse | broken
        with pytest.raises(Exception, match="damaged or cut off"):
            load(tmp_path, "a.gltf", json.dumps(document))


def test_landmarks_beside_a_mesh_are_turned_with_it(tmp_path: Path) -> None:
    from toonset.dataset.mannequin.landmark_file import read_known_points

    file = lying(tmp_path)
    points = {"schema": "toonset-landmarks/1", "units": "world", "points": {"nose": [0, -0.2, 1.6]}}
    file.with_suffix(".landmarks.json").write_text(json.dumps(points))
    mesh = load_mesh(file, up="z")
    assert read_known_points(file, mesh.world_from_file) == {"nose": (0.0, 1.6, 0.2)}
