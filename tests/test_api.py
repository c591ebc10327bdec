"""The public interface: what it names, that it costs nothing to import, and the commands' bytes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import toonset as ts
from toonset.nerf.kernels.threads import working_threads

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
    text = Path(ts.__file__).read_text(encoding="utf-8")
    block = text[text.index("if TYPE_CHECKING:") : text.index("_PLACES = ")]
    for name in set(dir(ts)) - {"__version__"}:
        assert f" as {name}\n" in block or f"{name}, " in block or f" {name} = " in block, name


@pytest.mark.parametrize("line", ["import toonset", "import toonset; toonset.__version__"])
def test_the_import_is_light(line: str) -> None:
    code = f"import sys; {line}; print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# ---- the same bytes as the commands


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
def found(drawn: Path) -> ts.Calibration:
    sheet = ts.split_sheet(drawn / "sheet.png")
    return ts.calibrate(sheet.views, ts.load_mesh(drawn / "mannequin.obj"))


@pytest.fixture
def written(found: ts.Calibration, tmp_path: Path) -> ts.Bundle:
    return ts.write_bundle(tmp_path / "mine", found, ts.extract_palette(found.drawings))


def test_calibrate_writes_what_the_command_writes(
    found: ts.Calibration, bundle: Path, tmp_path: Path
) -> None:
    ts.write_bundle(tmp_path / "mine", found)
    assert_same_files(bundle, tmp_path / "mine")


def test_palette_writes_what_the_command_writes(
    written: ts.Bundle, bundle: Path, toonset: Any
) -> None:
    assert toonset("palette", bundle).code == 0
    assert_same_files(bundle, written.folder)
    assert written.palette is not None
    for frame in written.scene.frames:
        np.testing.assert_array_equal(frame.labels, ts.label_image(frame.rgba, written.palette))


def test_hints_and_cuts_reach_the_bundle_as_from_the_command(
    drawn: Path, toonset: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    labels = "front,?,?,288"
    cut = ("--drop", "1", "--background", "#ffffff", "--views", labels)
    assert toonset("calibrate", drawn / "sheet.png", *cut).code in (0, 3)
    sheet = ts.split_sheet(drawn / "sheet.png", drop="1", background="#ffffff")
    ts.write_bundle("mine", ts.calibrate(sheet.views, hints=ts.Hints(labels=labels)))
    assert_same_files(tmp_path / "bundle", tmp_path / "mine")


def test_labels_of_a_split_folder_are_known_without_saying_them_again(
    drawn: Path, toonset: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    toonset("split", drawn / "sheet.png", "--views", "front,72,144,216,288")
    mesh = drawn / "mannequin.obj"
    assert toonset("calibrate", "views", "--mesh", mesh).code in (0, 3)
    sheet = ts.split_sheet("views")
    ts.write_bundle("mine", ts.calibrate(sheet.views, ts.load_mesh(mesh)))
    assert_same_files(tmp_path / "bundle", tmp_path / "mine")
    options = json.loads((tmp_path / "mine/calibration.json").read_text())["options"]
    assert options["views"] == "front,72,144,216,288"


def test_train_and_render_write_what_the_commands_write(
    written: ts.Bundle, toonset: Any, tmp_path: Path
) -> None:
    few = ("--steps", FEW["steps"], "--device", "cpu", "--threads", 2)
    assert toonset("train", written.folder, "-o", tmp_path / "run", *few).code in (0, 3)
    run = ts.train(written.scene, ts.TrainOptions(**FEW), threads=2)
    run.save(tmp_path / "mine-run")
    timed = ("history.csv", "manifest.json")  # seconds, and hashes of files with seconds
    assert_same_files(tmp_path / "run", tmp_path / "mine-run", apart=timed)

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


def test_evaluate_and_surface_give_what_the_commands_write(
    run: Path, small_scene: Path, toonset: Any, tmp_path: Path
) -> None:
    test, field = ts.read_bundle(small_scene).scene, ts.read_run(run)
    out = tmp_path / "judged"
    assert toonset("evaluate", run, "--test", small_scene, "-o", out, "--quiet").code == 0
    mine, theirs = ts.evaluate(field, test), json.loads((out / "evaluation.json").read_text())
    assert mine["rgb"] == theirs["rgb"]
    assert mine["views"] == theirs["views"]

    assert toonset("mesh", run, "-o", tmp_path / "body.glb", "--faces", 500).code == 0
    ts.surface_of(field, 500).save(tmp_path / "mine.glb")
    assert (tmp_path / "mine.glb").read_bytes() == (tmp_path / "body.glb").read_bytes()


@pytest.fixture
def small_scene(bundle: Path) -> Path:
    """Return held-out views of the bundle's size: here, two of its own."""
    cameras = json.loads((bundle / "transforms.json").read_text())
    cameras["frames"] = cameras["frames"][:2]
    (bundle / "transforms.json").write_text(json.dumps(cameras))
    return bundle


# ---- a library leaves its host as it found it


