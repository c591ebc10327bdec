"""Commands run as they stand: those of the documents, in their order, and those that verbs print.

So does the Python of the documents.

A document has a folder of its own with the drawings that it speaks of, and nothing else: its
commands must not stand in each other's way. Exit code 3 is fine: written, but look.
"""

import importlib
import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import typer
from typer.testing import CliRunner

from lab.bench.batch.sheets import write_sheets
from lab.bench.cases.bodies import random_body
from lab.bench.messy.sheet import make_messy_sheet
from tests.conftest import calibration_report
from tests.lab.bench.stand_ins import measure_nothing
from tests.test_documents import DOCUMENTS, text_of
from toonset.camera import Camera
from toonset.cli.common.verbs import VERBS
from toonset.dataset.bundle.bundle import bundle_folder
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.transforms_read import read_cameras
from toonset.dataset.images.picture import encode_png, load_rgba
from toonset.dataset.mannequin.landmark_formats import SCHEMA
from toonset.dataset.mesh.load import load_mesh, save_obj
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.mesh import Z_UP

ROOT = Path(__file__).resolve().parents[1]
PLACEHOLDER = re.compile(r"\.\.\.|(?<![\w#-])[A-Z]{3,}(?![\w-])")  # of a command's form, not of one
ELSEWHERE = {  # commands that do not run here, and where they do
    "./run demo": "tests/test_run.py has its steps, the README the same commands",
    "./run test": "would run this test",
    "./run lint": "every change runs it: .ci/run",
    "./run docs": "every change runs it: .ci/run",
    "./run wheel": "every change runs it: .ci/run",
    "./run bench": "minutes to hours: `test_benches_run_as_they_stand` measures next to nothing",
    "python -m lab.bench": "as ./run bench",
    "pip install": "needs a package index",
    "uv pip": "needs a package index",
    "printf": "as uv pip",
}
SLOW = ("README.md", "docs/guide_training.md")  # they train for minutes

Toonset = Callable[..., Any]


def commands(document: str) -> list[str]:
    """Return the commands of a document, each once: lines of its blocks, and those within text.

    Within text "`toonset VERB`" alone is the verb's name, but for verbs that need no more.
    """
    found = []
    for block, words in re.findall(
        r"^```sh\n(.*?)^```|`((?:toonset|\./run|python -m|pip|uv) [^`]+)`",
        text_of(document),
        re.MULTILINE | re.DOTALL,
    ):
        lines = block.replace("\\\n", " ").splitlines() or [" ".join(words.split())]
        plain = [shlex.join(shlex.split(line, comments=True)) for line in lines]
        found += [line for line in plain if line and (block or len(line.split()) > 2)]
    return list(dict.fromkeys(found))


def arguments(command: str) -> list[str] | None:
    """Return what follows `toonset` or `./run` in a command of toonset's; None of another's."""
    words = shlex.split(command)
    return words[1:] if words[0] in {"toonset", "./run"} else None


def is_form(command: str) -> bool:
    """Return whether a command says where one must put something in."""
    return bool(PLACEHOLDER.search(command))


def runs_here(command: str) -> bool:
    return not is_form(command) and not any(command.startswith(words) for words in ELSEWHERE)


@pytest.fixture(scope="module")
def drawings(drawn: Path, tmp_path_factory: pytest.TempPathFactory, toonset: Toonset) -> Path:
    """Return a folder with every file that the documents speak of, the README's example first."""
    folder = tmp_path_factory.mktemp("drawings")
    shutil.copytree(ROOT / "examples", folder / "examples")
    for name in ("sheet.png", "mannequin.obj"):
        shutil.copy(folder / "examples" / name, folder / name)
    shutil.copy(folder / "sheet.png", folder / "strip.png")
    truth = json.loads((folder / "examples" / "truth.json").read_text())["views"]
    placed = [(NativeCamera(**told["camera"]).camera(), told["cell_box"]) for told in truth]
    _bundle(folder / "bundle", placed)
    _eight_small(folder / "eight")
    for name in ("other", "held_out"):
        shutil.copytree(folder / "bundle", folder / name)
    for to in ("nerfstudio", "colmap"):
        place = folder / {"nerfstudio": "folder", "colmap": "colmap_folder"}[to]
        assert toonset("export", folder / "bundle", "--to", to, "-o", place, "-q").code == 0
    assert toonset("palette", folder / "bundle", "-q").code == 0
    for name in ("dark.ase", "my.ase"):
        shutil.copy(folder / "bundle" / "palette.ase", folder / name)
    (folder / "outfits.png").write_bytes(encode_png(make_messy_sheet(6211, ("outfits",)).rgba))
    write_sheets(folder / "library", 2)

    shutil.copytree(drawn, folder / "small")
    shutil.copy(drawn / "mannequin.obj", folder / "small" / "m.obj")
    box = split_picture(load_rgba(drawn / "sheet.png")).views[0].figure_box
    front = {"version": 1, "views": [{"box": box, "label": "front"}]}
    (folder / "small" / "corrections.json").write_text(json.dumps(front))
    trimesh.creation.capsule(0.5, 1.0).export(folder / "mesh.glb")
    return folder


