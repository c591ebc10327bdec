"""What many tests share: the command line as a function, a drawn sheet, a bundle and a run."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from threadpoolctl import threadpool_limits

from lab.contents import contents

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

# Sums depend in their last digits on how many threads share them. A process of its own has one
# (`main` sees to it); here plugins have imported numpy before anything could be set.
os.environ["OPENBLAS_NUM_THREADS"] = "1"  # of libraries that are loaded from now on, as scipy's
threadpool_limits(1, user_api="blas")  # of those that are loaded already
# As `main` does, too: torch's waiting threads spin, which on busy cores costs ten times the work.
os.environ["OMP_WAIT_POLICY"] = "PASSIVE"

VIEWS, CELL, SEED = 5, 120, 11
MAINS = {"toonset": "toonset.cli.main", "bench": "lab.bench.__main__"}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with whole commands, which take longest, so that all workers end together."""
    items.sort(key=lambda item: len(item.path.parts))


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep the tests' cached template banks out of the user's folder."""
    os.environ["TOONSET_CACHE"] = str(tmp_path_factory.mktemp("cache"))


@dataclass(frozen=True)
class Outcome:
    """How a command ended: exit code and what it printed."""

    code: int
    out: str
    err: str
    program: str = "toonset"

    @property
    def json(self) -> Any:
        """Return stdout as one JSON object; anything besides it fails."""
        return json.loads(self.out)

    @property
    def reason(self) -> str:
        """Return the one line of a refusal."""
        assert self.code == 2, self
        assert self.out == "", self
        program, _, reason = self.err.partition(": ")
        assert program == self.program, self
        assert self.err.count("\n") == 1, self
        assert self.err.endswith("\n"), self
        assert self.err[:-1].isprintable(), self
        return reason.strip()


Command = Callable[..., Outcome]


def run_here(*arguments: object, program: str = "toonset") -> Outcome:
    """Run a program's main function in this process: no second import of heavy libraries."""
    main = importlib.import_module(MAINS[program]).main
    out, err, code, before = io.StringIO(), io.StringIO(), 0, sys.argv
    sys.argv = [program, *map(str, arguments)]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    finally:
        sys.argv = before
    return Outcome(code, out.getvalue(), err.getvalue(), program)


def run_shell(*arguments: object, **options: Any) -> Outcome:
    """Run `python -m toonset` as a process of its own, as a user does."""
    command = [sys.executable, "-m", "toonset", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, **options)
    return Outcome(done.returncode, done.stdout, done.stderr)


def run_and_interrupt(sign: str, folder: Path, *arguments: object) -> Outcome:
    """Run in a folder as a process of its own; press Ctrl-C when a line on stderr holds `sign`."""
    command = [sys.executable, "-m", "toonset", *map(str, arguments)]
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # a shell's background jobs, these tests perhaps, ignore Ctrl-C and hand that down
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(command, cwd=folder, preexec_fn=heard, **pipes) as process:
        assert process.stderr is not None
        assert any(sign in line for line in process.stderr)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=120)
    return Outcome(process.returncode, out, err)


@pytest.fixture(scope="session")
def toonset() -> Command:
    """Return the command line, run in this process."""
    return run_here


@pytest.fixture(scope="session")
def bench() -> Command:
    """Return the bench's command line, run in this process."""
    return partial(run_here, program="bench")


@pytest.fixture(scope="session")
def shell() -> Command:
    """Return the command line, run as a process."""
    return run_shell


@pytest.fixture(scope="session")
def interrupted() -> Command:
    """Return the command line, run as a process that hears Ctrl-C."""
    return run_and_interrupt


@pytest.fixture(scope="session")
def snapshot() -> Callable[[Path], dict[str, str]]:
    """Return what tells whether anything below a folder has changed."""
    return contents


