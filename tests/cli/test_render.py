"""`toonset render` in the drawn look: its default, its pen, and what it refuses."""

import json
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from PIL import Image

from toonset.dataset.images.picture import load_rgba
from toonset.nerf.render.animation import INSTALL_AV
from toonset.view import over_white

QUICK = ("--steps", 20, "--threads", 1, "--device", "cpu", "-q")


@pytest.fixture(scope="module")
def lined(drawn: Path, tmp_path_factory: pytest.TempPathFactory, toonset) -> Path:
    """Return a run of eight drawings with outlines."""
    folder = tmp_path_factory.mktemp("lined")
    size = ("--cell", 100, "--outline", 2, "--seed", 3, "-q")
    mesh = drawn / "mannequin.obj"
    assert toonset("synth", mesh, *size, "-o", folder / "sheet").code == 0
    run = folder / "run"
    assert toonset("train", folder / "sheet" / "views", "-o", run, *QUICK).code == 0
    return run


def shown(folder: Path, name: str = "000.png") -> np.ndarray:
    return load_rgba(folder / name).astype(int)


def test_a_drawn_camera_returns_its_drawing(lined: Path, toonset, tmp_path: Path) -> None:
    cameras = lined.parent / "sheet" / "views" / "transforms.json"
    asked = ("render", lined, "--cameras", cameras, "--json", "-o")
    assert toonset(*asked, tmp_path / "own").json["layer"] == "drawn"
    frames = json.loads(cameras.read_text())["frames"]
    for frame in frames:
        drawn = load_rgba(cameras.parent / frame["file_path"]).astype(int)
        found = shown(tmp_path / "own", Path(frame["file_path"]).name)
        assert np.abs(found[..., 3] - drawn[..., 3]).max() <= 1
        assert np.abs(found - drawn)[drawn[..., 3] == 255].max() <= 1


def test_a_turn_of_as_many_views_as_drawings_is_the_drawings(lined, toonset, tmp_path) -> None:
    views = lined.parent / "sheet" / "views"
    frames = json.loads((views / "transforms.json").read_text())["frames"]
    turn = toonset("render", lined, "--turntable", len(frames), "-o", tmp_path, "--force", "--json")
    assert turn.json["layer"] == "drawn"
    turned = [figure(tmp_path / f"{i:03d}.png") for i in range(len(frames))]
    for frame in frames:
        drawn = figure(views / frame["file_path"])
        room = [np.abs(np.subtract(one.shape, drawn.shape)).max() <= 3 for one in turned]
        apart = [
            np.abs(cv2.resize(one, drawn.shape[1::-1]).astype(int) - drawn)[..., :3].mean()
            for one, fits in zip(turned, room, strict=True)
            if fits
        ]
        assert min(apart) < 6  # of 255; those of neighbouring drawings are 20 and more


