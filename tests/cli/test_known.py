"""What a person knows, said on the command line of calibrate: no mesh, landmarks, starts, locks."""

import json
import shutil
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import toonset.calib.pipeline as library
from toonset.camera import Camera, rotation_distance, rotation_from_angles
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.bundle.transforms_read import read_cameras
from toonset.dataset.mannequin.landmark_formats import SCHEMA
from toonset.dataset.mesh.load import load_mesh

VIEWS = 5
LABELS = "0,72,144,216,288"
MARKS = 9
SURE_DEG = 3.0


@pytest.fixture(scope="module")
def truth(calibrated) -> list[Camera]:
    """Return cameras that are right within a degree or two."""
    return [camera for _, camera in read_cameras(calibrated[0])]


@pytest.fixture(scope="module")
def extremes(drawn: Path) -> np.ndarray:
    """Return points of the mannequin that lie far apart."""
    vertices = load_mesh(drawn / "mannequin.obj").vertices
    rng = np.random.default_rng(3)
    found = [int((vertices @ way).argmax()) for way in rng.normal(size=(60, 3))]
    return vertices[list(dict.fromkeys(found))[:MARKS]]


def marked(views: dict[str, Any], points: dict[str, Any] | None = None) -> str:
    content = {"schema": SCHEMA, "pixels": "view", "points": points or {}, "views": views}
    return json.dumps(content)


def clicks(truth, extremes, wrong_view: int | None = None) -> str:
    views: dict[str, Any] = {}
    for number, camera in enumerate(truth):
        pixels = camera.project(extremes)[0]
        if number == wrong_view:
            pixels[0] = np.array(camera.size_wh) - pixels[0]
        assert ((pixels >= 0) & (pixels <= camera.size_wh)).all()
        views[str(number)] = {f"p{i}": pixel.tolist() for i, pixel in enumerate(pixels)}
    return marked(views, {f"p{i}": point.tolist() for i, point in enumerate(extremes)})


def turned_deg(bundle: Path, truth) -> list[float]:
    found = [camera for _, camera in read_cameras(bundle)]
    return [
        float(np.degrees(rotation_distance(a.rotation, b.rotation)))
        for a, b in zip(found, truth, strict=True)
    ]


def test_no_mesh_takes_the_default_mannequin_and_says_so(drawn: Path, toonset, tmp_path):
    out = tmp_path / "b"
    done = toonset("calibrate", drawn / "single.png", "-o", out, "--json")
    assert done.code in (0, 3)
    assert "not sure, the default mannequin, 3 heads tall, relaxed pose" in done.err
    looks = {"head_scale": 1.0, "torso_scale": 1.0, "limb_scale": 1.0}
    assert done.json["options"]["mannequin"] == {"heads_tall": 3.0, "pose": "relaxed", **looks}
    assert [given["role"] for given in done.json["inputs"]] == ["sheet"]
    assert "left_hand" in load_mesh(out / "mannequin.obj").part_names


def test_labels_that_do_not_fit(drawn, toonset, tmp_path):
    line = ("calibrate", drawn / "sheet.png", drawn / "single.png", "-o", tmp_path / "b", "-q")
    assert "--views: 5 labels for 6 views" in toonset(*line, "--views", LABELS).reason
    assert not (tmp_path / "b").exists()


def test_labels_over_several_files_count_on(drawn: Path, toonset, tmp_path):
    sheets = [drawn / "sheet.png", drawn / "single.png"]
    mesh = ("--mesh", drawn / "mannequin.obj")
    labels = ("--views", f"{LABELS},front")
    done = toonset("calibrate", *sheets, *mesh, *labels, "-o", tmp_path / "b", "--json")
    assert done.code in (0, 3)
    assert done.json["options"]["views"] == f"{LABELS},front"
    yaws = [view["camera"]["yaw_deg"] for view in done.json["views"]]
    assert abs((yaws[5] - yaws[0] + 180) % 360 - 180) < SURE_DEG


