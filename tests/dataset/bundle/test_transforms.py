"""transforms.json: what is written is read back; what lies or cannot be honoured is refused."""

import json
import math

import numpy as np
import pytest

from toonset.camera import Camera
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.bundle.transforms_read import read_cameras
from toonset.dataset.images.picture import encode_png
from toonset.errors import BundleError
from toonset.write import write_bytes, write_json

SIZE = (60, 80)


def cameras():
    flat = Camera.looking_at(np.array([0.1, 0.9, 0.0]), 0.4, 0.1, 35.0, SIZE)
    deep = Camera.looking_at(np.array([0.1, 0.9, 0.0]), 2.0, -0.1, 35.0, SIZE, k=0.2)
    return [("images/000.png", flat), ("images/001.png", deep)]


@pytest.fixture
def folder(tmp_path):
    write_json(tmp_path / "transforms.json", transforms_dict(cameras(), 1.8, 1.0))
    picture = np.zeros((SIZE[1], SIZE[0], 4), np.uint8)
    picture[20:60, 20:40] = (200, 30, 20, 255)
    for name, _ in cameras():
        write_bytes(tmp_path / name, encode_png(picture))
    return tmp_path


def change(folder, edit):
    file = folder / "transforms.json"
    content = json.loads(file.read_text())
    edit(content)
    write_json(file, content)


def test_a_folder_above_the_cameras_names_those_below(folder, tmp_path_factory):
    above = tmp_path_factory.mktemp("drawn")
    with pytest.raises(BundleError, match="run `toonset calibrate` first"):
        read_cameras(above)
    (above / "views").mkdir()
    (folder / "transforms.json").rename(above / "views" / "transforms.json")
    with pytest.raises(BundleError, match=r"did you mean .*drawn\d*/views\?"):
        read_cameras(above)
    assert len(read_cameras(above / "views")) == 2


def test_cameras_come_back_exactly(folder):
    points = np.random.default_rng(0).uniform(-1, 2, (50, 3))
    scene = read_scene(folder)
    for frame, (_, camera) in zip(scene.frames, cameras(), strict=True):
        np.testing.assert_allclose(frame.camera.project(points)[0], camera.project(points)[0])
        assert frame.camera.is_orthographic == camera.is_orthographic


def test_by_nerfs_rules_alone_the_far_pinhole_is_within_its_bound(folder):
    points = np.array([0.1, 0.9, 0.0]) + np.random.default_rng(1).uniform(-0.5, 0.5, (50, 3))
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    change(folder, lambda content: [frame.pop("toonset") for frame in content["frames"]])
    for frame, (_, read), (_, camera) in zip(frames, read_cameras(folder), cameras(), strict=True):
        pose = np.array(frame["transform_matrix"])
        x, y, z = ((points - pose[:3, 3]) @ pose[:3, :3]).T
        assert (z < 0).all()  # OpenGL: the camera looks along -z, y is up
        u, v = frame["cx"] - frame["fl_x"] * x / z, frame["cy"] + frame["fl_y"] * y / z
        for pixels in (np.stack([u, v], axis=1), read.project(points)[0]):
            off = np.linalg.norm(pixels - camera.project(points)[0], axis=1)
            assert off.max() <= frame["toonset"]["pinhole_error_px"] + 1e-6


def test_a_place_without_cameras_is_told(folder):
    with pytest.raises(BundleError, match="does not exist; give a bundle folder or a transforms"):
        read_cameras(folder / "none")


def test_blender_style_files_are_read(folder):
    def blender(content):
        angle = 2 * math.atan(SIZE[0] / 2 / content["frames"][1]["fl_x"])
        frame = content["frames"][1]
        frame = {"file_path": "./images/001", "transform_matrix": frame["transform_matrix"]}
        content.clear()
        content.update(camera_angle_x=angle, frames=[frame])

    change(folder, blender)
    points = np.random.default_rng(2).uniform(-1, 1, (20, 3))
    read = read_scene(folder).frames[0].camera
    np.testing.assert_allclose(
        read.project(points)[0], cameras()[1][1].project(points)[0], atol=1e-6
    )


def bare(content):
    """Leave what other programs write."""
    for frame in content["frames"]:
        frame.pop("toonset")


def turned_by(change_matrix):
    """Return an edit of every frame's rotation."""

    def edit(content):
        for frame in content["frames"]:
            frame.pop("toonset", None)
            matrix = np.array(frame["transform_matrix"])
            matrix[:3, :3] = change_matrix(matrix[:3, :3])
            frame["transform_matrix"] = matrix.tolist()

    return edit


def off_px(folder):
    points = np.random.default_rng(2).uniform(-1, 1, (20, 3))
    pairs = zip(read_scene(folder).frames, cameras(), strict=True)
    return max(
        np.abs(frame.camera.project(points)[0] - camera.project(points)[0]).max()
        for frame, (_, camera) in pairs
    )


@pytest.mark.parametrize(
    ("change_matrix", "most_px"),
    [(lambda m: np.round(m, 4), 0.5), (lambda m: 1.0003 * m, 0.02), (lambda m: 0.9995 * m, 0.02)],
)
def test_a_rotation_that_is_nearly_one_is_the_nearest(folder, change_matrix, most_px):
    change(folder, bare)
    plain = off_px(folder)
    change(folder, turned_by(change_matrix))
    assert off_px(folder) <= plain + most_px


@pytest.mark.parametrize(
    "edit",
    [
        *(
            lambda c, model=model: c.update(camera_model=model, k1=0, k2=0.0, p1=0, p2=1e-18)
            for model in ("SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV", "opencv")
        ),
        lambda c: c.update(distortion_params=[0, 0, 0, 0]),
        lambda c: [f.update(file_path=f["file_path"].replace("/", "\\")) for f in c["frames"]],
        lambda c: [f.update(file_path=f".\\images\\00{i}") for i, f in enumerate(c["frames"])],
    ],
)
def test_what_means_the_same_is_read_the_same(folder, edit):
    plain = off_px(folder)
    change(folder, edit)
    assert off_px(folder) == plain
    assert [frame.name for frame in read_scene(folder).frames][:1] in (["000.png"], ["000"])


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (
            lambda c: c["frames"][0]["transform_matrix"][0].__setitem__(3, 9.0),
            "disagree; remove the `toonset` key",
        ),
        (lambda c: c["frames"][1].update(fl_x=7.0), "disagree"),
        (lambda c: c.update(camera_model="EQUIRECTANGULAR"), "'EQUIRECTANGULAR' is not supported"),
        (lambda c: c["frames"][0].update(k1=0.1), "lens distortion k1"),
        (lambda c: c.update(distortion_params=[0.1, 0]), "lens distortion distortion_params"),
        (lambda c: c.update(is_fisheye=True), "a fisheye lens is not supported"),
        (turned_by(lambda m: np.round(m, 1)), "not orthonormal .*; write rotations with 4"),
        (turned_by(lambda m: 1.05 * m), "not orthonormal .it scales by 1.05 to 1.05"),
        (turned_by(lambda m: m @ np.diag([1.001, 1, 1])), "not orthonormal"),
        (
            lambda c: c["frames"][0].update(file_path="..\\..\\etc\\passwd"),
            "lies outside of the folder",
        ),
        (
            lambda c: [c["frames"][0].pop(key) for key in ("toonset", "fl_x")],
            "has neither fl_x nor a camera_angle_x",
        ),
    ],
)
def test_what_cannot_be_honoured_is_refused(folder, edit, words):
    change(folder, edit)
    with pytest.raises(BundleError, match=words):
        read_scene(folder)
