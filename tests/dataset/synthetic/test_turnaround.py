"""Synthetic turnarounds: the truth they carry is true."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from tests.figures import boxes
from toonset.camera import Camera
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.transforms_read import read_cameras
from toonset.dataset.images.picture import load_indexed_png, load_rgba
from toonset.dataset.mesh.load import load_mesh, save_obj
from toonset.dataset.synthetic import gl_render
from toonset.dataset.synthetic.files import write_turnaround
from toonset.dataset.synthetic.gl_render import render_labels
from toonset.dataset.synthetic.hand_error import displace, displacement_field
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.errors import CameraError, MeshError, SetupError, SheetError
from toonset.mesh import Mesh
from toonset.palette.pixels.labels import UNLABELLED

RED, BLUE, GREEN = (220, 40, 30), (30, 60, 200), (20, 160, 60)
SMALL = SynthOptions(views=4, cell_px=96, outline_px=2.0)


def figure() -> Mesh:
    body = ((1.0, 2.0, 0.6), (0.0, 1.0, 0.0))
    bag, ear = ((0.6, 0.3, 0.3), (0.8, 1.4, 0.1)), ((0.7, 0.4, 0.1), (0.0, 2.2, 0.0))
    made = boxes(body, bag, ear, colors=(RED, BLUE, GREEN))
    return replace(made, face_parts=np.repeat(range(3), 12), part_names=("body", "bag", "ear"))


@pytest.mark.parametrize("k", [0.0, 0.25])
def test_pixels_lie_where_the_camera_projects(k: float) -> None:
    import trimesh

    ball = trimesh.creation.icosphere(2)
    target, places = np.array([0.1, 0.2, 0.3]), np.array([[0.9, 0.5, -0.4], [-0.6, -0.8, 0.7]])
    for roll, center in ((0.0, (100.0, 80.0)), (0.4, (140.5, 61.2))):
        camera = Camera.looking_at(
            target, 0.7, 0.3, 45.0, (220, 160), roll, center=np.array(center), k=k
        )
        for place in places:
            dot = Mesh(0.08 * ball.vertices + place, np.array(ball.faces))
            seen = render_labels(dot, np.zeros(len(dot.faces), dtype=int), camera)
            rows, columns = np.nonzero(seen.labels == 0)
            pixel, depth, _ = camera.project(place)
            np.testing.assert_allclose([columns.mean(), rows.mean()], pixel - 0.5, atol=0.4)
            assert depth - 0.081 < seen.depth[rows, columns].min() < depth - 0.06


@pytest.mark.parametrize("k", [0.0, 0.25])
def test_depth_unprojects_onto_the_surface(k: float) -> None:
    camera = Camera.looking_at(np.zeros(3), 0.5, 0.2, 20.0, (80, 80), k=k)
    cube = boxes(((2.0, 2.0, 2.0), (0.0, 0.0, 0.0)))
    seen = render_labels(cube, np.zeros(12, dtype=int), camera)
    inside = seen.labels == 0
    points = camera.unproject(camera.pixel_grid()[inside], seen.depth[inside])
    np.testing.assert_allclose(np.abs(points).max(axis=1), 1.0, atol=1e-3)
    assert np.isinf(seen.depth[~inside]).all()


@pytest.mark.parametrize("yaw", [0.0, math.pi])
def test_both_sides_of_a_face_are_drawn(yaw: float) -> None:
    vertices = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], dtype=float)
    camera = Camera.looking_at(np.zeros(3), yaw, 0.0, 20.0, (64, 64))
    seen = render_labels(Mesh(vertices, np.array([[0, 1, 2]])), np.zeros(1, dtype=int), camera)
    assert (seen.labels == 0).sum() == pytest.approx(2 * 20 * 20, rel=0.05)


def test_camera_that_stands_in_the_mesh_is_refused() -> None:
    camera = Camera.looking_at(np.zeros(3), 0.0, 0.0, 20.0, (64, 64), k=5.0)
    with pytest.raises(CameraError, match="behind the camera"):
        render_labels(figure(), np.zeros(36, dtype=int), camera)


@pytest.mark.parametrize("distance", [0.0, 3.0])
def test_labels_are_the_palette_colours_and_lines_are_black(distance: float) -> None:
    made = make_turnaround(figure(), replace(SMALL, distance_heights=distance, warp_percent=1), 3)
    assert sorted(map(tuple, made.palette.tolist())) == sorted([RED, BLUE, GREEN])
    for view, labels, ink in zip(made.views, made.labels, made.ink, strict=True):
        pure = labels != UNLABELLED
        assert pure.sum() > 0.5 * view.mask.sum()
        np.testing.assert_array_equal(view.rgba[pure][:, :3], made.palette[labels[pure]])
        assert (view.rgba[pure][:, 3] == 255).all()
        assert (view.rgba[ink == 255][:, :3] == 0).all()
        assert (ink[view.rgba[..., 3] == 0] == 0).all()


def test_figures_stay_in_their_cells_and_boxes_hold_them() -> None:
    options = replace(SMALL, views=5, columns=3, scale_error_percent=8, warp_percent=2)
    made = make_turnaround(figure(), options, 1)
    assert made.sheet.shape == (2 * 96, 3 * 96, 4)
    drawn = (made.sheet[..., :3] != 255).any(axis=-1)
    for view, (x, y, w, h) in zip(made.views, made.figure_boxes, strict=True):
        left, top, side, _ = view.box
        assert (left < x, top < y, x + w < left + side, y + h < top + side) == (True,) * 4
        drawn[y : y + h, x : x + w] = False
    assert not drawn.any()


def test_sheet_background() -> None:
    made = make_turnaround(figure(), replace(SMALL, background="#102030"), 0)
    np.testing.assert_array_equal(made.sheet[0, 0], [16, 32, 48, 255])
    clear = make_turnaround(figure(), replace(SMALL, background="transparent"), 0)
    np.testing.assert_array_equal(clear.sheet[:, :96], clear.views[0].rgba)


def test_seed_alone_decides() -> None:
    options = replace(SMALL, yaw_jitter_deg=5, warp_percent=1, scale_error_percent=3)
    first, again, other = (make_turnaround(figure(), options, seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first.sheet, again.sheet)
    assert first.yaws == again.yaws
    assert (first.sheet != other.sheet).any()
    turns = np.degrees(np.array(first.yaws) - np.arange(4) * math.pi / 2 + math.pi) % 360 - 180
    assert 0 < np.abs(turns).max() <= 5


def test_outline_of_the_drawing_follows_the_exact_camera() -> None:
    options = replace(SMALL, outline_px=0, yaw_jitter_deg=20, scale_error_percent=6)
    made = make_turnaround(figure(), replace(options, elevation_deg=15, distance_heights=4), 2)
    for view, camera, yaw in zip(made.views, made.cameras, made.yaws, strict=True):
        pixels, _, _ = camera.project(made.mesh.vertices)
        rows, columns = np.nonzero(view.mask)
        low = np.array([columns.min(), rows.min()])
        high = np.array([columns.max() + 1, rows.max() + 1])
        np.testing.assert_allclose(low, pixels.min(axis=0), atol=1.0)
        np.testing.assert_allclose(high, pixels.max(axis=0), atol=1.0)
        assert camera.angles[0] % (2 * math.pi) == pytest.approx(yaw, abs=1e-9)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_bend_is_as_large_as_asked_and_smooth(seed: int) -> None:
    inside = np.zeros((120, 100), dtype=bool)
    inside[20:110, 30:60] = True
    field = displacement_field(np.random.default_rng(seed), inside, 2.5)
    assert np.sqrt((field[inside] ** 2).sum(axis=1).mean()) == pytest.approx(2.5)
    np.testing.assert_allclose(field[inside].mean(axis=0), 0, atol=1e-9)
    assert np.abs(np.diff(field, axis=0)).max() < 0.5  # of a pixel per pixel: no fold


def test_bend_moves_content_by_its_field() -> None:
    inside = np.ones((90, 110), dtype=bool)
    field = displacement_field(np.random.default_rng(3), inside, 3.0)
    rows, columns = np.indices(inside.shape, dtype=np.float32)
    middle = (slice(20, -20), slice(20, -20))
    for axis, place in enumerate((columns, rows)):
        moved = displace(place, field, 0.0, smooth=True) - place
        np.testing.assert_allclose(moved[middle], field[middle][..., axis], atol=0.05)


def test_drawing_is_bent_but_its_camera_is_not() -> None:
    straight, bent = (
        make_turnaround(figure(), replace(SMALL, warp_percent=w), 0) for w in (0.0, 2.0)
    )
    for before, after in zip(straight.cameras, bent.cameras, strict=True):
        np.testing.assert_array_equal(before.rotation, after.rotation)
    for view, camera in zip(bent.views, bent.cameras, strict=True):
        pixels, _, _ = camera.project(bent.mesh.vertices)
        rows, columns = np.nonzero(view.mask)
        off = np.array([columns.min(), rows.min()]) - (pixels.min(axis=0) - SMALL.outline_px / 2)
        assert 0.5 < np.abs(off).max() < 4 * 0.02 * SMALL.cell_px


def test_following_part_keeps_facing_the_viewer() -> None:
    widths = {}
    for names in ((), ("ear",)):
        made = make_turnaround(
            figure(), replace(SMALL, views=8, cell_px=160, outline_px=0, following_parts=names), 0
        )
        ear = int(np.flatnonzero((made.palette == GREEN).all(axis=1))[0])
        widths[names] = [np.ptp(np.nonzero(labels == ear)[1]) for labels in made.labels]
    assert np.ptp(widths[("ear",)]) <= 1
    assert np.ptp(widths[()]) > 5


def test_unknown_part_names_those_there_are() -> None:
    with pytest.raises(MeshError, match="no part 'tail'; its parts are body, bag, ear"):
        make_turnaround(figure(), replace(SMALL, following_parts=("tail",)), 0)


def test_options_out_of_range_are_refused() -> None:
    with pytest.raises(SheetError, match="views: 0 is out of range; give 1 to 360"):
        SynthOptions(views=0)
    with pytest.raises(SheetError, match="warp_percent: nan"):
        SynthOptions(warp_percent=math.nan)
    with pytest.raises(SheetError, match="background 'blueish'"):
        SynthOptions(background="blueish")


def test_mesh_without_colours_is_grey_and_a_gradient_is_reduced() -> None:
    grey = make_turnaround(replace(figure(), face_colors=None), SMALL, 0)
    np.testing.assert_array_equal(grey.palette, [[204, 204, 204]])
    many = np.stack([np.arange(360) % 256, np.arange(360) // 2, np.full(360, 9)], axis=1)
    body = figure()
    repeated = replace(
        body, faces=np.tile(body.faces, (10, 1)), face_parts=None, face_colors=many.astype(np.uint8)
    )
    assert 32 <= len(make_turnaround(repeated, SMALL, 0).palette) <= 64


def test_files_hold_the_truth(tmp_path: Path) -> None:
    made = make_turnaround(figure(), replace(SMALL, elevation_deg=10), 6)
    write_turnaround(made, tmp_path / "made")
    np.testing.assert_array_equal(load_rgba(tmp_path / "made" / "sheet.png"), made.sheet)
    assert len(load_mesh(tmp_path / "made" / "mannequin.obj").faces) == 36
    named = read_cameras(tmp_path / "made" / "views")
    truth = json.loads((tmp_path / "made" / "truth.json").read_text())
    assert truth["seed"] == 6
    for i, (name, camera) in enumerate(named):
        assert name == truth["views"][i]["name"] == made.views[i].name
        np.testing.assert_allclose(camera.rotation, made.cameras[i].rotation)
        np.testing.assert_allclose(truth["views"][i]["camera"]["center"], camera.center)
        labels = load_indexed_png(tmp_path / "made" / "labels" / name)
        np.testing.assert_array_equal(labels, made.labels[i])


def test_command_writes_and_refuses(tmp_path: Path, toonset) -> None:
    (tmp_path / "m.obj").write_bytes(save_obj(figure()))
    size = ("--views", 3, "--cell", 64, "--following", "ear", "-q")
    command = ("synth", tmp_path / "m.obj", "-o", tmp_path / "out", *size)
    assert toonset(*command).code == 0
    assert load_rgba(tmp_path / "out" / "sheet.png").shape == (64, 192, 4)
    assert "exists already" in toonset(*command).reason
    assert toonset(*command, "--force").code == 0


MISSING = [
    ValueError("Invalid device ID (0)"),  # no Mesa vendor
    type("EGLError", (Exception,), {})("eglInitialize failed\nlong story"),  # no driver
]
INSTALL = "apt-get install -y libegl1 libgl1 libgl1-mesa-dri"


def test_missing_library_at_import_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.import_module", Mock(side_effect=ImportError("no EGL")))
    with pytest.raises(SetupError, match=INSTALL):
        gl_render._pyrender.__wrapped__()


@pytest.mark.parametrize("error", MISSING)
def test_missing_driver_is_named(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    program = SimpleNamespace(OffscreenRenderer=Mock(side_effect=error))
    monkeypatch.setattr(gl_render, "_pyrender", lambda: program)
    with pytest.raises(SetupError, match=INSTALL):
        gl_render._renderer.__wrapped__()


EXAMPLES = Path(__file__).parents[3] / "examples"


def test_example_sheet_mannequin_and_cameras_belong_together() -> None:
    sheet = load_rgba(EXAMPLES / "sheet.png")
    mannequin = load_mesh(EXAMPLES / "mannequin.obj")
    views = json.loads((EXAMPLES / "truth.json").read_text())["views"]
    bodies = []
    for view in views:
        camera = NativeCamera(**view["camera"]).camera()
        seen = render_labels(mannequin, np.zeros(len(mannequin.faces), dtype=int), camera)
        bodies.append(seen.labels == 0)
    for i, view in enumerate(views):
        x, y, w, h = view["cell_box"]
        drawn = (sheet[y : y + h, x : x + w, :3] < 250).any(axis=-1)
        covered = [float((drawn & body).sum() / body.sum()) for body in bodies]
        assert covered[i] > 0.98  # the plain body lies within the drawing of it with its bag
        assert covered[i] > covered[(i + 1) % len(views)]


@pytest.mark.slow
def test_example_is_what_its_script_makes(tmp_path: Path) -> None:
    script = EXAMPLES / "making" / "make_character.py"
    subprocess.run([sys.executable, str(script), str(tmp_path)], check=True)
    for name in ("mannequin.obj", "truth.json"):
        assert (tmp_path / name).read_bytes() == (EXAMPLES / name).read_bytes()
    made, kept = (load_rgba(folder / "sheet.png") for folder in (tmp_path, EXAMPLES))
    assert (np.abs(made.astype(int) - kept) > 32).mean() < 1e-3  # drivers may round differently
