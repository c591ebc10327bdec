"""A bundle is what its schema says: read back wherever it lies, old versions too, lies refused."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from toonset.dataset.bundle.bundle import failed_cameras
from toonset.dataset.bundle.check import bundle_problems
from toonset.dataset.bundle.read_scene import read_contour, read_coverage, read_scene, read_tones
from toonset.dataset.bundle.transforms_read import read_frames
from toonset.errors import BundleError, ToonsetError
from toonset.read import parse_json

Edit = Callable[[dict[str, Any]], Any]


@pytest.fixture
def place(small_bundle: Path, tmp_path: Path) -> Path:
    """Return an own copy of the small bundle, elsewhere than it was written."""
    return Path(shutil.copytree(small_bundle, tmp_path / "moved here" / "bündel"))


def edit(place: Path, name: str, change: Edit) -> None:
    content = json.loads((place / name).read_text())
    change(content)
    (place / name).write_text(json.dumps(content))


def problems(place: Path) -> list[str]:
    return [f"{problem.where}: {problem.what}" for problem in bundle_problems(place)]


def test_a_moved_bundle_has_no_problem_and_names_no_place(place: Path, small_bundle: Path):
    assert problems(place) == []
    scene = read_scene(place)
    assert len(scene.frames) == 3
    assert scene.palette is not None
    for frame in scene.frames:
        assert frame.labels is not None
        assert set(np.unique(frame.labels)) == {0, 1, 255}
    for file in place.rglob("*.*"):
        assert str(small_bundle.parent).encode() not in file.read_bytes(), file


def test_contours_are_read_as_coverage(place: Path):
    frame = read_frames(place / "transforms.json", need_pictures=True)[0]
    contour = read_contour(place, frame)
    assert contour is not None
    assert np.array_equal(contour, np.asarray(Image.open(place / "contours" / "000.png")))
    Image.new("RGB", (20, 24), "red").save(place / "contours" / "000.png")
    with pytest.raises(BundleError, match=r"contours/000.png: is coloured"):
        read_contour(place, frame)


def test_tones_are_checked_like_labels(place: Path):
    frame = read_frames(place / "transforms.json", need_pictures=True)[0]
    assert read_tones(place, frame) is None
    (place / "tones").mkdir()
    assert problems(place) == [
        "tones: is there but palette.json has no shadow; run `toonset palette` again"
    ]
    shadow = {"factor": [0.7, 0.7, 0.8], "spread": [0, 0, 0], "bits": 20.0}
    edit(place, "palette.json", lambda content: content.update(shadow=shadow))
    for name in ("000.png", "001.png"):
        Image.new("L", (20, 24), 1).save(place / "tones" / name)
    tones = read_tones(place, frame)
    assert tones is not None
    assert (tones == 1).all()
    Image.new("L", (20, 24), 7).save(place / "tones" / "001.png")
    assert problems(place) == [
        "tones/001.png: has the value 7, only 0 (light) to 3 (darkest) and 255 (none) are "
        "known; write the tones again with `toonset palette`",
        "tones/002.png: is missing; run `toonset palette` again",
    ]


def test_coverage_is_checked_like_labels(place: Path):
    frame = read_frames(place / "transforms.json", need_pictures=True)[0]
    assert read_coverage(place, frame, 2) is None
    (place / "coverage").mkdir()
    for name, paint in (("000.png", 1), ("001.png", 77), ("002.png", 1)):
        Image.new("RGB", (20, 24), (paint, 255, 200)).save(place / "coverage" / name)
    ranks = read_coverage(place, frame, 2)
    assert ranks is not None
    assert (ranks == (1, 255, 200)).all()
    (found,) = problems(place)
    assert found.startswith("coverage/001.png: paint 77 but the palette has")
    (place / "coverage" / "002.png").unlink()
    assert problems(place)[1:] == ["coverage/002.png: is missing; run `toonset palette` again"]


@pytest.mark.parametrize(
    ("name", "newest"), [("transforms", 1), ("calibration", 2), ("palette", 1)]
)
def test_another_major_version_is_refused_by_name(name, newest, place: Path):
    edit(place, f"{name}.json", lambda c: c.update(schema=f"toonset-{name}/{newest}.7", new=[1]))
    assert problems(place) == []  # a minor version only adds
    for other in (f"{name}/{newest + 1}", f"{name}/{newest - 1}", "mannequin/1"):
        edit(place, f"{name}.json", lambda c, other=other: c.update(schema=f"toonset-{other}"))
        (said,) = problems(place)
        assert said.startswith(f"{name}.json: ")
        assert f"toonset-{other}" in said


def covariance(row: int, column: int, value: float) -> Edit:
    return lambda c: c["views"][2]["covariance"][row].__setitem__(column, value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c["views"][2]["camera"].update(yaw_deg=12.0), "not those of its rotation"),
        (lambda c: c["views"][2]["twin"].update(model="orthographic"), "but k is 0.1"),
        (lambda c: c["views"][2]["twin"].update(scale_px_per_unit=1e-12), "at most 1e+09"),
        (lambda c: c["views"][2]["twin"].update(k=1e-300), "at most 1e+09"),
        (covariance(0, 1, 0.5), "covariance is not symmetric"),
        (covariance(3, 3, -0.5), "covariance has a negative variance"),
    ],
)
def test_a_calibration_that_no_calibration_writes_is_refused(change, words, place: Path):
    edit(place, "calibration.json", change)
    (said,) = problems(place)
    assert said.startswith("calibration.json: view 2 ('002.png'): ")
    assert words in said


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b'{"a": 1, "b": 2, "a": 3}', "the key 'a' is there twice"),
        (b'{"a": [1, {"b": NaN}]}', "a.1.b is nan, a finite number is needed"),
        (b'{"a": -Infinity}', "a is -inf"),
        (b'{"a": 1e400}', "a is inf"),
        (b"[" * 100_000, "is nested deeper than 64; write it flatter"),
        (b"[" * 70 + b"]" * 70, "is nested deeper than 64; write it flatter"),
        (b'{"a": 123456789012345678901234567890}', "a has more than 63 bits"),
        (b"[" + b"9" * 10_000 + b"]", "a number of 10000 digits"),
        (b'{"a": "\xff"}', "byte 7 is no UTF-8"),
        (b'{"a": ["x", "\\ud800"]}', "a.1 holds half a character"),
        (b'{"\\udc00 y": 1}', "? y holds half a character"),
        ('{"a": 1}'.encode("utf-16"), "is no UTF-8"),
        (b"", "Expecting value"),
    ],
)
def test_json_that_two_readers_could_read_differently(text, words):
    with pytest.raises(BundleError) as caught:
        parse_json(text, "x.json", BundleError)
    assert words in str(caught.value)
    assert str(caught.value).startswith("x.json: ")


def test_an_escaped_pair_is_one_character():
    assert parse_json(b'{"a": "\\ud83d\\ude00"}', "x.json", BundleError) == {"a": "\U0001f600"}


def test_plain_json_is_read_with_and_without_byte_order_mark():
    for mark in (b"", b"\xef\xbb\xbf"):
        assert parse_json(mark + b'{"a": [1, 2.5, "x", null]}', "x", BundleError) == {
            "a": [1, 2.5, "x", None]
        }


def spoil_everything(place: Path) -> None:
    edit(place, "transforms.json", lambda c: c["frames"][0].update(file_path="../000.png"))
    edit(place, "calibration.json", lambda c: c["views"][1].update(p_flip=3, verdict="fine"))
    Image.new("RGBA", (9, 9), "red").save(place / "images" / "001.png")
    (place / "labels" / "002.png").unlink()
    (place / "contours" / "notes.png").write_bytes(b"x")
    (place / "overlay.png").write_bytes((place / "overlay.png").read_bytes()[:-20])
    (place / "mannequin.obj").write_text("v 0 0 0\n")


def test_check_finds_all_problems_at_once(place: Path):
    spoil_everything(place)
    found = problems(place)
    for words in (
        "transforms.json: frame 0 ('../000.png'): lies outside",
        "images/001.png: is 9 x 9 px, transforms.json says 20 x 24",
        "labels/002.png: is missing; run `toonset palette` again",
        "contours/notes.png: belongs to no picture",
        "calibration.json: field views.1.p_flip: ",
        "calibration.json: field views.1.verdict: ",
        "overlay.png: the PNG file is damaged or cut off",
        "mannequin.obj: ",
    ):
        assert any(line.startswith(words) for line in found), (words, found)
    assert all(line.isprintable() for line in found)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: edit(p, "calibration.json", lambda c: c["views"].pop()), "has other views"),
        (lambda p: edit(p, "calibration.json", lambda c: c["views"].reverse()), "another order"),
        (
            lambda p: edit(p, "calibration.json", lambda c: c["views"][2]["camera"].update(k=0.2)),
            "its camera is not transforms.json's",
        ),
        (lambda p: shutil.copy(p / "images/000.png", p / "images/000.PNG"), "in case only"),
        (lambda p: (p / "palette.json").unlink(), "labels: is there but palette.json is not"),
        (
            lambda p: (p / "palette.gpl").write_text("GIMP Palette\n1 2 3 x\n"),
            "palette.gpl: has other colours than palette.json",
        ),
        (
            lambda p: edit(p, "transforms.json", lambda c: c["frames"].append(c["frames"][0])),
            "2 pictures share labels/000.png",
        ),
    ],
)
def test_check_compares_the_files_with_each_other(change, words, place: Path):
    change(place)
    assert any(words in line for line in problems(place)), problems(place)


@pytest.mark.parametrize("name", ["labels", "images", "palette.json", "contours/001.png"])
def test_links_out_of_the_bundle_are_refused(name, place: Path, tmp_path: Path):
    (place / name).rename(tmp_path / "elsewhere")
    (place / name).symlink_to(tmp_path / "elsewhere")
    assert any("out of the folder" in p or "outside of the folder" in p for p in problems(place))
    if not name.startswith("contours"):  # which no stage but editing reads
        with pytest.raises(ToonsetError, match="out"):
            read_scene(place)


@pytest.mark.parametrize("name", ["transforms.json", "calibration.json", "mannequin.obj"])
def test_no_verb_follows_a_link_out_of_the_bundle(name, place: Path, tmp_path: Path, toonset):
    (place / name).rename(tmp_path / name)
    (place / name).symlink_to(tmp_path / name)
    checked = toonset("check", place)
    assert "a link out of the folder" in checked.out + checked.err
    verb = ("view",) if name == "calibration.json" else ("export", "--to", "nerfstudio")
    reason = toonset(*verb, place, "--quiet", "-o", tmp_path / "new.html").reason
    assert f"{name}: is a link out of the folder" in reason


def test_a_link_inside_the_bundle_is_followed(place: Path):
    (place / "transforms.json").rename(place / "cameras.json")
    (place / "transforms.json").symlink_to("cameras.json")
    assert problems(place) == []


def test_failed_cameras_are_told(place: Path, tmp_path: Path) -> None:
    edit(place, "calibration.json", lambda c: [v.update(verdict="ok") for v in c["views"]])
    assert failed_cameras(place) == ""
    edit(place, "calibration.json", lambda c: c["views"][1].update(verdict="failed"))
    assert failed_cameras(place).startswith("no camera fits 1 of ")
    assert failed_cameras(tmp_path) == ""
