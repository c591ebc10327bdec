"""The mannequin made by code: a clean symmetric body whatever is asked, and its two files."""

import errno
import os
from collections import Counter
from dataclasses import replace
from functools import cache
from typing import get_args

import numpy as np
import pytest

from toonset.dataset.mannequin.landmark_file import read_known_points
from toonset.dataset.mannequin.make import HEIGHT, Mannequin, make_mannequin
from toonset.dataset.mannequin.options import MannequinOptions, Pose
from toonset.dataset.mannequin.solids import blended, ellipsoid, joined, limb
from toonset.dataset.mesh.load import load_mesh
from toonset.errors import MeshError
from toonset.mesh import Mesh

SIDED = ("upper_arm", "forearm", "hand", "thigh", "shin", "foot")
PARTS = {
    *("head", "neck", "torso", "pelvis"),
    *(f"{side}_{name}" for side in ("left", "right") for name in SIDED),
}
TOUCHING = {  # parts that may share an edge, sides left out
    *(("head", "neck"), ("neck", "torso"), ("pelvis", "torso"), ("torso", "upper_arm")),
    *(("forearm", "upper_arm"), ("forearm", "hand"), ("pelvis", "thigh"), ("shin", "thigh")),
    *(("foot", "shin"), ("thigh", "torso"), ("neck", "upper_arm"), ("head", "torso")),
}
USUAL = [
    *(MannequinOptions(heads, "relaxed") for heads in (2.0, 3.0, 8.0)),
    *(MannequinOptions(heads, "T") for heads in (2.0, 8.0)),
    MannequinOptions(3.0, "A"),
]
EXTREMES = [
    *USUAL,
    *(
        MannequinOptions(heads, "relaxed", *scales)
        for heads in (2.0, 8.0)
        for scales in ((0.7, 0.7, 0.7), (1.4, 0.7, 1.4), (0.7, 1.4, 0.7))
    ),
]


@cache
def made(options: MannequinOptions) -> Mannequin:
    return make_mannequin(options)


def edges_of(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the edges with their faces: (e, 2) vertices and (e, 2) faces of a closed surface."""
    ends = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, counts = np.unique(ends, axis=0, return_counts=True)
    assert (counts == 2).all()
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    return edges, (order // 3).reshape(-1, 2)


def part_extent(mesh: Mesh, name: str) -> np.ndarray:
    assert mesh.face_parts is not None
    own = mesh.faces[mesh.face_parts == mesh.part_names.index(name)]
    return np.ptp(mesh.vertices[own].reshape(-1, 3), axis=0)


@pytest.mark.parametrize("options", EXTREMES, ids=str)
def test_one_closed_surface_of_even_triangles_without_handles(options):
    """Euler's number is 2: nothing is torn, no hand grows into a hip, no arm into a trunk."""
    mesh = made(options).mesh
    edges, _ = edges_of(mesh)
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)
    assert len(mesh.vertices) - len(edges) + len(mesh.faces) == 2
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0  # faces look outside
    sides = np.linalg.norm([a - b, b - c, c - a], axis=2)
    twice_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    flatness = twice_area / sides.max(axis=0) ** 2  # 0.87 for equal sides
    assert np.quantile(flatness, 0.01) > 0.2
    assert flatness.min() > 0.01


@pytest.mark.parametrize("options", USUAL, ids=str)
def test_only_neighbouring_parts_touch(options):
    mesh = made(options).mesh
    assert mesh.face_parts is not None
    assert {mesh.part_names[part] for part in np.unique(mesh.face_parts)} == PARTS
    pairs = np.sort(mesh.face_parts[edges_of(mesh)[1]], axis=1)
    for i, j in np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0):
        names = mesh.part_names[i], mesh.part_names[j]
        bare = sorted(name.removeprefix("left_").removeprefix("right_") for name in names)
        assert tuple(bare) in TOUCHING, names
        assert len({name.split("_")[0] for name in names} & {"left", "right"}) < 2, names


