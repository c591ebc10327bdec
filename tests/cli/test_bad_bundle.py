"""Broken bundles and runs: one clear line, exit code 2, nothing written."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image


def edited(change: Callable[[dict[str, Any]], Any]) -> Callable[[Path], None]:
    """Return what changes the first frame of a bundle's transforms.json."""

    def edit(bundle: Path) -> None:
        file = bundle / "transforms.json"
        content = json.loads(file.read_text())
        change(content["frames"][0])
        file.write_text(json.dumps(content))

    return edit


def foreign(**values: Any) -> Callable[[Path], None]:
    """Return what makes the first frame another program's, with these values."""
    return edited(lambda frame: (frame.pop("toonset"), frame.update(values)))


def cameras_text(content: str) -> Callable[[Path], Any]:
    return lambda bundle: (bundle / "transforms.json").write_text(content)


# what is done to the bundle -> what every reader of its cameras must say
BAD_CAMERAS: dict[str, tuple[Callable[[Path], Any], str]] = {
    "gone": (lambda b: (b / "transforms.json").unlink(), "holds no transforms.json; run `toonset"),
    "no folder": (lambda b: shutil.rmtree(b), "bundle: does not exist; give a bundle folder"),
    "no json": (cameras_text("{"), "is no valid JSON"),
    "a list": (cameras_text("[]"), "transforms.json: the whole: Input should be a valid dict"),
    "no frames": (cameras_text('{"frames": []}'), "field frames: "),
    "nan": (edited(lambda f: f["toonset"].update(scale=float("nan"))), "frames.0.toonset.scale"),
    "nan matrix": (foreign(transform_matrix=[[float("nan")] * 4] * 4), "transform_matrix.0.0"),
    "ragged": (foreign(transform_matrix=[[1, 2], [3]]), "transform_matrix.0.2: Field required"),
    "no focal": (foreign(fl_x=0), "fl_x: Input should be greater than 0"),
    "mirrored": (edited(lambda f: f["toonset"]["rotation"].reverse()), "camera: rotation mirrors"),
    "outside": (edited(lambda f: f.update(file_path="../x.png")), "lies outside of the folder"),
    "absolute": (edited(lambda f: f.update(file_path="/etc/passwd")), "lies outside of the folder"),
    "nul": (edited(lambda f: f.update(file_path="a\0b")), "is no file name; correct file_path"),
    "long": (edited(lambda f: f.update(file_path="a" * 300)), "is no file name; correct file_path"),
    "huge": (
        edited(lambda f: f["toonset"].update(size_wh=[100_000, 100_000])),
        "size 1e+05 x 1e+05 px, at most 80 megapixels",
    ),
    "far": (edited(lambda f: f["toonset"].update(k=1e300)), "camera: 1e+300, at most 1e+09"),
}


@pytest.mark.parametrize(
    ("case", "verb"),
    [(case, "palette") for case in BAD_CAMERAS]
    + [(case, verb) for case in ("gone", "nan") for verb in ("train", "render", "evaluate")],
)
def test_a_broken_bundle(case, verb, bundle, run, toonset, snapshot, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    spoil, words = BAD_CAMERAS[case]
    spoil(bundle)
    before = snapshot(tmp_path)
    arguments = {
        "palette": [bundle],
        "train": [bundle, "-o", tmp_path / "o"],
        "render": [run, "--cameras", bundle, "-o", tmp_path / "o"],
        "evaluate": [run, "--test", bundle],
    }
    reason = toonset(verb, *arguments[verb]).reason
    assert words in reason
    assert str(bundle) in reason
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (
            lambda b: Image.new("RGBA", (9, 9), "red").save(b / "images/000.png"),
            "000.png: is 9 x 9 px, transforms.json says",
        ),
        (lambda b: (b / "images/000.png").unlink(), "the picture does not exist"),
        (lambda b: (b / "images/000.png").write_bytes(b"\x89PNG"), "damaged or cut off"),
        (lambda b: (b / "palette.json").write_text("{"), "palette.json: "),
        (lambda b: shutil.copy(b / "images/000.png", b / "labels/000.png"), "indexed PNG is need"),
    ],
)
def test_broken_pictures_of_a_bundle(spoil, words, small_bundle: Path, run, toonset, tmp_path):
    bundle = Path(shutil.copytree(small_bundle, tmp_path / "b"))
    spoil(bundle)
    for line in (["train", bundle], ["evaluate", run, "--test", bundle]):
        done = toonset(*line)
        assert words in done.reason
        assert str(bundle) in done.reason
    assert not (bundle / "run").exists()


@pytest.mark.parametrize(
    ("verb", "arguments"),
    [
        ("render", ["--turntable", "1", "-o", "o"]),
        ("mesh", ["-o", "o.glb"]),
        ("evaluate", ["--test", "bundle"]),
    ],
)
def test_a_bundle_for_a_run(verb, arguments, bundle, run, toonset, snapshot, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run.rename(bundle / "run")
    before = snapshot(tmp_path)
    said = toonset(verb, "bundle", *arguments).reason
    assert said == "bundle: is no run; did you mean bundle/run?"
    assert snapshot(tmp_path) == before


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("config.json", None, "config.json: does not exist; `toonset train` writes run folders"),
        ("model.safetensors", None, "model.safetensors: does not exist"),
        ("config.json", b"[]", "config.json: "),
        ("config.json", b'{"format": 999}', "config.json: "),
        ("model.safetensors", b"\0" * 64, "model.safetensors: is damaged"),
        ("model.safetensors", b"\x80\x04pickle", "model.safetensors: is damaged"),
    ],
)
def test_a_broken_run(name, data, words, small_bundle, run: Path, toonset, snapshot, tmp_path):
    (run / name).unlink() if data is None else (run / name).write_bytes(data)
    before = snapshot(tmp_path)
    turn = ["render", run, "--turntable", 1, "-o", tmp_path / "o"]
    for line in (turn, ["evaluate", run, "--test", small_bundle]):
        assert words in toonset(*line).reason
    assert snapshot(tmp_path) == before


def test_cuda_without_a_gpu(bundle: Path, toonset, snapshot, tmp_path):
    import torch

    if torch.cuda.is_available():
        pytest.skip("this machine has a GPU")
    before = snapshot(tmp_path)
    assert (
        "torch sees no GPU here; use --device cpu"
        in toonset(*("train", bundle, "--device", "cuda")).reason
    )
    assert snapshot(tmp_path) == before