@pytest.fixture(scope="session")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a drawn sheet.png, its first figure single.png, and mannequin.obj."""
    from lab.bench.cases.bodies import random_body
    from toonset.dataset.images.picture import encode_png
    from toonset.dataset.mesh.load import save_obj
    from toonset.dataset.synthetic.options import SynthOptions
    from toonset.dataset.synthetic.turnaround import make_turnaround

    folder = tmp_path_factory.mktemp("drawn")
    options = SynthOptions(views=VIEWS, cell_px=CELL, outline_px=0, elevation_deg=8)
    turnaround = make_turnaround(random_body(SEED), options, SEED)
    (folder / "sheet.png").write_bytes(encode_png(turnaround.sheet))
    (folder / "single.png").write_bytes(encode_png(turnaround.sheet[:, :CELL].copy()))
    (folder / "mannequin.obj").write_bytes(save_obj(turnaround.mesh))
    return folder


@pytest.fixture(scope="session")
def calibrated(drawn: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome]:
    """Return a calibrated bundle and what `toonset calibrate --json --quiet` said."""
    bundle = tmp_path_factory.mktemp("calibrated") / "bundle"
    mesh = drawn / "mannequin.obj"
    arguments = ("calibrate", drawn / "sheet.png", "--mesh", mesh, "-o", bundle)
    return bundle, run_here(*arguments, "--json", "--quiet")


@pytest.fixture
def bundle(calibrated: tuple[Path, Outcome], tmp_path: Path) -> Path:
    """Return an own copy of the calibrated bundle, in another folder than it was written to."""
    return Path(shutil.copytree(calibrated[0], tmp_path / "bundle"))


@pytest.fixture(scope="session")
def trained(
    calibrated: tuple[Path, Outcome], tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Outcome]:
    """Return a run of 20 steps, and what `toonset train --json` said."""
    run = tmp_path_factory.mktemp("trained") / "run"
    few = ("--steps", 20, "--threads", 1, "--device", "cpu")
    return run, run_here("train", calibrated[0], "-o", run, *few, "--json")


@pytest.fixture
def run(trained: tuple[Path, Outcome], tmp_path: Path) -> Path:
    """Return an own copy of the trained run."""
    return Path(shutil.copytree(trained[0], tmp_path / "run"))


@pytest.fixture(scope="session")
def small_bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a whole bundle of three tiny views, with palette, labels and contours; read only."""
    import numpy as np
    from PIL import Image

    from toonset.camera import Camera
    from toonset.dataset.bundle.bundle import bundle_folder
    from toonset.dataset.images.picture import encode_indexed_png
    from toonset.dataset.mesh.load import load_mesh
    from toonset.palette.formats.gpl import to_gpl
    from toonset.palette.formats.json import to_json
    from toonset.palette.palette import Palette, PaletteColor
    from toonset.view import View
    from toonset.write import write_bytes, write_json

    folder = tmp_path_factory.mktemp("small") / "bundle"
    obj = folder.parent / "body.obj"
    obj.write_text("v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n")
    cameras = [
        Camera.looking_at(np.array([0.2, 1.0, 0.1]), yaw, 0.1, 9.0, (20, 24), k=k)
        for yaw, k in ((0.0, 0.0), (1.5, 0.0), (3.0, 0.1))
    ]
    labels = np.full((24, 20), 255, np.uint8)
    labels[4:12, 5:15], labels[12:20, 5:15] = 0, 1
    colors = np.array([[200, 30, 20], [20, 60, 200]], np.uint8)
    rgba = np.zeros((24, 20, 4), np.uint8)
    rgba[4:20, 5:15, :3] = colors[labels[4:20, 5:15]]
    rgba[4:20, 5:15, 3] = 255
    views = [View(rgba, (20 * i, 0, 20, 24), 1.5, f"{i:03d}.png") for i in range(3)]
    report = calibration_report([view.name for view in views], cameras)
    mesh = load_mesh(obj)
    size = (mesh.height, mesh.radius)
    with bundle_folder(folder, views, cameras, mesh, size, report, rgba[..., :3]):
        pass
    named = [PaletteColor((200, 30, 20), 0.5, "red"), PaletteColor((20, 60, 200), 0.5, "blue")]
    palette = Palette(tuple(named), "by hand")
    write_json(folder / "palette.json", to_json(palette))
    write_bytes(folder / "palette.gpl", to_gpl(palette).encode())
    (folder / "contours").mkdir()
    for view in views:
        write_bytes(folder / "labels" / view.name, encode_indexed_png(labels, colors))
        Image.fromarray(labels).save(folder / "contours" / view.name)
    return folder


