"""Places that cannot be written: one clear line, exit code 2, everything as it was."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT_ON_LINUX = sys.platform == "linux" and os.geteuid() == 0 and shutil.which("unshare")


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("taken", "taken: exists already; pass --force to replace it, or choose another -o"),
        ("file", "file: is a file, a folder is needed; choose another -o"),
        ("file/below", "is a file, not a folder; choose another -o"),
        ("/proc/toonset", "/proc is not writable"),
        ("/dev/full", "/dev/full: is a file, a folder is needed"),
        ("x" * 300, "File name too long"),
    ],
)
@pytest.mark.parametrize("verb", ["calibrate", "palette", "train", "render"])
def test_an_output_that_cannot_be(
    verb, out, words, drawn, bundle, run, toonset, snapshot, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "old.txt").write_text("old")
    (tmp_path / "file").write_text("old")
    before = snapshot(tmp_path)
    arguments = {
        "calibrate": [drawn / "sheet.png", "--mesh", drawn / "mannequin.obj"],
        "palette": [bundle],
        "train": [bundle],
        "render": [run, "--turntable", 1],
    }
    assert words in toonset(verb, *arguments[verb], "-o", out).reason
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        (["calibrate", "none.png"], "none.png: no such file; check the name of the picture"),
        (["calibrate", "a.png", "--mesh", "no.obj"], "no.obj: no such file"),
        (["calibrate", "a.png", "--landmarks", "no.csv"], "no.csv: no such file"),
        (["calibrate", "a.png", "--boxes", "no.csv"], "no.csv: no such file"),
        (["calibrate", "a.png", "--init", "none"], "none: does not exist"),
        (["split", "none.png"], "none.png: no such file"),
        (["palette", "none.png"], "none.png: no such file"),
        (["recolor", "none", "--recolor", "red=#fff"], "none: does not exist"),
        (["train", "none"], "none: does not exist"),
        (["render", "none", "--turntable", "2"], "none/config.json: does not exist"),
        (["evaluate", "none", "--test", "none"], "none/config.json: does not exist"),
        (["consistency", "none"], "none: does not exist"),
        (["export", "none", "--to", "gltf"], "none: does not exist"),
        (["import", "none"], "none: does not exist"),
        (["synth", "none.obj"], "none.obj: no such file"),
        (["mesh", "none"], "none/config.json: does not exist"),
    ],
)
def test_an_input_that_is_not_there_is_told_before_an_output_that_is(
    verb, words, toonset, drawn, snapshot, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    shutil.copy(drawn / "single.png", "a.png")
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "old.txt").write_text("old")
    (tmp_path / "taken.glb").write_text("old")
    before = snapshot(tmp_path)
    out = "taken.glb" if verb[0] == "mesh" else "taken"
    assert toonset(*verb, "-o", out).reason.startswith(words)
    assert snapshot(tmp_path) == before


@pytest.mark.skipif(not ROOT_ON_LINUX, reason="mounting a small or read-only disk needs root")
@pytest.mark.parametrize(
    ("options", "words"),
    [("ro", "is not writable (Read-only file system)"), ("size=8k", "No space left on device")],
)
def test_a_real_disk_that_takes_nothing(options, words, drawn: Path, snapshot, tmp_path):
    script = 'mount -t tmpfs -o "$1" tmpfs disk && shift && "$@"; code=$?; ls -A disk; exit $code'
    (tmp_path / "disk").mkdir()
    verb = ["split", str(drawn / "single.png"), "-o", "disk/b", "-q"]
    shell = ["unshare", "-m", "sh", "-c", script, "sh", options]
    done = subprocess.run(
        [*shell, sys.executable, "-m", "toonset", *verb],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    if "mount" in done.stderr:
        pytest.skip(f"no mounts here: {done.stderr}")
    assert (done.returncode, done.stdout) == (2, "")  # nothing lies on the disk
    assert words in done.stderr
    assert done.stderr.startswith("toonset: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("verb", "files_that_fit"),
    [(verb, count) for verb in ("calibrate", "palette", "render") for count in (0, 3)]
    + [("palette", 6), ("render", 8)],
)
def test_a_full_disk_leaves_everything_as_it_was(
    verb, files_that_fit, drawn, bundle, run, toonset, snapshot, tmp_path, monkeypatch
):
    arguments = {
        "calibrate": [drawn / "single.png", "--mesh", drawn / "mannequin.obj", "-o", bundle],
        "palette": [bundle, "--colors", "#ff0000"],
        "render": [run, "--turntable", 8, "--size", 16, "-o", tmp_path / "turn"],
    }
    assert toonset("palette", bundle).code == 0
    before, sync, left = snapshot(tmp_path), os.fsync, [files_that_fit]

    def full(handle: int) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(handle)

    monkeypatch.setattr(os, "fsync", full)
    done = toonset(verb, *arguments[verb], *(["--force"] if verb == "calibrate" else []), "-q")
    assert "cannot be written (No space left on device); free space" in done.reason
    assert snapshot(tmp_path) == before