def _bundle(bundle: Path, placed: list[tuple[Camera, Sequence[int]]]) -> None:
    """Write the bundle of the sheet beside it with the cameras of cells that it was drawn with."""
    sheet, body = bundle.with_name("sheet.png"), bundle.with_name("mannequin.obj")
    views = split_picture(load_rgba(sheet)).views
    cameras = [
        camera.moved((view.box[0] - cell[0], view.box[1] - cell[1]), view.box[2:])
        for view, (camera, cell) in zip(views, placed, strict=True)
    ]
    report = calibration_report([view.name for view in views], cameras)
    report["inputs"] = [
        {"name": file.name, "sha256": sha256(file.read_bytes()).hexdigest(), "role": role}
        for file, role in ((sheet, "sheet"), (body, "mesh"))
    ]
    mesh = load_mesh(body)
    size, overlay = (mesh.height, mesh.radius), views[0].rgba[..., :3]
    with bundle_folder(bundle, views, cameras, mesh, size, report, overlay):
        pass


def _eight_small(folder: Path) -> None:
    """Write a sheet of eight small views, its bundle, and points where its cameras see them."""
    options = SynthOptions(views=8, cell_px=120, outline_px=0, elevation_deg=8)
    made = make_turnaround(random_body(11), options, 11)
    folder.mkdir()
    (folder / "sheet.png").write_bytes(encode_png(made.sheet))
    for name in ("mannequin.obj", "m.obj"):
        (folder / name).write_bytes(save_obj(made.mesh))
    trimesh.Trimesh(made.mesh.vertices @ Z_UP, made.mesh.faces).export(folder / "lying.stl")
    boxes = [view.box for view in made.views]
    _bundle(folder / "other", list(zip(made.cameras, boxes, strict=True)))
    vertices = load_mesh(folder / "m.obj").vertices
    points = vertices[np.linspace(0, len(vertices) - 1, 9).astype(int)]
    names = [f"p{number}" for number in range(len(points))]
    views = {
        str(number): dict(zip(names, camera.project(points)[0].tolist(), strict=True))
        for number, (_, camera) in enumerate(read_cameras(folder / "other"))
    }
    content = {"schema": SCHEMA, "pixels": "view", "views": views}
    content["points"] = dict(zip(names, points.tolist(), strict=True))
    (folder / "points.json").write_text(json.dumps(content))


GIVEN = {  # what lies in a document's folder before its first command
    "README.md": "examples sheet.png strip.png folder held_out mesh.glb dark.ase library",
    "docs/architecture.md": "small/sheet.png small/m.obj",
    "docs/conventions.md": "bundle",
    "docs/formats.md": "bundle sheet.png views",
    "docs/guide_batch.md": "library",
    "docs/guide_cameras.md": "eight/sheet.png eight/mannequin.obj eight/m.obj eight/points.json"
    " eight/lying.stl eight/other colmap_folder",
    "docs/guide_corrections.md": "small/sheet.png small/mannequin.obj small/corrections.json",
    "docs/guide_palette.md": "bundle sheet.png my.ase",
    "docs/guide_sheets.md": "examples outfits.png",
    "docs/guide_training.md": "bundle held_out other dark.ase",
    "docs/guide_viewer.md": "bundle",
}