def calibration_report(names: list[str], cameras: list[Any]) -> dict[str, Any]:
    """Return what `toonset.calib.verdict.report` would say of these cameras."""
    import math

    from toonset.dataset.bundle.calibration_schema import SCHEMA, VERSION

    def plain(camera: Any) -> dict[str, Any]:
        angles = zip(("yaw_deg", "elevation_deg", "roll_deg"), camera.angles, strict=True)
        return {
            "model": "orthographic" if camera.is_orthographic else "pinhole",
            **{name: math.degrees(angle) for name, angle in angles},
            "camera_from_world_rotation": camera.rotation.tolist(),
            "target": camera.target.tolist(),
            "scale_px_per_unit": camera.scale,
            "center_px": camera.center.tolist(),
            "k": camera.k,
            "size_wh": list(camera.size_wh),
        }

    spreads = ("yaw_deg", "elevation_deg", "roll_deg", "scale_relative", "shift_px")
    views = [
        {
            "name": name,
            "verdict": "ok",
            "reason": "",
            "camera": plain(camera),
            "sigma": dict.fromkeys(spreads, 0.5),
            "covariance": [[float(i == j) for j in range(6)] for i in range(6)],
            "covariance_of": "rotation, shift, log scale",
            "p_flip": 0.01,
            "twin": plain(camera.twin()),
            "alternatives": [{"probability": 0.1, "camera": plain(camera)}],
            "outline_error_of_height": 0.01,
            "outline_coverage": 0.98,
        }
        for name, camera in zip(names, cameras, strict=True)
    ]
    return {
        "schema": f"{SCHEMA}/{VERSION}",
        "verdict": "ok",
        "reason": "",
        "camera_model": {
            "chosen": "orthographic",
            "distance_heights": [None, None, 4.0],
            "tried": [{"model": "perspective", "bic_gain": -3.0, "margin": 6.0, "unknowns": 1}],
            "effective_samples": 100.0,
        },
        "outline_offset_of_height": 0.001,
        "drawing_error_of_height": {"smooth": 0.002, "white": 0.001},
        "drawings_contradiction_of_height": 0.0,
        "views": views,
        "seconds": {"search": 1.5},
        "options": {"rounds": 3},
        "seed": 0,
        "versions": {"toonset": "0.1.0"},
        "inputs": [{"name": "sheet.png", "sha256": "0" * 64, "role": "sheet"}],
    }


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Yield a browser; only one can be driven at a time."""
    from lab.bench.view.compare import chromium

    with chromium() as browser:
        yield browser


@pytest.fixture(scope="session")
def barriers() -> Callable[[Page], list[str]]:
    """Return a function that lists what axe-core finds wrong in an open page."""
    from axe_playwright_python.sync_playwright import Axe

    # off as they come: the first is of WCAG 2.2, the second is being tried out
    off_by_default = ("target-size", "label-content-name-mismatch")
    rules = {name: {"enabled": True} for name in off_by_default}
    options = {"resultTypes": ["violations"], "rules": rules}

    def found(page: Page) -> list[str]:
        broken = Axe().run(page, options=options).response["violations"]
        return [f"{rule['id']}: {node['html'][:200]}" for rule in broken for node in rule["nodes"]]

    return found
