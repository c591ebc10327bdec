"""Bad input: one clear line on stderr, exit code 2, nothing written."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")  # numpy's are no clear line

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


# file name -> (how to make it, what the line must say)
BAD_PICTURES: dict[str, tuple[Callable[[Path], Any], str]] = {
    "missing.png": (lambda path: None, "no such file; check the name"),
    "folder.png": (lambda path: path.mkdir(), "is a folder without pictures; name a sheet"),
    "pipe.png": (lambda path: os.mkfifo(path), "no regular file; give a picture file"),
    "text.png": (lambda path: path.write_text("x"), "is text, no picture that can be read; save"),
    "blank.png": (
        lambda path: Image.new("RGB", (300, 120), "white").save(path),
        "the sheet is blank (all #ffffff)",
    ),
    "e\x1b[31mvil\n.png": (lambda path: None, "e?[31mvil .png: no such file"),
}


@pytest.mark.parametrize("verb", ["calibrate", "split"])
@pytest.mark.parametrize("name", BAD_PICTURES)
def test_a_bad_sheet(name, verb, drawn: Path, toonset, snapshot, tmp_path, monkeypatch):
    make, words = BAD_PICTURES[name]
    make(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    before = snapshot(tmp_path)
    mesh = ["--mesh", drawn / "mannequin.obj"] if verb == "calibrate" else []
    reason = toonset(verb, name, *mesh).reason
    assert words in reason
    assert reason.startswith(" ".join(name.replace("\x1b", "?").split()))
    assert snapshot(tmp_path) == before


BAD_MESHES = {
    "points.obj": (TRIANGLE, "3 vertices and no faces; export"),
    "lying.obj": ("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n", "turn the mannequin upright"),
    "picture.png": ("\x89PNG\r\n\x1a\n", "is a PNG picture, no mesh that can be read; export"),
}


@pytest.mark.parametrize("name", BAD_MESHES)
def test_a_bad_mesh(name, drawn: Path, toonset, snapshot, tmp_path, monkeypatch):
    data, words = BAD_MESHES[name]
    (tmp_path / name).write_bytes(data.encode("latin-1"))
    monkeypatch.chdir(tmp_path)
    before = snapshot(tmp_path)
    reason = toonset("calibrate", drawn / "sheet.png", "--mesh", name).reason
    assert reason.startswith(f"{name}: ")
    assert words in reason
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["synth", "mannequin.obj", "--views", "0", "-o", "x"],
            "Invalid value for '--views': Input should be greater than or equal to 1",
        ),
        (
            ["palette", "sheet.png", "--keep", "x"],
            "nor a palette file (.gpl, .ase, .aco, .pal, .json",
        ),
        (["calibrate", "sheet.png", "--mesh", "sheet.png"], "sheet.png: is a PNG picture, no mesh"),
        (["render", ".", "--turntable", "2", "-o", "x"], "config.json: does not exist"),
    ],
)
def test_as_a_process(arguments, words, drawn: Path, shell, snapshot, tmp_path):
    work = Path(shutil.copytree(drawn, tmp_path / "work"))
    before = snapshot(work)
    assert words in shell(*arguments, cwd=work).reason
    assert snapshot(work) == before
