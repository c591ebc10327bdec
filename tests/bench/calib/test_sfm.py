"""The COLMAP baseline: right where photographs allow it, and its failures are results."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
import trimesh
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial.transform import Rotation

from bench.calib.measure import bench_colmap
from bench.calib.sfm import SfmOptions, aligned_errors, pictures, reconstruct
from bench.cases.cases import CalibCase
from toonset.camera import Camera, rotation_from_angles
from toonset.dataset.mesh.rasterize import depth_map
from toonset.mesh import Mesh
from toonset.view import View

SIDE = 260


def textured(mesh: Mesh, camera: Camera) -> View:
    """Return the mesh painted with solid noise: what photographs have and drawings do not."""
    noise = np.random.default_rng(3).random((64, 64, 64, 3))
    grain = np.stack([gaussian_filter(noise[..., i], 0.8, mode="wrap") for i in range(3)], axis=-1)
    depth = depth_map(mesh.vertices, mesh.faces, camera)
    seen = np.isfinite(depth)
    points = camera.unproject(camera.pixel_grid()[seen], depth[seen])
    where = (points * 30).T
    colors = [map_coordinates(grain[..., i], where, order=1, mode="grid-wrap") for i in range(3)]
    rgba = np.zeros((*depth.shape, 4), dtype=np.uint8)
    rgba[seen, :3] = np.clip((np.stack(colors, axis=1) - 0.5) * 700 + 128, 0, 255)
    rgba[seen, 3] = 255
    return View(rgba, (0, 0, SIDE, SIDE), 0.0, "000.png")


def photographed(count: int) -> CalibCase:
    box = trimesh.creation.box([1.5, 1.2, 1.0])
    mesh = Mesh(np.asarray(box.vertices), np.asarray(box.faces))
    cameras = [
        Camera.looking_at(mesh.middle, 0.5 + 0.2 * i, 0.3, 110.0, (SIDE, SIDE), k=0.4)
        for i in range(count)
    ]
    views = tuple(textured(mesh, camera) for camera in cameras)
    return CalibCase("noise", "photo", views, mesh, np.stack([c.rotation for c in cameras]))


def turned(seed: int, count: int = 6) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack([rotation_from_angles(*rng.uniform(-1.5, 1.5, 3)) for _ in range(count)])


def test_textured_photographs_are_placed_to_a_few_degrees() -> None:
    case = photographed(3)
    found = reconstruct(case.views, SfmOptions(height_px=0), 0)
    assert not found.failed
    assert len(found.rotations) == 3
    raw, modulo_twin = aligned_errors(found.rotations, case.rotations)
    assert np.degrees(raw).max() < 3  # 1.2 to 2.5 by the pictures' last digits
    assert modulo_twin == raw
    again = reconstruct(case.views, SfmOptions(height_px=0), 0)
    np.testing.assert_allclose(again.rotations[1], found.rotations[1], atol=1e-6)


def test_the_worlds_own_rotation_is_no_error() -> None:
    truth, world = turned(0), rotation_from_angles(0.7, -0.4, 1.1)
    raw, modulo_twin = aligned_errors({i: truth[i] @ world for i in (0, 2, 5)}, truth)
    np.testing.assert_allclose([raw, modulo_twin], 0, atol=1e-6)


def test_a_depth_reversed_model_is_right_modulo_the_twin() -> None:
    truth, flip = turned(1), np.diag([1.0, 1.0, -1.0])
    raw, modulo_twin = aligned_errors({i: flip @ r @ flip for i, r in enumerate(truth)}, truth)
    np.testing.assert_allclose(modulo_twin, 0, atol=1e-6)
    assert max(raw) > 0.1


def test_a_stray_view_does_not_spoil_the_others() -> None:
    truth = turned(2)
    found = dict(enumerate(truth))
    found[3] = truth[3] @ Rotation.from_rotvec([0.0, 2.0, 0.0]).as_matrix()
    raw, _ = aligned_errors(found, truth)
    assert raw[3] == pytest.approx(2.0)
    np.testing.assert_allclose(np.delete(raw, 3), 0, atol=1e-6)


def test_no_model_has_no_errors() -> None:
    assert aligned_errors({}, turned(3)) == ([], [])


@pytest.mark.parametrize("height_px", [0, 100, 900])
def test_pictures_are_equal_in_size_and_never_smaller(height_px: int) -> None:
    views = [
        View(np.full((h, w, 4), 60, np.uint8) | [0, 0, 0, 255], (0, 0, w, h), 0.0, "000.png")
        for h, w in ((120, 60), (140, 50))
    ]
    canvases = pictures(views, height_px)
    assert len({canvas.shape for canvas in canvases}) == 1
    assert canvases[0].shape[0] >= max(140, height_px)
    for canvas, view in zip(canvases, views, strict=True):
        assert (canvas[[0, -1]] == 255).all()
        share = (canvas < 200).all(axis=-1).mean() * canvas.shape[0] * canvas.shape[1]
        factor = canvas.shape[0] / (140 + 2 * math.ceil(14))
        assert share == pytest.approx(view.rgba[..., 0].size * factor**2, rel=0.03)


def test_a_crash_or_a_hang_is_a_failed_run(monkeypatch: pytest.MonkeyPatch) -> None:
    case = photographed(2)
    assert "not done after 0 s" in reconstruct(case.views, SfmOptions(), 0, timeout_s=0.01).failed
    monkeypatch.setattr(sys, "executable", "false")
    found = reconstruct(case.views, SfmOptions(), 0)
    assert found.failed == "exit code 1: no message"
    assert not found.rotations
    records = {r.metric: r for r in bench_colmap([case], 0, quick=True)}
    assert records["failed runs"].value == 1
    assert records["views not placed"].value == 2
    assert "rotation error" not in records
