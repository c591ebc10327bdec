"""`toonset info` and `toonset check`: what a person is told, and with which exit code."""

import json
import shutil
from pathlib import Path

import pytest


@pytest.fixture
def place(small_bundle: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(small_bundle, tmp_path / "bundle"))


def test_info_tells_views_colours_and_sizes(place: Path, toonset, snapshot):
    before = snapshot(place)
    done = toonset("info", place)
    assert (done.code, done.err) == (0, "")
    lines = done.out.splitlines()
    assert lines[0] == f"{place}: a bundle of 3 views, ok"
    assert lines[2].split() == ["view", "size", "line", "yaw", "elevation", "p_flip", "verdict"]
    row = "000.png  20 x 24  1.5 px    0.0 +- 0.5    5.7 +- 0.5  0.01    ok"
    assert lines[3].split() == row.split()
    for words in (
        "orthographic, 4.0 to 4.0 heights; tried: perspective (BIC -3, taken from +6)",
        "3 of 3, 3 labels, 3 contours",
        "2: #c81e14 red 50.0 %, #143cc8 blue 50.0 %",
        "4 vertices, 4 faces",
        "sheet.png (sheet, 00000000)",
        "toonset 0.1.0, seed 0",
    ):
        assert words in done.out
    found = toonset("info", place, "--json").json
    assert found["kind"] == "bundle"
    assert [view["line_width_px"] for view in found["views"]] == [1.5] * 3
    assert (found["labels"], found["contours"], found["damaged"]) == (3, 3, [])
    on_disk = sum(path.stat().st_size for path in place.rglob("*") if path.is_file())
    assert sum(found["bytes"].values()) == on_disk
    assert snapshot(place) == before


def test_info_of_another_programs_cameras(place: Path, toonset):
    content = json.loads((place / "transforms.json").read_text())
    for frame in content["frames"]:
        del frame["toonset"]
    folder = place.parent / "blender"
    folder.mkdir()
    (folder / "transforms_train.json").write_text(json.dumps(content))
    done = toonset("info", folder)
    assert done.code == 0
    assert done.out.startswith(f"{folder}: cameras (transforms_train.json) of 3 views\n")
    assert "0 orthographic, 3 pinhole" in done.out
    assert "0 of 3" in done.out  # pictures
    assert toonset("check", folder).code == 2


def test_info_shows_what_it_can_of_a_damaged_bundle(place: Path, toonset):
    (place / "calibration.json").write_text("{")
    (place / "mannequin.obj").write_text("")
    done = toonset("info", place)
    assert done.code == 0
    assert "damaged   calibration.json: is no valid JSON" in done.out
    assert "damaged   mannequin.obj: is empty" in done.out


def test_info_and_check_of_a_run(run: Path, toonset):
    done = toonset("info", run)
    assert done.code == 0
    assert done.out.startswith(f"{run}: 20 steps, psnr ")
    assert "colours, ok\n" in done.out
    assert toonset("check", run).out == f"{run}: no problem\n"
    metrics = json.loads((run / "metrics.json").read_text())
    metrics["verdict"] |= {"verdict": "weak", "reasons": ["a drawing is off: mend it"]}
    (run / "metrics.json").write_text(json.dumps(metrics))
    weak = toonset("info", run).out
    assert "colours, weak\n" in weak
    assert "a drawing is off: mend it" in weak
    (run / "model.safetensors").write_bytes(b"\0" * 64)
    (run / "metrics.json").write_text('{"steps": NaN}')
    broken = toonset("check", run)
    assert broken.code == 2
    assert [line.split()[0] for line in broken.out.splitlines()[:2]] == [
        "model.safetensors",
        "metrics.json",
    ]


def test_check_lists_each_problem_aligned_and_exits_2(place: Path, toonset, snapshot):
    clean = toonset("check", place)
    assert (clean.code, clean.out, clean.err) == (0, f"{place}: no problem\n", "")
    (place / "labels" / "002.png").unlink()
    (place / "overlay.png").write_bytes(b"x")
    before = snapshot(place)
    done = toonset("check", place)
    assert done.code == 2
    assert done.out.splitlines() == [
        "labels/002.png  is missing; run `toonset palette` again",
        "overlay.png     is text, no picture that can be read; save it as PNG",
        f"{place}: 2 problems",
    ]
    told = toonset("check", place, "--json")
    assert told.code == 2
    assert [problem["where"] for problem in told.json["problems"]] == [
        "labels/002.png",
        "overlay.png",
    ]
    assert snapshot(place) == before


@pytest.mark.parametrize("verb", ["info", "check"])
def test_what_is_no_bundle_is_refused(verb, drawn: Path, tmp_path: Path, toonset):
    assert "does not exist" in toonset(verb, tmp_path / "nothing").reason
    assert "holds no transforms.json, split.json or config.json" in toonset(verb, tmp_path).reason
    assert "is a picture; name a folder" in toonset(verb, drawn / "sheet.png").reason
    told = toonset("view", drawn / "sheet.png", "-o", tmp_path / "x.html").reason
    assert "sheet.png: is a picture; run `toonset calibrate" in told
    (tmp_path / "x.txt").write_text("hello")
    if verb == "info":
        assert "is no valid JSON" in toonset(verb, tmp_path / "x.txt").reason


def test_check_goes_on_where_the_cameras_cannot_be_read(place: Path, toonset):
    content = json.loads((place / "transforms.json").read_text())
    content["frames"][0]["fl_x"] = content["frames"][1]["fl_x"] = "long"
    (place / "transforms.json").write_text(json.dumps(content))
    (place / "images" / "001.png").write_bytes(b"x")
    (place / "labels" / "002.png").write_bytes(b"x")
    done = toonset("check", place)
    assert [line.split()[0] for line in done.out.splitlines()[:-1]] == [
        "transforms.json",
        "transforms.json",
        "images/001.png",
        "labels/002.png",
    ]
    assert "(and 1 more problem); correct the file" in toonset("info", place).reason


def test_info_of_a_split_tells_what_came_and_went_and_check_every_problem(drawn, tmp_path, toonset):
    views = tmp_path / "views"
    assert toonset("split", drawn / "sheet.png", "-o", views).code == 0
    assert "gone" not in toonset("info", views).out
    (views / "images" / "001.png").rename(views / "images" / "side.png")
    done = toonset("info", views)
    assert "gone      001.png\n" in done.out
    assert "new       side.png (or renamed)\n" in done.out
    assert toonset("check", views).code == 0
    content = json.loads((views / "split.json").read_text())
    content["views"][0]["crop"][0] = -4
    content["views"][1]["label"] = 5
    (views / "split.json").write_text(json.dumps(content))
    (views / "images" / "002.png").write_bytes(b"x")
    (views / "overlay.png").write_bytes(b"x")
    done = toonset("check", views)
    assert done.code == 2
    where = [line.split()[0] for line in done.out.splitlines()[:-1]]
    assert where == ["split.json", "split.json", "images/002.png", "overlay.png"]