def figure(file: Path) -> np.ndarray:
    """Return what a picture shows, over white, cut to it."""
    rgba = load_rgba(file)
    rows, columns = (np.flatnonzero((rgba[..., 3] > 127).any(axis=axis)) for axis in (1, 0))
    flat = (over_white(rgba) * 255).astype(np.uint8)
    return flat[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def test_turntables_of_sheets_without_lines_are_drawn(trained, toonset, tmp_path: Path) -> None:
    turn = ("render", trained[0], "--turntable", 1, "-o")
    assert toonset(*turn, tmp_path / "turn", "--json").json["layer"] == "drawn"
    pen = toonset(*turn, tmp_path / "pen", "--ink-width", 2)
    assert "no contour lines" in pen.reason


def test_the_pen_can_be_another_or_none(lined: Path, toonset, tmp_path: Path) -> None:
    turn = ("render", lined, "--turntable", 1, "-q", "-o")
    pen = ("--ink-width", 5, "--ink-color", "#e020a0")
    assert toonset(*turn, tmp_path / "as", "--layer", "ink").code == 0
    assert toonset(*turn, tmp_path / "wide", "--layer", "ink", *pen).code == 0
    assert toonset(*turn, tmp_path / "pink", *pen).code == 0
    assert toonset(*turn, tmp_path / "bare", "--no-lines").code == 0
    area = [shown(tmp_path / name)[..., 3].sum() for name in ("as", "wide")]
    assert area[1] > 1.8 * area[0]
    pink = (np.abs(shown(tmp_path / "pink")[..., :3] - (224, 32, 160)).max(axis=-1) < 4).sum()
    assert pink > 100
    assert toonset(*turn, tmp_path / "no", "--layer", "ink", "--no-lines").code == 2
    assert "--ink-color" in toonset(*turn, tmp_path / "no", "--ink-color", "inky").reason
    assert not (tmp_path / "no").exists()


def test_colours_are_replaced_in_the_drawn_look(lined: Path, toonset, tmp_path: Path) -> None:
    colors = json.loads((lined / "config.json").read_text())["field"]["palette"]
    paint = max(colors, key=sum)  # the ink is dark
    old = "#" + "".join(f"{value:02x}" for value in paint)
    turn = ("render", lined, "--turntable", 1, "-o")
    assert toonset(*turn, tmp_path / "as", "-q").code == 0
    new = toonset(*turn, tmp_path / "new", "--recolor", f"{old}=#00ff00", "--json")
    assert new.json["layer"] == "drawn"
    green = np.abs(shown(tmp_path / "new")[..., :3] - (0, 255, 0)).max(axis=-1) < 8
    was = np.abs(shown(tmp_path / "as")[..., :3] - paint).max(axis=-1) < 8
    assert green.sum() > 0.8 * was.sum() > 100


def test_a_turn_in_layers(lined: Path, toonset, tmp_path: Path) -> None:
    out = tmp_path / "layers"
    turn = ("render", lined, "--turntable", 3, "-o")
    done = toonset(*turn, out, "--format", "ora", "--json")
    assert done.json["together"] == ["turntable.ora"]
    with zipfile.ZipFile(out / "turntable.ora") as file:
        assert file.namelist()[0] == "mimetype"
        [stack] = ElementTree.fromstring(file.read("stack.xml"))
        assert [view.get("name") for view in stack] == ["000", "001", "002"]
        assert all(view[0].get("name") == "lines" and len(view) > 2 for view in stack)
        assert file.read("mergedimage.png") == (out / "000.png").read_bytes()
    bare = toonset(*turn, tmp_path / "bare", "--format", "ora,webp", "--no-lines", "--json")
    assert bare.json["together"] == ["turntable.webp", "turntable.ora"]
    with zipfile.ZipFile(tmp_path / "bare" / "turntable.ora") as file:
        assert b'"lines"' not in file.read("stack.xml")
    layers = toonset(*turn, tmp_path / "no", "--format", "ora", "--layer", "depth")
    assert "layer 'depth': has no paints for turntable.ora" in layers.reason
    assert not (tmp_path / "no").exists()


def test_a_turn_as_vectors(lined: Path, toonset, tmp_path: Path) -> None:
    out = tmp_path / "vectors"
    turn = ("render", lined, "--turntable", 2, "-o")
    done = toonset(*turn, out, "--format", "svg", "--json")
    assert done.json["svg"] == ["000.svg", "001.svg"]
    assert done.json["together"] == []
    root = ElementTree.parse(out / "001.svg").getroot()
    with Image.open(out / "001.png") as picture:
        assert root.get("viewBox") == f"0 0 {picture.width} {picture.height}"
    assert [group.get("id") for group in root][-1] == "lines"
    again = toonset(*turn, out, "--format", "svg", "--no-lines", "--force", "-q")
    assert again.code == 0
    assert b'"lines"' not in (out / "001.svg").read_bytes()
    layers = toonset(*turn, tmp_path / "no", "--format", "svg", "--layer", "depth")
    assert "layer 'depth': cannot be written as SVG; let the first layer be drawn" in layers.reason
    assert layers.code == 2
    assert not (tmp_path / "no").exists()


def test_a_run_made_before_says_how_to_get_the_layer(lined: Path, toonset, tmp_path: Path) -> None:
    import shutil

    old = Path(shutil.copytree(lined, tmp_path / "old"))
    config = json.loads((old / "config.json").read_text())
    del config["field"]["drawings"]
    (old / "config.json").write_text(json.dumps(config))
    for name in ("drawings.png", "drawings.safetensors"):
        (old / name).unlink()
    turn = ("render", old, "--turntable", 1, "-o", tmp_path / "turn")
    assert "no drawn look; train again" in toonset(*turn, "--layer", "drawn").reason
    assert not (tmp_path / "turn").exists()
    assert toonset(*turn).code == 0  # the field's colour, as before


def test_a_film_without_its_codec_is_refused_before_any_work(toonset, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    film = ("--turntable", 8, "--format", "webp,mp4", "-o", tmp_path / "film")
    assert toonset("render", tmp_path / "no run is read", *film).reason.endswith(INSTALL_AV)
    for page in ("README.md", "docs/guide_training.md"):
        assert INSTALL_AV in (Path(__file__).parents[2] / page).read_text(encoding="utf-8")


def test_what_no_drawing_shows_is_said(lined: Path, toonset, tmp_path: Path) -> None:
    above = ("render", lined, "--turntable", 1, "--elevation", 80, "-o", tmp_path / "above")
    assert "is in no drawing and goes on with the paint beside it" in toonset(*above).err
    level = ("render", lined, "--turntable", 1, "-o", tmp_path / "level")
    assert "in no drawing" not in toonset(*level).err
