"""The public interface: what it names, that it costs nothing to import, and the commands' bytes."""

import ast
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from threadpoolctl import threadpool_info, threadpool_limits

import toonset as ts
from toonset.nerf.run.monitor import MonitorOptions
from toonset.nerf.surface.texture import texture_surface

FEW = {"steps": 20, "device": "cpu"}
TIMINGS = {"seconds", "versions", "threads"}  # keys of JSON files that differ from run to run
HEAVY = ("numpy", "torch", "cv2", "scipy", "PIL", "pydantic", "typer", "kornia", "trimesh")


def test_every_public_name_is_there_and_documented() -> None:
    assert len(dir(ts)) <= 30
    for name in set(dir(ts)) - {"__version__"}:
        assert getattr(ts, name).__doc__, name
    with pytest.raises(AttributeError, match="no attribute 'Calibrate'"):
        _ = ts.Calibrate  # type: ignore[attr-defined]


def test_type_checkers_see_the_names_that_are_there() -> None:
    tree = ast.parse(Path(ts.__file__).read_text(encoding="utf-8"))
    block = next(node.body for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in block if isinstance(node, ast.ImportFrom)]
    seen = {(node.module, alias.name) for node in imports for alias in node.names}
    shown = {alias.asname for node in imports for alias in node.names if alias.asname}
    for node in block:
        if isinstance(node, ast.Assign):
            shown |= {n.id for n in ast.walk(node.targets[0]) if isinstance(n, ast.Name)}
    assert shown == set(dir(ts)) - {"__version__"}
    places = {
        (f"toonset.{module}", entry.split("=")[-1])
        for module, names in ts._PLACES.items()
        for entry in names.split()
    }
    assert places == seen


@pytest.mark.parametrize("line", ["import toonset", "import toonset; toonset.__version__"])
def test_the_import_is_light(line: str) -> None:
    code = f"import sys; {line}; print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_calibrating_imports_no_torch_no_scipy_and_no_palette_finder_before_their_use() -> None:
    late = ["torch", "scipy", "toonset.palette.extract", "toonset.palette.shaded"]
    line = "import toonset as ts; ts.calibrate; ts.split_sheet; ts.write_bundle"
    code = f"import sys; {line}; print([m for m in {late} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def plain(path: Path) -> Any:
    """Return a file's content, JSON without what differs from run to run."""
    if path.suffix != ".json":
        return path.read_bytes()
    return without_timings(json.loads(path.read_text(encoding="utf-8")))


def without_timings(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: without_timings(v) for k, v in value.items() if k not in TIMINGS}
    return [without_timings(v) for v in value] if isinstance(value, list) else value


def assert_same_files(one: Path, other: Path, *, apart: tuple[str, ...] = ()) -> None:
    names = [
        sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
        for folder in (one, other)
    ]
    assert names[0] == names[1]
    for name in set(names[0]) - set(apart):
        assert plain(one / name) == plain(other / name), name


@pytest.fixture(scope="session")
def found(drawn: Path, tmp_path_factory: pytest.TempPathFactory) -> ts.Calibration:
    mesh = tmp_path_factory.mktemp("gone") / "mannequin.obj"
    shutil.copy(drawn / "mannequin.obj", mesh)
    body = ts.load_mesh(mesh)
    mesh.unlink()  # what is recorded of it is of the bytes that were read
    return ts.calibrate(ts.split_sheet(drawn / "sheet.png").views, body)


@pytest.fixture
def written(found: ts.Calibration, tmp_path: Path) -> ts.Bundle:
    return ts.write_bundle(tmp_path / "mine", found, ts.extract_palette(found.drawings))


def test_calibrate_writes_what_the_command_writes(found, bundle, tmp_path):
    ts.write_bundle(tmp_path / "mine", found)
    assert_same_files(bundle, tmp_path / "mine")


def test_palette_writes_what_the_command_writes(written, bundle, toonset):
    assert toonset("palette", bundle).code == 0
    assert_same_files(bundle, written.folder)
    assert written.palette is not None
    for frame in written.scene.frames:
        np.testing.assert_array_equal(frame.labels, ts.label_image(frame.rgba, written.palette))