@pytest.fixture
def host() -> Iterator[dict[str, Any]]:
    """Check after a test that torch, BLAS and warnings are set as before."""
    from threadpoolctl import threadpool_info

    def state() -> dict[str, Any]:
        return {
            "torch threads": torch.get_num_threads(),
            "torch random": torch.get_rng_state().tolist(),
            "blas": [(i["filepath"], i["num_threads"]) for i in threadpool_info()],
            "filters": list(warnings.filters),
            "environment": {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"},
        }

    before = state()
    yield before
    assert state() == before


def test_calls_leave_the_host_as_it_was(
    found: ts.Calibration, drawn: Path, bundle: Path, host: dict[str, Any], tmp_path: Path
) -> None:
    sheet = ts.split_sheet(drawn / "single.png")
    ts.calibrate(sheet.views, ts.load_mesh(drawn / "mannequin.obj"))
    run = ts.train(ts.read_bundle(bundle).scene, ts.TrainOptions(steps=2, device="cpu"), threads=3)
    run.save(tmp_path / "run")
    ts.render(run.field, ts.turntable(run.field, 1)[0])


def test_threads_are_those_of_the_block_alone() -> None:
    before = torch.get_num_threads()
    with working_threads(4) as count:
        assert count == 4
        assert torch.get_num_threads() == 2  # two sides of two
    assert torch.get_num_threads() == before


# ---- mistakes are one ToonsetError with the commands' words

MISTAKES = [
    (lambda d: ts.split_sheet(d / "none.png"), ("split", "none.png")),
    (lambda d: ts.split_sheet(d / "sheet.png", grid="x"), ("split", "sheet.png", "--grid", "x")),
    (lambda d: ts.split_sheet(d / "sheet.png", drop="9"), ("split", "sheet.png", "--drop", "9")),
    (
        lambda d: ts.split_sheet(d / "sheet.png", labels="front,up"),
        ("split", "sheet.png", "--views", "front,up"),
    ),
    (
        lambda d: ts.calibrate(
            ts.split_sheet(d / "sheet.png").views, hints=ts.Hints(lock=("yaw",))
        ),
        ("calibrate", "sheet.png", "--lock", "yaw"),
    ),
    (
        lambda d: ts.extract_palette([ts.load_picture(d / "sheet.png")], min_share=7),
        ("palette", "sheet.png", "--min-share", "7"),
    ),
    (lambda d: ts.read_bundle(d), ("train", ".")),
    (lambda d: ts.read_run(d), ("render", ".", "--turntable", "1")),
]


@pytest.mark.parametrize(("call", "command"), MISTAKES)
def test_a_mistake_is_one_error_with_the_commands_line(
    call: Any, command: tuple[str, ...], drawn: Path, toonset: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(drawn)
    with pytest.raises(ts.ToonsetError) as error:
        call(Path())
    assert str(error.value) == toonset(*command, "-o", "elsewhere", "--quiet").reason


def test_arguments_that_contradict_each_other(drawn: Path, toonset: Any) -> None:
    with pytest.raises(ts.ToonsetError) as error:
        ts.split_sheet(drawn / "sheet.png", boxes="b.json", grid="5x1")
    said = toonset("split", drawn / "sheet.png", "--boxes", "b.json", "--grid", "5x1").reason
    assert str(error.value) in said
    assert "see `toonset split -h`" in said
    with pytest.raises(ts.ToonsetError, match="'hat' is none of yaw, elevation"):
        ts.Hints(lock=("hat",)).check()


# ---- kornia's geometry


def cameras() -> list[ts.Camera]:
    return [
        ts.Camera.looking_at(np.array([0.1, 0.5, 0.0]), yaw, 0.2, 120.0, (160, 180), k=k)
        for yaw, k in ((0.3, 0.0), (2.0, 0.2), (-1.0, 1e-6))
    ]


@pytest.mark.parametrize("device", ["cpu", *(["cuda"] if torch.cuda.is_available() else [])])
def test_project_is_the_camera_model_batched_on_every_device(device: str) -> None:
    points = np.random.default_rng(0).uniform(-0.8, 0.8, (40, 3))
    pixels = ts.project(cameras(), torch.from_numpy(points)[None].to(device))
    assert pixels.device.type == device
    for found_pixels, camera in zip(pixels.cpu(), cameras(), strict=True):
        np.testing.assert_allclose(found_pixels, camera.project(points)[0], atol=1e-9)


def test_project_is_differentiable_in_cameras_and_points() -> None:
    from toonset.projection import CameraTensors

    held = CameraTensors.of(cameras())
    points = torch.rand(1, 5, 3, dtype=torch.float64, requires_grad=True)

    def pixels(*parts: torch.Tensor) -> torch.Tensor:
        return ts.project(CameraTensors(held.rotation, *parts[:-1]), parts[-1])

    parts = [held.target, held.center, held.scale_uv, held.k]
    free = [part.clone().requires_grad_() for part in parts]
    assert torch.autograd.gradcheck(pixels, (*free, points), atol=1e-5)


def test_project_has_no_pixel_behind_a_pinhole() -> None:
    camera = cameras()[1]
    behind = camera.target - 8 * camera.rotation[2]
    assert torch.isnan(ts.project([camera], torch.from_numpy(behind)[None, None])).all()
