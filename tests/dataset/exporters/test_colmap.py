"""COLMAP export: what another program reads is what the bundle says."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from lab.bench.cases.bodies import random_body
from tests.dataset.exporters.exported_views import bundle_of, noise, views_all_round
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame
from toonset.dataset.exporters.colmap import write_colmap
from toonset.dataset.exporters.common import ExportView, read_views
from toonset.dataset.exporters.points import TrackedPoints, sample_surface, track_points
from toonset.dataset.images.picture import load_rgba
from toonset.dataset.importers.colmap import read_colmap
from toonset.dataset.mesh.load import load_mesh, save_obj
from toonset.errors import BundleError
from toonset.mesh import Mesh


@pytest.fixture
def views(tmp_path: Path) -> tuple[ExportView, ...]:
    return read_views(bundle_of(views_all_round(3, picture=noise), tmp_path / "bundle"))


def with_points(text: bool, out: Path, count: int, *, old: bool = False) -> TrackedPoints:
    """Write a dataset with points of a body that fills every picture: none is dropped."""
    mesh = random_body(3)
    views = [replace(v, rgba=np.full_like(v.rgba, 255)) for v in views_all_round(4)]
    cameras = [view.pinhole for view in views]
    frames = [view.frame for view in views]
    points = track_points(sample_surface(mesh, count, 0), mesh, frames, cameras)
    write_colmap(out, views, points, text=text, old_layout=old)
    return points


def test_exact_cameras_stand_beside_the_model(views, tmp_path: Path) -> None:
    write_colmap(tmp_path / "out", views)
    beside = json.loads((tmp_path / "out" / "toonset.json").read_text())
    assert beside["pinhole_error_px"] == max(view.error_px for view in views) > 0
    for record, view in zip(beside["views"], views, strict=True):
        assert record["name"] == view.name
        assert record["camera"]["model"] == "orthographic"
        np.testing.assert_array_equal(record["camera"]["rotation"], view.camera.rotation)


@pytest.mark.parametrize("text", [False, True], ids=["bin", "txt"])
def test_pycolmap_projects_points_to_their_keypoints(tmp_path: Path, text: bool) -> None:
    points = with_points(text, tmp_path, 300)
    model = pycolmap.Reconstruction(tmp_path / "sparse" / "0")
    assert (model.num_reg_images(), model.num_points3D()) == (4, len(points.xyz))
    for i, (_, point) in enumerate(sorted(model.points3D.items())):
        np.testing.assert_allclose(point.xyz, points.xyz[i], atol=1e-9)
        np.testing.assert_array_equal(point.color, points.rgb[i])
        assert len(point.track.elements) == points.seen[:, i].sum() > 0
        for element in point.track.elements:
            image = model.images[element.image_id]
            seen = image.points2D[element.point2D_idx]
            lens, placed = model.cameras[image.camera_id], image.cam_from_world() * point.xyz
            projected = lens.img_from_cam(placed)
            assert projected is not None
            np.testing.assert_allclose(seen.xy, projected, atol=1e-4)


def test_pictures_are_over_white_and_masks_tell_the_figure(views, tmp_path: Path) -> None:
    write_colmap(tmp_path / "out", views)
    for view in views:
        figure = view.rgba[..., 3] == 255
        picture = load_rgba(tmp_path / "out" / "images" / view.name)
        mask = load_rgba(tmp_path / "out" / "masks" / f"{view.name}.png")
        assert (picture[~figure] == 255).all()
        np.testing.assert_array_equal(picture[figure, :3], view.rgba[figure, :3])
        np.testing.assert_array_equal(mask[..., 0] == 255, figure)


def quad(x: float, z: float, half: float) -> Mesh:
    """Return a square that faces +Z."""
    corners = [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]]
    return Mesh(np.array(corners) + np.array([x, 0, z]), np.array([[0, 1, 2], [0, 2, 3]]))


def front(scale: float = 40.0, yaw: float = 0.0) -> Camera:
    center = np.array([33.0, 27.5])
    return Camera.looking_at(
        np.zeros(3), yaw, 0.0, scale, (70, 60), center=center, k=0.01 / scale * 40
    )


def test_a_point_is_seen_where_nothing_lies_before_it() -> None:
    mesh = Mesh(
        np.concatenate([quad(0, 0.5, 0.3).vertices, quad(0, -0.5, 0.6).vertices]),
        np.concatenate([quad(0, 0, 1).faces, quad(0, 0, 1).faces + 4]),
    )
    red, blue = np.full((60, 70, 4), 255, np.uint8), np.full((60, 70, 4), 255, np.uint8)
    red[..., 1:3], blue[..., :2] = 0, 0
    cameras = [front(), front(yaw=math.pi)]
    frames = [Frame("a.png", cameras[0], red), Frame("b.png", cameras[1], blue)]
    hidden, near, beside = [0.0, 0.0, -0.5], [0.0, 0.0, 0.5], [0.5, 0.5, -0.5]
    points = track_points(np.array([hidden, near, beside]), mesh, frames, cameras)
    np.testing.assert_array_equal(points.seen, [[False, True, True], [True, False, True]])
    assert points.rgb[:2].tolist() == [[0, 0, 255], [255, 0, 0]]


def test_points_over_background_are_dropped() -> None:
    mesh, camera = quad(0.0, 0.0, 0.6), front()
    rgba = np.zeros((60, 70, 4), dtype=np.uint8)
    rgba[:, :33] = 255  # the figure is what lies left of the target
    frames = [Frame("a.png", camera, rgba)]
    points = track_points(sample_surface(mesh, 500, 1), mesh, frames, [camera])
    assert 150 < len(points.xyz) < 350
    assert points.xyz[:, 0].max() < 0.03 * mesh.height + 2 / 40


def test_surface_samples_lie_on_the_surface_and_follow_the_seed() -> None:
    mesh = quad(0.3, -0.2, 0.5)
    points = sample_surface(mesh, 2000, 7)
    np.testing.assert_allclose(points[:, 2], -0.2)
    np.testing.assert_allclose(points.mean(axis=0)[:2], [0.3, 0], atol=0.03)
    np.testing.assert_array_equal(points, sample_surface(mesh, 2000, 7))


@pytest.fixture
def dataset(views, tmp_path: Path) -> Path:
    write_colmap(tmp_path / "out", views)
    return tmp_path / "out"


def test_a_folder_without_a_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="holds no COLMAP model"):
        read_colmap(tmp_path)


@pytest.mark.parametrize("name", ["cameras.bin", "images.bin", "frames.bin", "points3D.bin"])
def test_a_damaged_model_is_refused(dataset: Path, name: str) -> None:
    file = dataset / "sparse" / "0" / name
    file.write_bytes(b"\x07" + file.read_bytes()[1 : len(file.read_bytes()) // 2])
    with pytest.raises(BundleError, match="no complete COLMAP model"):
        read_colmap(dataset)


@pytest.mark.parametrize("old", [False, True], ids=["new", "old"])
@pytest.mark.parametrize("text", [False, True], ids=["bin", "txt"])
def test_flipped_bits_end_in_one_line_or_a_camera(tmp_path: Path, text: bool, old: bool) -> None:
    """A damaged count must not fill memory, whichever file it stands in."""
    with_points(text, tmp_path / "out", 20, old=old)
    files = sorted((tmp_path / "out" / "sparse" / "0").iterdir())
    rng = np.random.default_rng(8)
    reasons = []
    for _ in range(60):
        file = files[rng.integers(len(files))]
        whole = file.read_bytes()
        damaged = bytearray(whole[: rng.integers(1, len(whole))] if rng.random() < 0.3 else whole)
        for _ in range(rng.integers(1, 4)):
            damaged[rng.integers(len(damaged))] ^= 1 << rng.integers(8)
        file.write_bytes(damaged)
        try:
            read_colmap(tmp_path / "out")
        except BundleError as error:
            reasons.append(str(error))
        file.write_bytes(whole)
    assert len(reasons) > 5
    assert not any("\n" in reason for reason in reasons)


def test_a_model_without_rigs_of_an_older_colmap_is_read(dataset: Path) -> None:
    before = read_colmap(dataset)
    for name in ("rigs.bin", "frames.bin"):
        (dataset / "sparse" / "0" / name).unlink()
    after = read_colmap(dataset / "sparse" / "0")
    for (_, a), (_, b) in zip(before, after, strict=True):
        np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-12)


def test_two_pictures_of_one_name_are_refused(tmp_path: Path) -> None:
    one, two = views_all_round(2)
    bundle = bundle_of((one, replace(two, name="000.jpg")), tmp_path / "bundle")
    with pytest.raises(BundleError, match=r"two pictures would be written as 000\.png"):
        read_views(bundle)


def test_export_writes_what_pycolmap_reads(toonset, tmp_path: Path) -> None:
    out, obj = tmp_path / "out", tmp_path / "m.obj"
    export = (
        "export",
        bundle_of(views_all_round(3, picture=noise), tmp_path / "b"),
        "--to",
        "colmap",
    )
    obj.write_bytes(save_obj(random_body(4)))
    bare = toonset(*export, "-o", out, "--json")
    assert bare.code == 0, bare
    assert bare.json["points"] > 1000
    assert "visual hull" in json.loads((out / "toonset.json").read_text())["points_are"]
    assert f"at most {bare.json['pinhole_error_px']:.2f} px off" in bare.err
    full = toonset(*export, "-o", out, "--mesh", obj, "--text", "--force", "--json")
    model = pycolmap.Reconstruction(out / "sparse" / "0")
    assert model.num_points3D() == full.json["points"] > 100
    assert (out / "sparse" / "0" / "points3D.txt").is_file()
    on_mesh = np.array([point.xyz for point in model.points3D.values()])
    low, high = load_mesh(obj).bounds
    assert ((on_mesh > low - 1e-6) & (on_mesh < high + 1e-6)).all()


def test_export_refuses_a_mannequin_that_is_not_there(toonset, tmp_path: Path) -> None:
    body = random_body(4)
    away = replace(body, vertices=body.vertices + np.array([50.0, 0, 0]))
    (tmp_path / "m.obj").write_bytes(save_obj(away))
    export = ("export", bundle_of(views_all_round(2), tmp_path / "bundle"), "--to", "colmap")
    outcome = toonset(*export, "-o", tmp_path / "out", "--mesh", tmp_path / "m.obj", "-q")
    assert "give the mannequin of the calibration" in outcome.reason
    assert not (tmp_path / "out").exists()


def test_pycolmap_leaves_sigterm_to_the_program_that_imports_it() -> None:
    code = (
        "import os, signal, sys\n"
        "from toonset.dataset.exporters.colmap import load_pycolmap\n"
        "signal.signal(signal.SIGTERM, lambda *_: sys.exit(7))\n"
        "load_pycolmap()\n"
        "os.kill(os.getpid(), signal.SIGTERM)\n"
    )
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (7, b"")