@pytest.mark.parametrize("alone", [False, True])
def test_landmarks_make_cameras(alone, drawn, truth, extremes, toonset, tmp_path):
    file = tmp_path / "marks.json"
    file.write_text(clicks(truth, extremes, wrong_view=2))
    out = tmp_path / "b"
    given = ("--mesh", drawn / "mannequin.obj", "--landmarks", file)
    more = ["--landmarks-only"] if alone else []
    done = toonset("calibrate", drawn / "sheet.png", *given, *more, "-o", out, "--json")
    assert done.code == (3 if alone else 0)
    assert "002.png: landmarks that do not fit the others: p0; check them" in done.err
    assert [view["misplaced"] for view in done.json["landmarks"]] == [[], [], ["p0"], [], []]
    assert done.json["options"]["landmarks_only"] is alone
    hashed = {"name": "marks.json", "sha256": sha256(file.read_bytes()).hexdigest()}
    assert {**hashed, "role": "landmarks"} in done.json["inputs"]
    assert max(turned_deg(out, truth)) < (0.5 if alone else SURE_DEG)
    verdicts = [view["verdict"] for view in done.json["views"]]
    assert verdicts == ["ok", "ok", "weak" if alone else "ok", "ok", "ok"]


def test_landmarks_may_be_named_by_the_file_beside_the_mesh(
    drawn, truth, extremes, toonset, tmp_path
):
    shutil.copy(drawn / "mannequin.obj", tmp_path / "m.obj")
    content = json.loads(clicks(truth, extremes))
    beside = {"schema": SCHEMA, "units": "world", "points": content.pop("points")}
    (tmp_path / "m.landmarks.json").write_text(json.dumps(beside))
    (tmp_path / "marks.json").write_text(json.dumps(content))
    given = ("--mesh", tmp_path / "m.obj", "--landmarks", tmp_path / "marks.json")
    done = toonset(
        *("calibrate", drawn / "sheet.png", *given, "--landmarks-only"),
        *("-o", tmp_path / "b", "--json"),
    )
    assert (done.code, done.json["verdict"]) == (0, "ok")
    roles = [given["role"] for given in done.json["inputs"]]
    assert roles == ["sheet", "mesh", "landmarks", "points of the mesh"]


def test_landmarks_that_are_not_enough(drawn: Path, toonset, snapshot, tmp_path):
    pixels = {"nose": [20, 20], "left_eye": [25, 18], "left_toe": [24, 60]}
    file = tmp_path / "marks.json"
    file.write_text(marked({"1": pixels}))
    arguments = ("calibrate", drawn / "sheet.png", "--landmarks", file, "-o", tmp_path / "b", "-q")
    words = "--landmarks-only: no landmarks for 000.png, 002.png, 003.png, 004.png; give"
    assert words in toonset(*arguments, "--landmarks-only").reason
    pixels["left_ear"] = [2, 2]
    file.write_text(marked({"1": pixels}))
    assert "unknown name 'left_ear'" in toonset(*arguments).reason
    assert set(snapshot(tmp_path)) == {"marks.json"}


def started(drawn: Path, toonset, out: Path, *more: object):
    mesh = ("--mesh", drawn / "mannequin.obj")
    return toonset("calibrate", drawn / "sheet.png", *mesh, "-o", out, *more, "--json")


def moved_start(bundle: Path, path: Path) -> list[Camera]:
    """Write the bundle's cameras turned by some degrees, scaled and shifted; return them."""
    cameras = []
    for number, (name, camera) in enumerate(read_cameras(bundle)):
        yaw, elevation, roll = camera.angles
        turn = rotation_from_angles(yaw + 0.05 * (-1) ** number, elevation + 0.03, roll)
        scale, center = 1.03 * camera.scale, camera.center + 2.0
        moved = Camera(turn, camera.target, scale, center, camera.size_wh, 0.1)
        cameras.append((name, moved))
    content = transforms_dict(reversed(cameras), 1.0, 1.0)  # views are told by their names
    path.write_text(json.dumps(content))
    return [camera for _, camera in cameras]


def test_a_start_is_found_back_without_a_search(
    drawn, bundle, truth, toonset, tmp_path, monkeypatch
):
    def refuse(*arguments: object) -> None:
        raise AssertionError("the search has been asked")

    monkeypatch.setattr(library, "find_hypotheses", refuse)
    monkeypatch.setattr(library, "likely_turns", refuse)
    moved_start(bundle, tmp_path / "start.json")
    done = started(drawn, toonset, tmp_path / "b", "--init", tmp_path / "start.json")
    assert done.code in (0, 3)
    assert [given["role"] for given in done.json["inputs"]] == ["sheet", "mesh", "init"]
    assert max(turned_deg(tmp_path / "b", truth)) < 1.0