def test_hints_and_cuts_reach_the_bundle_as_from_the_command(drawn, toonset, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    labels = "front,?,?,288"
    cut = ("--drop", "1", "--background", "#ffffff", "--views", labels, "--mesh", "none")
    assert toonset("calibrate", drawn / "sheet.png", *cut).code in (0, 3)
    sheet = ts.split_sheet(drawn / "sheet.png", ts.SheetOptions(drop="1", background="#ffffff"))
    ts.write_bundle("mine", ts.calibrate(sheet.views, ts.Body.NONE, hints=ts.Hints(labels=labels)))
    assert_same_files(tmp_path / "bundle", tmp_path / "mine")
    options = json.loads((tmp_path / "mine/calibration.json").read_text())["options"]
    assert (options["drop"], options["views"]) == ("1", labels)


def test_labels_of_a_split_folder_are_known_without_saying_them_again(drawn, toonset, tmp_path):
    labels = "front,72,144,216,288"
    toonset("split", drawn / "sheet.png", "--views", labels, "-o", tmp_path / "views")
    found = ts.calibrate(ts.split_sheet(tmp_path / "views").views, ts.Body.NONE)
    assert found.origin["options"]["views"] == labels


def test_train_and_render_write_what_the_commands_write(written, toonset, tmp_path):
    few = ("--steps", FEW["steps"], "--device", "cpu", "--threads", 2)
    assert toonset("train", written.folder, "-o", tmp_path / "run", *few).code in (0, 3)
    run = ts.train(written.scene, ts.TrainOptions(**FEW), threads=2)
    run.save(tmp_path / "mine-run")
    assert_same_files(tmp_path / "run", tmp_path / "mine-run", apart=("history.csv",))  # seconds

    layers = ("rgb", "palette", "labels", "normal")
    flags = [word for layer in layers for word in ("--layer", layer)]
    out = tmp_path / "turn"
    assert (
        toonset("render", tmp_path / "run", "--turntable", 2, *flags, "--no-gif", "-o", out).code
        == 0
    )
    field = ts.read_run(tmp_path / "mine-run")
    for i, camera in enumerate(ts.turntable(field, 2)):
        rendering = ts.render(field, camera)
        for layer in layers:
            rendering.save(tmp_path / "mine-turn" / f"{i:03d}-{layer}.png", layer)
    assert_same_files(out, tmp_path / "mine-turn")


def test_evaluate_and_surface_give_what_the_commands_write(run, small_scene, toonset, tmp_path):
    test, field = ts.read_bundle(small_scene).scene, ts.read_run(run)
    out = tmp_path / "judged"
    assert toonset("evaluate", run, "--test", small_scene, "-o", out, "--quiet").code == 0
    mine, theirs = ts.evaluate(field, test), json.loads((out / "evaluation.json").read_text())
    assert mine["rgb"] == theirs["rgb"]
    assert mine["views"] == theirs["views"]

    assert toonset("mesh", run, "-o", tmp_path / "body.glb", "--faces", 500).code == 0
    ts.surface_of(field, 500).save(tmp_path / "mine.glb")
    assert (tmp_path / "mine.glb").read_bytes() == (tmp_path / "body.glb").read_bytes()

    line = ("mesh", run, "-o", tmp_path / "drawn.glb", "--faces", 500, "--texture")
    assert toonset(*line).code == 0
    texture_surface(field, 500).save(tmp_path / "painted.glb")
    assert (tmp_path / "painted.glb").read_bytes() == (tmp_path / "drawn.glb").read_bytes()


@pytest.fixture
def small_scene(bundle: Path) -> Path:
    """Return held-out views of the bundle's size: here, two of its own."""
    cameras = json.loads((bundle / "transforms.json").read_text())
    cameras["frames"] = cameras["frames"][:2]
    (bundle / "transforms.json").write_text(json.dumps(cameras))
    return bundle


@pytest.fixture
def host() -> Iterator[dict[str, Any]]:
    """Check after a test that torch, BLAS, OpenCV, signals and warnings are set as before."""

    def state() -> dict[str, Any]:
        return {
            "torch threads": torch.get_num_threads(),
            "torch random": torch.get_rng_state().tolist(),
            "numpy random": str(np.random.get_state()),  # noqa: NPY002
            "random": random.getstate(),
            "opencv threads": cv2.getNumThreads(),
            "signals": [signal.getsignal(sign) for sign in (signal.SIGINT, signal.SIGTERM)],
            "blas": {i["filepath"]: i["num_threads"] for i in threadpool_info()},
            "filters": list(warnings.filters),
            "environment": {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"},
        }

    import scipy.linalg  # noqa: F401  # a BLAS of its own

    with threadpool_limits(2, user_api="blas"):  # all other tests run with one
        before = state()
        assert 2 in before["blas"].values()
        yield before
        assert state() == before


def test_calls_leave_the_host_as_it_was(found, drawn, bundle, host, tmp_path):
    sheet = ts.split_sheet(drawn / "single.png")
    ts.calibrate(sheet.views, ts.load_mesh(drawn / "mannequin.obj"))
    run = ts.train(ts.read_bundle(bundle).scene, ts.TrainOptions(steps=2, device="cpu"), threads=3)
    run.save(tmp_path / "run")
    ts.render(run.field, ts.turntable(run.field, 1)[0])
    ts.extract_palette(sheet.views)
    ts.surface_of(run.field, 500)
    ts.evaluate(run.field, ts.read_bundle(bundle).scene)


def test_a_field_that_changes_is_rendered_anew(run: Path) -> None:
    field = ts.read_run(run)
    camera = ts.turntable(field, 1)[0]
    before = ts.render(field, camera).rgb
    with torch.no_grad():
        for values in field.field.parameters():
            values.mul_(0.5)
    assert not np.allclose(ts.render(field, camera).rgb, before)


def test_the_same_bytes_with_blas_on_two_threads(found, drawn, tmp_path):
    code = (
        "import sys, toonset as ts\n"
        "folder, out = sys.argv[1:]\n"
        "sheet = ts.split_sheet(folder + '/sheet.png')\n"
        "found = ts.calibrate(sheet.views, ts.load_mesh(folder + '/mannequin.obj'))\n"
        "ts.write_bundle(out, found, ts.extract_palette(found.drawings))\n"
    )
    free = os.environ | {"OPENBLAS_NUM_THREADS": "2"}
    command = [sys.executable, "-c", code, str(drawn), str(tmp_path / "two")]
    subprocess.run(command, check=True, env=free, timeout=300)
    ts.write_bundle(tmp_path / "one", found, ts.extract_palette(found.drawings))
    assert_same_files(tmp_path / "one", tmp_path / "two")


MISTAKES = [
    (lambda d: ts.split_sheet(d / "none.png"), ("split", "none.png")),
    (
        lambda d: ts.split_sheet(d / "sheet.png", ts.SheetOptions(grid="x")),
        ("split", "sheet.png", "--grid", "x"),
    ),
    (
        lambda d: ts.split_sheet(d / "sheet.png", ts.SheetOptions(drop="9")),
        ("split", "sheet.png", "--drop", "9"),
    ),
    (
        lambda d: ts.split_sheet(d / "sheet.png", ts.SheetOptions(labels="front,up")),
        ("split", "sheet.png", "--views", "front,up"),
    ),
    (
        lambda d: ts.calibrate(
            ts.split_sheet(d / "sheet.png").views, hints=ts.Hints(lock=("yaw",))
        ),
        ("calibrate", "sheet.png", "--lock", "yaw"),
    ),
    (
        lambda d: ts.extract_palette([], ts.PaletteOptions(min_share=7)),
        ("palette", "sheet.png", "--min-share", "7"),
    ),
    (lambda d: ts.read_bundle(d), ("train", ".")),
    (lambda d: ts.read_run(d), ("render", ".", "--turntable", "1")),
]


@pytest.mark.parametrize(("call", "command"), MISTAKES)
def test_a_mistake_is_one_error_with_the_commands_line(call, command, drawn, toonset, monkeypatch):
    monkeypatch.chdir(drawn)
    with pytest.raises(ts.ToonsetError) as error:
        call(Path())
    assert str(error.value) == toonset(*command, "-o", "elsewhere", "--quiet").reason


A_HAT: Any = "hat"  # no lock


def test_arguments_that_contradict_each_other(drawn: Path, toonset: Any) -> None:
    with pytest.raises(ts.ToonsetError) as error:
        ts.split_sheet(drawn / "sheet.png", ts.SheetOptions(boxes="b.json", grid="5x1"))
    said = toonset("split", drawn / "sheet.png", "--boxes", "b.json", "--grid", "5x1").reason
    assert str(error.value) in said
    assert "see `toonset split -h`" in said
    with pytest.raises(ts.ToonsetError, match="'hat' is none of yaw, elevation"):
        ts.Hints(lock=(A_HAT,)).check()


def without_pen(field: Any) -> Any:
    return replace(field, drawings=replace(field.drawings, pen=None))


A_NAME: Any = "sheet.png"  # of another type than is asked for
NO_MEANING = [
    (lambda s, f: ts.split_sheet([]), "no sheet"),
    (lambda s, f: ts.calibrate([]), "no view"),
    (lambda s, f: ts.calibrate([*s.views, *s.views]), "two views are called 000.png"),
    (lambda s, f: ts.extract_palette(A_NAME), "a drawing is <U1"),
    (lambda s, f: ts.extract_palette([s.views[0].rgba[..., :3]]), "RGBA bytes"),
    (
        lambda s, f: ts.label_image(s.views[0], f.palette, space=A_NAME),
        "'sheet.png' is none of rgb",
    ),
    (lambda s, f: ts.turntable(f, 0), "0 views"),
    (lambda s, f: ts.surface_of(f, -5), "faces: -5; 100 or more"),
    (lambda s, f: texture_surface(f, -5), "faces: -5; 100 or more"),
    (
        lambda s, f: texture_surface(replace(f, drawings=None)),
        "holds no drawings to paint the mesh with; train again",
    ),
    (lambda s, f: texture_surface(without_pen(f), outline=True), "no outline; leave --outline out"),
    (lambda s, f: ts.render(f, ts.turntable(f, 1)[0]).picture("ink"), "no contour lines"),
]
NO_OPTIONS = [
    ({"steps": 0}, "steps: 0 is out of range; give 1 to 10000000"),
    ({"steps": True}, "steps: True is out of range; give 1 to 10000000"),
    ({"seed": -1}, "seed: -1"),
    ({"seed": 2**70}, "seed: "),
    ({"budget_s": float("nan")}, "budget_s: nan"),
    ({"resolution": 0}, "resolution: 0"),
    ({"field": "bogus"}, "field: 'bogus' is none of auto, triplane"),
    ({"steps": 10**30}, "give 1 to 10000000"),
    ({"steps": 1.5}, "steps: 1.5 is out of range"),
    ({"fairing": "no"}, "fairing: 'no' is neither True nor False"),
    ({"device": "tpu"}, "device: 'tpu' is none of auto, cpu, cuda"),
]


@pytest.mark.parametrize(("call", "words"), NO_MEANING)
def test_calls_that_mean_nothing_are_refused(call: Any, words: str, drawn: Path, run: Path) -> None:
    with pytest.raises(ts.ToonsetError, match=words):
        call(ts.split_sheet(drawn / "sheet.png"), ts.read_run(run))


@pytest.mark.parametrize(("options", "words"), NO_OPTIONS)
def test_options_out_of_range_are_refused(options, words, bundle):
    with pytest.raises(ts.ToonsetError, match=words):
        ts.train(ts.read_bundle(bundle).scene, ts.TrainOptions(**options))
    with pytest.raises(ts.ToonsetError, match="threads: 0"):
        ts.train(ts.read_bundle(bundle).scene, threads=0)


def test_force_replaces_nothing_but_earlier_results(found, bundle, tmp_path, monkeypatch):
    kept = tmp_path / "mine" / "notes.txt"
    kept.parent.mkdir()
    kept.write_text("mine")
    scene, options = ts.read_bundle(bundle).scene, ts.TrainOptions(steps=1, device="cpu")
    run = ts.train(scene, options, looking=MonitorOptions(folder=kept.parent))
    with pytest.raises(ts.ToonsetError, match="holds 'notes"):
        ts.write_bundle(kept.parent, found, force=True)
    with pytest.raises(ts.ToonsetError, match="holds 'notes"):
        run.save(kept.parent, force=True)
    monkeypatch.chdir(ts.write_bundle(tmp_path / "made", found).folder)
    with pytest.raises(ts.ToonsetError, match="the current folder"):
        ts.write_bundle(".", found, force=True)
    assert kept.read_text() == "mine"
    ts.write_bundle(tmp_path / "again", found)
    ts.write_bundle(tmp_path / "again", found, force=True)