@pytest.mark.parametrize("options", EXTREMES[::2], ids=str)
def test_mirror_symmetric_to_the_last_bit(options):
    mesh = made(options).mesh
    mirrored = Counter(map(tuple, (mesh.vertices * [-1, 1, 1] + 0.0).tolist()))
    assert Counter(map(tuple, (mesh.vertices + 0.0).tolist())) == mirrored
    half = len(mesh.faces) // 2
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    np.testing.assert_allclose(middles[:half] * [-1, 1, 1], middles[half:], atol=1e-12)
    assert (middles[:half, 0] > 0).all()
    assert mesh.face_parts is not None
    for left, right in zip(mesh.face_parts[:half], mesh.face_parts[half:], strict=True):
        assert mesh.part_names[left].replace("left_", "right_") == mesh.part_names[right]


@pytest.mark.parametrize("options", USUAL, ids=str)
def test_stands_on_the_ground_in_its_size(options):
    mesh = made(options).mesh
    assert mesh.bounds[0, 1] == 0
    assert mesh.height == pytest.approx(HEIGHT)
    assert 4000 < len(mesh.faces) < 9000
    for side in ("left", "right"):
        assert part_extent(mesh, f"{side}_foot")[2] > 1.5 * part_extent(mesh, f"{side}_foot")[0]


@pytest.mark.parametrize("heads", [2.0, 3.0, 8.0])
def test_heads_tall(heads):
    head = part_extent(made(MannequinOptions(heads)).mesh, "head")[1]
    assert head * heads == pytest.approx(HEIGHT, rel=0.06)


@pytest.mark.parametrize(
    ("option", "part", "axis"),
    [("head_scale", "head", 0), ("torso_scale", "torso", 2), ("limb_scale", "left_shin", 2)],
)
def test_scales_widen_their_part(option, part, axis):
    usual = MannequinOptions()
    sizes = [
        part_extent(made(replace(usual, **{option: scale})).mesh, part)[axis]
        for scale in (1.0, 1.4)
    ]
    assert sizes[1] / sizes[0] == pytest.approx(1.4, rel=0.1)


def test_poses_raise_the_arms():
    wrists = {
        pose: made(MannequinOptions(3.0, pose)).landmarks["left_wrist"] for pose in get_args(Pose)
    }
    shoulder = made(MannequinOptions()).landmarks["left_shoulder"]
    assert wrists["T"][1] == pytest.approx(shoulder[1], abs=1e-3)
    assert wrists["T"][0] > wrists["A"][0] > wrists["relaxed"][0] > shoulder[0]
    assert wrists["T"][1] > wrists["A"][1] > wrists["relaxed"][1]


@pytest.mark.parametrize("options", USUAL, ids=str)
def test_landmarks_lie_where_they_should(options):
    mannequin = made(options)
    points, mesh = mannequin.landmarks, mannequin.mesh
    for name in ("head_top", "chin", "nose", "left_eye", "right_toe"):
        gap = np.linalg.norm(mesh.vertices - points[name], axis=1).min()
        assert gap < 0.02 * HEIGHT, name
    assert points["head_top"][1] == pytest.approx(HEIGHT, rel=2e-3)
    down = ("head_top", "left_eye", "nose", "chin", "neck", "left_hip", "left_knee", "left_ankle")
    heights = [points[name][1] for name in down]
    assert heights == sorted(heights, reverse=True)
    for name, point in points.items():
        if name.startswith("left_"):
            assert point[0] > 0
            mirror = points[name.replace("left_", "right_")]
            np.testing.assert_array_equal(mirror, point * [-1, 1, 1])
    assert points["nose"][2] > points["left_eye"][2] > 0  # it faces +Z
    assert points["left_toe"][2] > points["left_ankle"][2]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"heads_tall": 1.5}, "heads_tall: 1.5 is out of range; give 2 to 8"),
        ({"heads_tall": float("nan")}, "heads_tall: nan"),
        ({"limb_scale": 3.0}, "limb_scale: 3.0 is out of range; give 0.7 to 1.4"),
        ({"pose": "Y"}, "pose: 'Y' is none of T, A, relaxed"),
    ],
)
def test_impossible_bodies_are_refused(wrong, words):
    with pytest.raises(MeshError, match=words):
        MannequinOptions(**wrong)