@pytest.fixture
def given(
    request: pytest.FixtureRequest,
    drawings: Path,
    toonset: Toonset,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Path:
    """Return a document's folder, as the current one."""
    monkeypatch.chdir(tmp_path)
    for name in GIVEN.get(request.param, "").split():
        if name == "views":
            assert toonset("split", "sheet.png", "-q").code == 0
            continue
        copy = shutil.copytree if (drawings / name).is_dir() else shutil.copy
        copy(drawings / name, tmp_path / Path(name).name)
    return tmp_path


@pytest.mark.parametrize(
    ("document", "given"),
    [
        pytest.param(name, name, marks=pytest.mark.slow if name in SLOW else (), id=name)
        for name in DOCUMENTS
    ],
    indirect=["given"],
)
def test_commands_of_a_document_run_as_they_stand(
    document, given, toonset, interrupted, monkeypatch
):
    monkeypatch.setenv("BROWSER", "true")
    for command in filter(runs_here, commands(document)):
        words = arguments(command)
        assert words is not None, command
        serves = words[0] == "edit"
        done = interrupted("stop with Ctrl-C", given, *words) if serves else toonset(*words)
        assert done.code in (0, 3), (command, done)


def python_blocks(document: str) -> str:
    """Return the Python of a document, its blocks after each other."""
    blocks = re.findall(r"^```python\n(.*?)^```", text_of(document), re.MULTILINE | re.DOTALL)
    return "\n".join(blocks)


@pytest.mark.parametrize(
    ("document", "given"),
    [
        pytest.param(name, name, marks=pytest.mark.slow if name in SLOW else (), id=name)
        for name in DOCUMENTS
        if python_blocks(name)
    ],
    indirect=["given"],
)
def test_python_of_a_document_runs_as_it_stands(document: str, given: Path) -> None:
    (given / "document.py").write_text(python_blocks(document), encoding="utf-8")
    command = [sys.executable, "document.py"]
    done = subprocess.run(command, cwd=given, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


def test_python_is_shown_in_no_other_way() -> None:
    """A block of another spelling (py, indented, tilde) would not be found above."""
    imports = re.compile(r"^\s*import \w+", re.MULTILINE)
    shown = [name for name in DOCUMENTS if imports.search(text_of(name))]
    assert shown == [name for name in DOCUMENTS if python_blocks(name)]


def test_no_command_is_left_out_silently() -> None:
    shown = [command for name in DOCUMENTS for command in commands(name)]
    known = [c for c in shown if not is_form(c) and (w := arguments(c)) and w[0] in VERBS]
    assert len(known) > 60
    others = [c for c in shown if c not in known and runs_here(c)]
    assert others == []


def bench_commands() -> list[str]:
    shown = {c for name in DOCUMENTS for c in commands(name) if not is_form(c)}
    return sorted(c for c in shown if c.startswith(("./run bench", "python -m lab.bench")))


@pytest.mark.parametrize("command", bench_commands())
def test_benches_run_as_they_stand(
    command: str, bench: Toonset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the quick bench of palettes measures; the others' measuring functions are replaced."""
    monkeypatch.chdir(tmp_path)
    module, *words = shlex.split(command.replace("./run", "python -m"))[2:]
    asked = [] if words == ["palette", "--quick"] else measure_nothing(monkeypatch, tmp_path)
    if module == "bench":
        done = bench(*words)
        assert done.code == 0, (command, done)
    else:
        app = typer.Typer()
        app.command()(importlib.import_module(f"{module}.__main__").main)
        assert CliRunner().invoke(app, words).exit_code == 0, command
    subject = {"--check": "check", "--renew": "check"}.get((words or [""])[0], (words or [""])[0])
    assert set(asked) <= {subject if module == "bench" else module.removeprefix("lab.bench.")}
    assert asked or words == ["palette", "--quick"]
    assert subject == "check" or len(list(tmp_path.glob("bench-results/**/*.*"))) > 1


@pytest.mark.slow
def test_what_verbs_say_comes_next_runs_as_printed(drawn, toonset, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(drawn / "sheet.png", "a sheet.png")
    shutil.copy(drawn / "mannequin.obj", "m.obj")
    command = "toonset calibrate 'a sheet.png' --mesh m.obj -o 'the bundle'"
    typed = []
    while command:
        done = toonset(*shlex.split(command)[1:])
        assert done.code == 0, (command, done)
        typed.append(shlex.split(command)[1])
        found = re.search(r"; next: (toonset .*)$", done.err + done.out, re.MULTILINE)
        command = found[1] if found else ""
    assert typed == ["calibrate", "palette", "train", "render"]
    assert (tmp_path / "turntable" / "turntable.gif").is_file()
