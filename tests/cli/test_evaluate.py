"""`toonset evaluate`: sections, reasons, files and the picture."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import toonset as ts
from toonset.camera import Camera
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.nerf.score.evaluate import ScoredView, chosen_frames, report
from toonset.nerf.score.evaluation_picture import (
    CAPTION_PX,
    HEADING_PX,
    TILE_PX,
    contact_sheet,
    worst_first,
)
from toonset.nerf.score.metrics_view import Judges, figures_of

JUDGES = Judges("no flip here", "no lpips here")
RED, BLUE = (200, 30, 20, 255), (20, 60, 200, 255)
LABEL_FIGURES: dict[str, float | None] = {"label_accuracy": 0.5, "label_miou": None}


def scored(name: str, wrong_px: int, *, palette: bool = True) -> ScoredView:
    """Return a view of a red square of which so many rows are rendered blue."""
    drawn = np.zeros((40, 40, 4), dtype=np.uint8)
    drawn[10:30, 10:30] = RED
    rendered = drawn.copy()
    rendered[10 : 10 + wrong_px, 10:30] = BLUE
    figures, error = figures_of(rendered, drawn, JUDGES)
    layers = ["rgb", "palette"] if palette else ["rgb"]
    return ScoredView(
        name,
        drawn,
        dict.fromkeys(layers, rendered),
        dict.fromkeys(layers, figures | LABEL_FIGURES),
        dict.fromkeys(layers, error),
    )


def test_held_out_and_training_views_apart(bundle, trained, toonset, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(trained[0], bundle / "run")
    done = toonset("evaluate", "bundle/run", "--test", "bundle", "--json", "-o", "judged")
    assert done.code == 0
    assert "bundle: holds pictures that the run was trained on; they are not held out" in done.err
    found = done.json
    assert {path.name for path in (tmp_path / "judged").iterdir()} == {
        "evaluation.json",
        "evaluation.png",
    }
    assert json.loads((tmp_path / "judged" / "evaluation.json").read_text()) == found
    # both are the same pictures here, but the test's labels are made anew
    assert found["training"]["rgb"] == found["rgb"]
    assert found["training"]["views"] == found["views"]
    assert found["absent"].keys() <= {"flip", "lpips"}
    assert 0 < found["palette"]["label_accuracy"] <= 1
    assert 0 < found["drawn"]["label_miou"] <= 1
    assert 0 < found["drawn"]["label_miou_shift"] <= 1
    assert found["drawn"]["psnr"] > 30  # drawn cameras return their drawings
    for layer in ("drawn", "rgb", "palette"):
        each = [view[layer]["psnr"] for view in found["views"]]
        assert found[layer]["psnr"] == pytest.approx(np.mean(each))
    with Image.open(tmp_path / "judged" / "evaluation.png") as picture:
        rows = -(-len(found["views"]) // 2)  # two views side by side, two sections
        assert picture.height == 2 * (HEADING_PX + rows * (TILE_PX + CAPTION_PX))


def test_a_run_apart_from_its_bundle(bundle: Path, run: Path, toonset, snapshot, tmp_path) -> None:
    before = snapshot(tmp_path)
    alone = toonset("evaluate", run, "--test", bundle, "--json")
    assert alone.json["training"] is None
    assert alone.json["absent"]["training"] == f"{run}/.. holds no transforms.json; pass --bundle"
    told = toonset("evaluate", run, "--test", bundle, "--bundle", bundle, "--json")
    assert told.json["training"]["views"] == alone.json["views"]
    assert "training" not in told.json["absent"]
    assert snapshot(tmp_path) == before  # nothing is written without -o
    (tmp_path / "transforms.json").write_text("{")
    broken = toonset("evaluate", run, "--test", bundle, "--json")
    assert broken.code == 0
    assert "transforms.json" in broken.json["absent"]["training"]
    missing = toonset("evaluate", run, "--test", bundle, "--bundle", tmp_path / "none")
    assert str(tmp_path / "none") in missing.reason


@pytest.mark.parametrize("spoiled", [False, True])
def test_a_reason_names_no_place_of_this_machine(
    spoiled, bundle: Path, run: Path, toonset, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if spoiled:
        (tmp_path / "transforms.json").write_text("{")
    done = toonset("evaluate", run.name, "--test", bundle.name, "--json")
    assert "transforms.json" in done.json["absent"]["training"]
    assert str(tmp_path) not in done.out


def test_the_table(bundle: Path, run: Path, toonset) -> None:
    done = toonset("evaluate", run, "--test", bundle, "--bundle", bundle, "--quiet")
    views = len(read_scene(bundle).frames)
    whole = done.out.splitlines()
    first = whole.index("held-out views")
    assert whole[first - 1] == ""
    assert "training views" in whole[:first]
    lines = whole[first:]  # what counts is what the screen shows last
    assert lines[1].split()[:6] == ["view", "layer", "PSNR", "dB", "in", "mask"]
    assert lines[1].split()[-2:] == ["mIoU", "mIoU+-2"]  # a drawing without lines has no F1
    last = 2 + 3 * views
    assert [line.split()[0] for line in lines[last : last + 3]] == ["mean"] * 3
    assert [line.split()[1] for line in lines[last : last + 3]] == ["drawn", "rgb", "palette"]
    assert len(lines) == last + 3
    assert lines[3].split()[2:4] != lines[4].split()[2:4]  # rgb and palette differ
    widths = {len(line) for line in lines[1:]}
    assert len(widths) == 1
    assert "LPIPS" not in lines[1] or "lpips: " not in done.out


def test_an_output_is_not_replaced_unasked(bundle, run, toonset, snapshot, tmp_path):
    out = tmp_path / "judged"
    out.mkdir()
    (out / "drawing.png").write_bytes(b"mine")
    before = snapshot(tmp_path)
    arguments = ("evaluate", run, "--test", bundle, "-o", out)
    assert "exists already; pass --force" in toonset(*arguments).reason
    assert "holds 'drawing.png'" in toonset(*arguments, "--force").reason
    assert snapshot(tmp_path) == before


def test_the_views_of_a_run_among_those_of_its_bundle() -> None:
    camera = Camera.looking_at(np.zeros(3), 0.0, 0.0, 1.0, (4, 4))
    blank = np.zeros((4, 4, 4), dtype=np.uint8)
    scene = Scene(tuple(Frame(n, camera, blank) for n in ("a.png", "b.png", "c.png")), None, "s")

    def names(config: object) -> list[str]:
        return [frame.name for frame in chosen_frames(scene, config).frames]

    assert names({"scene": {"views": ["c.png", "a.png"]}}) == ["a.png", "c.png"]
    assert names({"scene": {"views": ["d.png"]}}) == []
    assert names({}) == names({"scene": {"views": 3}}) == names([]) == ["a.png", "b.png", "c.png"]


def test_a_run_without_palette_has_no_palette_figures() -> None:
    found = report([scored("a", 1, palette=False)], [], {"flip": "why"})
    assert found["palette"] is None
    assert found["views"][0]["palette"] is None
    assert found["training"] is None
    assert found["absent"] == {"flip": "why"}
    json.dumps(found, allow_nan=False)


def test_the_worst_views_come_first_and_wrong_pixels_glow() -> None:
    views = [scored("good", 1), scored("bad", 9), scored("right", 0), scored("worse", 12)]
    assert [view.name for view in worst_first(views)] == ["worse", "bad", "good", "right"]
    sheet = contact_sheet([("held-out views", views), ("training views", [])], "mean difference")
    block = TILE_PX + CAPTION_PX
    assert sheet.shape[0] == HEADING_PX + 2 * block
    # the last column of tiles of each block: the heat map, black where nothing is wrong
    heat = sheet[HEADING_PX : HEADING_PX + TILE_PX, :, :].astype(int)
    first, second = np.split(heat, 2, axis=1)
    share = [
        float((part[:, -TILE_PX - 8 : -8].sum(axis=-1) > 60).mean()) for part in (first, second)
    ]
    assert share[0] > share[1] > 0.3
    right = sheet[HEADING_PX + block : HEADING_PX + block + TILE_PX, -TILE_PX - 8 : -8]
    assert right.max() < 10


def test_a_picture_shows_the_worst_of_many_views() -> None:
    views = [scored(f"{i}", i % 9) for i in range(30)]
    sheet = contact_sheet([("held-out views", views)], "FLIP")
    assert sheet.shape[0] == HEADING_PX + 12 * (TILE_PX + CAPTION_PX)
    odd = contact_sheet([("a", views[:3]), ("b", views[:1])], "FLIP")
    assert odd.shape == (2 * HEADING_PX + 3 * (TILE_PX + CAPTION_PX), sheet.shape[1], 3)


def test_each_drawing_left_out(bundle: Path, trained, toonset, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    scene = read_scene(bundle)
    kept = replace(scene, frames=scene.frames[:3])
    options = ts.TrainOptions(steps=3, device="cpu", mannequin=False)
    ts.train(kept, options).save(bundle / "run")
    done = toonset("evaluate", "bundle/run", "--leave-one-out", "--json", "-o", "judged")
    assert done.code == 0
    found = json.loads((tmp_path / "judged" / "evaluation.json").read_text())
    assert found == done.json
    assert found == json.loads(json.dumps(ts.leave_one_out(kept, options).to_json()))
    assert [len(view["trained_on"]) for view in found["leave_one_out"]["views"]] == [2, 2, 2]
    assert (tmp_path / "judged" / "evaluation.png").is_file()


@pytest.mark.parametrize(
    ("flags", "reason"),
    [
        ((), "give --test with held-out views, or --leave-one-out"),
        (("--leave-one-out", "--test", "bundle"), "give --test with held-out views"),
        (("--leave-one-out",), "holds no transforms.json; pass --bundle"),
    ],
)
def test_left_out_of_what(flags, reason, run: Path, toonset) -> None:
    assert reason in toonset("evaluate", run, *flags).reason


def test_left_out_with_options_that_no_run_has(bundle: Path, run: Path, toonset) -> None:
    config = json.loads((run / "config.json").read_text())
    for changed in ({"steps": 0}, {"brightness": 1}):
        content = {**config, "options": {**config["options"], **changed}}
        (run / "config.json").write_text(json.dumps(content))
        done = toonset("evaluate", run, "--leave-one-out", "--bundle", bundle)
        assert "config.json" in done.reason
        assert "train again" in done.reason
