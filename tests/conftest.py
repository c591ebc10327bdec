"""What many tests share: the command line as a function, a drawn sheet, a bundle and a run."""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

VIEWS, CELL, SEED = 5, 120, 11


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

    @property
    def json(self) -> Any:
        """Return stdout as one JSON object; anything besides it fails."""
        return json.loads(self.out)

    @property
    def reason(self) -> str:
        """Return the one line of a refusal."""
        assert self.code == 2, self
        assert self.out == "", self
        assert self.err.startswith("toonset: "), self
        assert self.err.count("\n") == 1, self
        assert self.err.endswith("\n"), self
        assert self.err[:-1].isprintable(), self
        return self.err.removeprefix("toonset: ").strip()


Command = Callable[..., Outcome]


def run_here(*arguments: object) -> Outcome:
    """Run the program's main function in this process: no second import of heavy libraries."""
    from toonset.cli.main import main

    out, err, code, before = io.StringIO(), io.StringIO(), 0, sys.argv
    sys.argv = ["toonset", *map(str, arguments)]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    finally:
        sys.argv = before
    return Outcome(code, out.getvalue(), err.getvalue())


def run_shell(*arguments: object, **options: Any) -> Outcome:
    """Run `python -m toonset` as a process of its own, as a user does."""
    command = [sys.executable, "-m", "toonset", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, **options)
    return Outcome(done.returncode, done.stdout, done.stderr)


def contents(folder: Path) -> dict[str, str]:
    """Return every path below a folder with what is there: hash, link target or kind."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = f"link to {os.readlink(path)}"
        elif path.is_file():
            found[name] = sha256(path.read_bytes()).hexdigest()
        else:
            found[name] = "folder" if path.is_dir() else "special"
    return found


@pytest.fixture(scope="session")
def toonset() -> Command:
    """Return the command line, run in this process."""
    return run_here


@pytest.fixture(scope="session")
def shell() -> Command:
    """Return the command line, run as a process."""
    return run_shell


@pytest.fixture(scope="session")
def snapshot() -> Callable[[Path], dict[str, str]]:
    """Return what tells whether anything below a folder has changed."""
    return contents


@pytest.fixture(scope="session")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a drawn sheet.png, its first figure single.png, and mannequin.obj."""
    from toonset.dataset.bodies import random_body
    from toonset.dataset.mesh_file import save_obj
    from toonset.dataset.picture import encode_png
    from toonset.dataset.synth_options import SynthOptions
    from toonset.dataset.synthetic import make_turnaround

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
