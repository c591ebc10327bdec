"""COLMAP export: what another program reads is what the bundle says."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from bench.cases.bodies import random_body
from tests.dataset.exporters.exported_views import camera_at
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.exporters.colmap import write_colmap
from toonset.dataset.exporters.common import ExportView, read_views
from toonset.dataset.exporters.points import sample_surface, track_points
from toonset.dataset.images.picture import encode_png, load_rgba
from toonset.dataset.importers.colmap import read_colmap
from toonset.dataset.mesh.load import load_mesh, save_obj
from toonset.errors import BundleError
from toonset.mesh import Mesh
from toonset.write import write_json

RADIUS = 1.1


def painted(size_wh: tuple[int, int], seed: int = 0) -> np.ndarray:
    """Return noise on a transparent ground; its figure is an ellipse."""
    width, height = size_wh
    rng = np.random.default_rng(seed)
    rgba = rng.integers(0, 256, (height, width, 4)).astype(np.uint8)
    v, u = np.mgrid[:height, :width]
    inside = ((u - width / 2) / width) ** 2 + ((v - height / 2) / height) ** 2 < 0.16
    rgba[..., 3] = np.where(inside, 255, 0)
    return rgba


def posed(count: int, *, k: float = 0.0) -> list[Frame]:
    """Return frames all round, each with another elevation, roll, size and principal point."""
    frames = []
    for i in range(count):
        size = (90 + 3 * i, 120 - 2 * i)
        camera = camera_at(i, count, size, 47.0 + i, (44.3 + i, 61.7), k)
        frames.append(Frame(f"{i:03d}.png", camera, painted(size, i)))
    return frames


def bundle_of(frames: list[Frame], folder: Path) -> Path:
    named = [(f"images/{frame.name}", frame.camera) for frame in frames]
    (folder / "images").mkdir(parents=True)
    for frame in frames:
        (folder / "images" / frame.name).write_bytes(encode_png(frame.rgba))
    write_json(folder / "transforms.json", transforms_dict(named, 1.8, RADIUS))
    return folder


def around(target: np.ndarray, seed: int = 5) -> np.ndarray:
    """Return 1,000 points within RADIUS of the target."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(1000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return target + direction * RADIUS * rng.random((1000, 1)) ** (1 / 3)


@pytest.mark.parametrize("text", [False, True], ids=["bin", "txt"])
@pytest.mark.parametrize("k", [0.0, 0.2], ids=["orthographic", "pinhole"])
@pytest.mark.parametrize("old", [False, True], ids=["new", "old"])
def test_cameras_return_with_the_same_pixels(
    tmp_path: Path, text: bool, k: float, old: bool
) -> None:
    frames = posed(5, k=k)
    views = read_views(bundle_of(frames, tmp_path / "bundle"))
    write_colmap(tmp_path / "out", views, text=text, old_layout=old)
    found = read_colmap(tmp_path / "out")
    assert [name for name, _ in found] == [frame.name for frame in frames]
    for (_, camera), view, frame in zip(found, views, frames, strict=True):
        points = around(frame.camera.target)
        pixels = camera.project(points)[0]
        assert np.abs(pixels - view.pinhole.project(points)[0]).max() < 0.01
        off = np.linalg.norm(pixels - frame.camera.project(points)[0], axis=1).max()
        assert off <= view.error_px + 0.01
        assert (view.error_px > 0) == frame.camera.is_orthographic
        assert camera.size_wh == frame.camera.size_wh
    rigs = list((tmp_path / "out" / "sparse" / "0").glob("rigs.*"))
    assert len(rigs) == (not old)


def test_exact_cameras_stand_beside_the_model(tmp_path: Path) -> None:
    frames = posed(3)
    views = read_views(bundle_of(frames, tmp_path / "bundle"))
    write_colmap(tmp_path / "out", views)
    beside = json.loads((tmp_path / "out" / "toonset.json").read_text())
    assert beside["pinhole_error_px"] == max(view.error_px for view in views) > 0
    for record, frame in zip(beside["views"], frames, strict=True):
        assert record["name"] == frame.name
        assert record["camera"]["model"] == "orthographic"
        np.testing.assert_array_equal(record["camera"]["rotation"], frame.camera.rotation)


@pytest.mark.parametrize("text", [False, True], ids=["bin", "txt"])
def test_pycolmap_projects_points_to_their_keypoints(tmp_path: Path, text: bool) -> None:
    mesh = random_body(3)
    frames = [
        replace(f, rgba=np.full_like(f.rgba, 255)) for f in posed(4)
    ]  # all figure: no point is dropped
    views = [ExportView(f.name, f.rgba, f.camera, 180.0, RADIUS) for f in frames]
    cameras = [view.pinhole for view in views]
    points = track_points(sample_surface(mesh, 300, 0), mesh, frames, cameras)
    write_colmap(tmp_path / "out", views, points, text=text)
    model = pycolmap.Reconstruction(tmp_path / "out" / "sparse" / "0")
    assert (model.num_reg_images(), model.num_points3D()) == (4, len(points.xyz))
    for i, (_, point) in enumerate(sorted(model.points3D.items())):
        np.testing.assert_allclose(point.xyz, points.xyz[i], atol=1e-9)
        np.testing.assert_array_equal(point.color, points.rgb[i])
        assert len(point.track.elements) == points.seen[:, i].sum() > 0
        for element in point.track.elements:
            image = model.images[element.image_id]
            seen = image.points2D[element.point2D_idx]
            projected = model.cameras[image.camera_id].img_from_cam(
                image.cam_from_world() * point.xyz
            )
            assert projected is not None
            np.testing.assert_allclose(seen.xy, projected, atol=1e-4)