@pytest.mark.parametrize("locked", [["yaw", "fov"], ["elevation", "scale"]])
def test_locks_keep_what_init_has(locked, drawn, bundle: Path, toonset, tmp_path):
    given = moved_start(bundle, tmp_path / "start.json")
    locks = [word for name in locked for word in ("--lock", name)]
    out = tmp_path / "b"
    done = started(drawn, toonset, out, "--init", tmp_path / "start.json", *locks)
    assert done.code in (0, 3)
    assert done.json["options"]["locked"] == locked
    for start, (_, end) in zip(given, read_cameras(out), strict=True):
        turned = np.degrees(np.array(end.angles) - np.array(start.angles))
        turned = (turned + 180) % 360 - 180
        if "yaw" in locked:
            assert abs(turned[0]) < 0.01
        if "elevation" in locked:
            assert abs(turned[1]) < 0.01
        if "scale" in locked:
            assert end.scale == pytest.approx(start.scale, rel=1e-4)
        if "fov" in locked:
            assert end.k == pytest.approx(start.k, rel=1e-4)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--lock", "scale"], "--lock scale: no value to keep; give --init"),
        (["--lock", "yaw", "--views", "front,?,?,?,?"], "or one yaw per view in --views"),
        (["--init", "nowhere"], "nowhere: does not exist; give a bundle folder or a transforms"),
        (["--init", "few.json"], "--init: 4 cameras for 5 views"),
        (["--init", "large.json"], "--init: the camera of 001.png is for 90 x"),
        (["--init", "oblong.json"], "has pixels 1.5 times as high as wide"),
    ],
)
def test_starts_and_locks_that_cannot_be(
    more, words, drawn, bundle, toonset, snapshot, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    content = json.loads((bundle / "transforms.json").read_text())
    few = content | {"frames": content["frames"][1:]}
    for frame in content["frames"]:
        frame.pop("toonset")
    oblong = json.loads(json.dumps(content))
    oblong["frames"][0]["fl_y"] *= 1.5
    content["frames"][1]["w"] = 90
    for name, value in {"few": few, "oblong": oblong, "large": content}.items():
        Path(f"{name}.json").write_text(json.dumps(value))
    before = snapshot(tmp_path)
    mesh = ("--mesh", drawn / "mannequin.obj")
    done = toonset("calibrate", drawn / "sheet.png", *mesh, "-o", "new", *more, "-q")
    assert words in done.reason
    assert snapshot(tmp_path) == before


def corrections(folder: Path, **content: Any) -> Path:
    path = folder / "corrections.json"
    path.write_text(json.dumps({"version": 1, **content}))
    return path


def test_corrections_are_an_input_and_change_only_what_they_say(drawn, bundle, toonset, tmp_path):
    boxes = [view["box"] for view in json.loads((bundle / "calibration.json").read_text())["views"]]
    views = [{"box": boxes[2], "label": "144"}, {"box": boxes[4], "exclude": True}]
    path = corrections(tmp_path, views=views)
    done = started(drawn, toonset, tmp_path / "b", "--corrections", path)
    assert done.code in (0, 3)
    assert [given["role"] for given in done.json["inputs"]] == ["sheet", "corrections", "mesh"]
    assert done.json["options"]["views"] == "?,?,144,?"
    assert len(done.json["views"]) == VIEWS - 1


@pytest.mark.parametrize(
    ("content", "more", "words"),
    [
        ({"view": []}, [], "corrections.json: unknown key 'view'"),
        ({"boxes": [[0, 0, 99, 99]]}, ["--boxes", "b.csv"], "boxes and --boxes say the same"),
        ({"views": [{"box": [0, 0, 9, 9], "label": "0"}]}, ["--front", "1"], "label and --front"),
    ],
)
def test_corrections_that_cannot_be(
    content, more, words, drawn, toonset, snapshot, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("b.csv").write_text("0,0,99,99\n")
    path = corrections(tmp_path, **content)
    before = snapshot(tmp_path)
    mesh = ("--mesh", drawn / "mannequin.obj")
    sheet = drawn / "sheet.png"
    done = toonset("calibrate", sheet, *mesh, "--corrections", path, *more, "-o", "new", "-q")
    assert words in done.reason
    assert snapshot(tmp_path) == before
