"""--force: it replaces what an earlier run of the same command wrote, and nothing of a user's."""

import shutil
from pathlib import Path

import pytest


def test_force_replaces_an_earlier_result_only(run: Path, toonset, snapshot, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def render(out: str, *more: str):
        return toonset(
            "render", run, "--turntable", 1, "--size", 16, "--no-gif", "-o", out, *more, "-q"
        )

    assert render("turn").code == 0
    (tmp_path / "turn" / "old.png").write_text("an earlier picture")
    before = snapshot(tmp_path)
    assert "exists already; pass --force to replace it" in render("turn").reason
    assert snapshot(tmp_path) == before
    assert render("turn", "--force").code == 0
    assert set(snapshot(tmp_path / "turn")) == {"000.png"}


def test_force_replaces_a_bundle_with_its_palette(drawn: Path, bundle: Path, toonset):
    before = {path.name for path in bundle.iterdir()}
    assert toonset("palette", bundle, "-q").code == 0
    arguments = ("calibrate", drawn / "single.png", "--mesh", drawn / "mannequin.obj", "-o", bundle)
    assert "exists already; pass --force to replace it" in toonset(*arguments, "-q").reason
    done = toonset(*arguments, "-q", "--force")  # a single drawing
    assert (done.code, done.err.count("\n")) == (3, 1)  # only why
    assert done.err.startswith("sheet: weak (")
    assert {path.name for path in bundle.iterdir()} == before


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("work", "holds 'notes.txt', which this command does not write"),
        ("drawings", "drawings/sheet.png, --force would delete it"),
        (".", "which this command does not write"),
    ],
)
def test_force_never_takes_a_users_folder(
    out, words, drawn, toonset, snapshot, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for name in ("work", "drawings/images", "drawings/run"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "work" / "notes.txt").write_text("mine")
    sheet = "drawings/images/sheet.png" if out == "drawings" else "work/sheet.png"
    shutil.copy(drawn / "single.png", sheet)
    words = words.replace("drawings/sheet.png", sheet)
    before = snapshot(tmp_path)
    done = toonset("calibrate", sheet, "--mesh", drawn / "mannequin.obj", "-o", out, "--force")
    assert words in done.reason
    assert snapshot(tmp_path) == before


def test_force_never_takes_the_folder_one_stands_in(drawn, bundle, toonset, snapshot, monkeypatch):
    monkeypatch.chdir(bundle / "images")
    before = snapshot(bundle)
    done = toonset(
        "calibrate", drawn / "single.png", "--mesh", drawn / "mannequin.obj", "-o", "..", "--force"
    )
    assert "holds the current folder, --force would delete it" in done.reason
    assert snapshot(bundle) == before