def test_pictures_are_over_white_and_masks_tell_the_figure(tmp_path: Path) -> None:
    frames = posed(2)
    views = read_views(bundle_of(frames, tmp_path / "bundle"))
    write_colmap(tmp_path / "out", views)
    for frame in frames:
        figure = frame.rgba[..., 3] == 255
        picture = load_rgba(tmp_path / "out" / "images" / frame.name)
        mask = load_rgba(tmp_path / "out" / "masks" / f"{frame.name}.png")
        assert (picture[~figure] == 255).all()
        np.testing.assert_array_equal(picture[figure, :3], frame.rgba[figure, :3])
        np.testing.assert_array_equal(mask[..., 0] == 255, figure)


# ---- points


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


# ---- what cannot be read


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    frames = posed(2)
    views = read_views(bundle_of(frames, tmp_path / "bundle"))
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
    mesh, frames = random_body(3), [replace(f, rgba=np.full_like(f.rgba, 255)) for f in posed(2)]
    views = [ExportView(f.name, f.rgba, f.camera, 180.0, RADIUS) for f in frames]
    cameras = [view.pinhole for view in views]
    points = track_points(sample_surface(mesh, 20, 0), mesh, frames, cameras)
    write_colmap(tmp_path / "out", views, points, text=text, old_layout=old)
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


def test_lens_distortion_is_refused_by_name(dataset: Path) -> None:
    sparse = dataset / "sparse" / "0"
    model = pycolmap.Reconstruction(sparse)
    lens = model.cameras[1]
    lens.model = pycolmap.CameraModelId.SIMPLE_RADIAL
    lens.params = [100.0, 50.0, 60.0, 0.1]
    model.write(sparse)
    with pytest.raises(BundleError, match="SIMPLE_RADIAL camera, PINHOLE or SIMPLE_PINHOLE"):
        read_colmap(dataset)


def test_two_pictures_of_one_name_are_refused(tmp_path: Path) -> None:
    frames = posed(2)
    frames[1] = replace(frames[1], name="000.jpg")
    bundle = bundle_of(frames, tmp_path / "bundle")
    with pytest.raises(BundleError, match=r"two pictures would be written as 000\.png"):
        read_views(bundle)


# ---- the verb


def test_export_writes_what_pycolmap_reads(toonset, tmp_path: Path) -> None:
    mesh = random_body(4)
    frames = posed(3)
    bundle = bundle_of(frames, tmp_path / "bundle")
    (tmp_path / "m.obj").write_bytes(save_obj(mesh))
    out = tmp_path / "out"
    bare = toonset("export", bundle, "--to", "colmap", "-o", out, "--json")
    assert bare.code == 0, bare
    assert bare.json["points"] > 1000
    assert "visual hull" in json.loads((out / "toonset.json").read_text())["points_are"]
    assert f"at most {bare.json['pinhole_error_px']:.2f} px off" in bare.err
    again = toonset(
        "export", bundle, "--to", "colmap", "-o", out, "--mesh", tmp_path / "m.obj", "--text"
    )
    assert "exists already" in again.reason
    full = toonset(
        *("export", bundle, "--to", "colmap", "-o", out, "--mesh", tmp_path / "m.obj", "--text"),
        "--force",
        "--json",
    )
    model = pycolmap.Reconstruction(out / "sparse" / "0")
    assert model.num_points3D() == full.json["points"] > 100
    assert (out / "sparse" / "0" / "points3D.txt").is_file()
    on_mesh = np.array([point.xyz for point in model.points3D.values()])
    low, high = load_mesh(tmp_path / "m.obj").bounds
    assert ((on_mesh > low - 1e-6) & (on_mesh < high + 1e-6)).all()


def test_export_refuses_a_mannequin_that_is_not_there(toonset, tmp_path: Path) -> None:
    bundle = bundle_of(posed(2), tmp_path / "bundle")
    far_off = random_body(4)
    moved = replace(far_off, vertices=far_off.vertices + np.array([50.0, 0, 0]))
    (tmp_path / "m.obj").write_bytes(save_obj(moved))
    out = tmp_path / "out"
    outcome = toonset(
        "export", bundle, "--to", "colmap", "-o", out, "--mesh", tmp_path / "m.obj", "-q"
    )
    assert "give the mannequin of the calibration" in outcome.reason
    assert not out.exists()
    shutil.rmtree(bundle)
    assert "does not exist" in toonset("export", bundle, "--to", "colmap", "-o", out).reason