def test_a_limb_is_measured_exactly():
    straight = limb((0, 0, 0), (1, 0, 0), 0.25, 0.25)
    points = np.array([[0.5, 1, 0], [-1, 0, 0], [2, 0, 0], [0.5, 0, 0]])
    np.testing.assert_allclose(straight(points), [0.75, 0.75, 0.75, -0.25])


def test_blending_only_adds_and_only_nearby():
    one, other = ellipsoid((-0.4, 0, 0), (0.5, 0.3, 0.2)), ellipsoid((0.4, 0, 0), (0.5, 0.3, 0.2))
    points = np.random.default_rng(5).uniform(-1, 1, (500, 3))
    hard, soft = joined(one, other)(points), blended(0.1, one, other)(points)
    far = np.abs(one(points) - other(points)) > 0.1
    np.testing.assert_array_equal(soft[far], hard[far])
    assert (soft <= hard).all()
    assert (hard - soft).max() <= 0.1 / 4 + 1e-12


def test_the_files_hold_the_body(toonset, tmp_path):
    out = tmp_path / "new" / "body.obj"
    done = toonset("mannequin", "-o", out, "--heads", 3, "--pose", "a", "--json", "-q")
    assert (done.code, done.err) == (0, "")
    assert {path.name for path in out.parent.iterdir()} == {"body.obj", "body.landmarks.json"}
    expected, mesh = make_mannequin(MannequinOptions(3.0, "A")), load_mesh(out)
    assert done.json["faces"] == len(mesh.faces) == len(expected.mesh.faces)
    assert set(mesh.part_names) == PARTS
    read, made = (np.unique(one.vertices, axis=0) for one in (mesh, expected.mesh))
    np.testing.assert_array_equal(read, made)
    edges_of(mesh)
    points = read_known_points(out)
    assert points.keys() == expected.landmarks.keys()
    for name, point in expected.landmarks.items():
        np.testing.assert_array_equal(points[name], point)


def test_nothing_is_replaced_without_force(toonset, snapshot, tmp_path):
    out, marks = tmp_path / "body.obj", "body.landmarks.json"
    (tmp_path / marks).write_text("mine")
    before = snapshot(tmp_path)
    assert f"{marks}: exists already; pass --force" in toonset("mannequin", "-o", out).reason
    assert snapshot(tmp_path) == before
    assert toonset("mannequin", "-o", out, "--force", "-q").code == 0
    assert read_known_points(out)


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("body.glb", "body.glb: a mannequin is written as .obj; choose another -o"),
        ("folder.obj", "folder.obj: is a folder, a file is needed"),
        ("file/body.obj", "body.obj: file is a file; choose another"),
        ("x" * 300 + ".obj", "File name too long"),
    ],
)
def test_places_that_cannot_be_written(out, words, toonset, snapshot, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "file").write_text("old")
    before = snapshot(tmp_path)
    assert words in toonset("mannequin", "-o", out, "--force").reason
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize("files_that_fit", [0, 1])
def test_a_full_disk_leaves_both_files_as_they_were(
    files_that_fit, toonset, snapshot, tmp_path, monkeypatch
):
    out = tmp_path / "body.obj"
    assert toonset("mannequin", "-o", out, "-q").code == 0
    before, sync, left = snapshot(tmp_path), os.fsync, [files_that_fit]

    def full(handle: int) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(handle)

    monkeypatch.setattr(os, "fsync", full)
    done = toonset("mannequin", "-o", out, "--heads", 6, "--force", "-q")
    assert "cannot be written (No space left on device); free space" in done.reason
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize("wrong", [("--heads", 9), ("--pose", "Y"), ("--limbs", 0.1)])
def test_usage_mistakes_name_the_option(wrong, toonset, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert wrong[0] in toonset("mannequin", *wrong).reason
    assert not list(tmp_path.iterdir())
