"""Notebooks of examples/ run as they stand, without Jupyter and without a display."""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
NOTEBOOKS = sorted(path.name for path in EXAMPLES.glob("*.ipynb"))
LARGEST_BYTES = 300_000
SHOW = '''
def shown(value):
    """Do what a notebook does with the last value of a cell: the first form that it has."""
    for form in ("_repr_html_", "_repr_png_"):
        if hasattr(value, form):
            data = getattr(value, form)()
            assert 100 < len(data) < 1_000_000, (form, len(data))
            print(f"[{form} of {type(value).__name__}]")
            return
    if value is not None:
        print(repr(value))
'''


def cells(name: str) -> list[dict[str, Any]]:
    content = json.loads((EXAMPLES / name).read_text(encoding="utf-8"))
    assert (content["nbformat"], content["metadata"]["kernelspec"]["name"]) == (4, "python3")
    return content["cells"]


def script(name: str) -> str:
    """Return a notebook's code as one script that shows the last value of every cell."""
    parts = [SHOW]
    for cell in cells(name):
        if cell["cell_type"] == "code":
            tree = ast.parse("".join(cell["source"]))
            if isinstance(last := tree.body[-1], ast.Expr):
                function = ast.Name("shown", ast.Load())
                tree.body[-1] = ast.Expr(ast.Call(function, [last.value], []))
            parts.append(ast.unparse(ast.fix_missing_locations(tree)))
    return "\n".join(parts)


@pytest.fixture
def ran(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Return what a notebook printed and showed, run in a copy of its folder."""
    folder = shutil.copytree(EXAMPLES, tmp_path / "examples")
    (folder / "notebook.py").write_text(script(request.param), encoding="utf-8")
    no_display = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "notebook.py"]
    limits: dict[str, Any] = {"capture_output": True, "text": True, "timeout": 1800}
    done = subprocess.run(command, cwd=folder, env=no_display, check=False, **limits)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("ran", ["calibrate.ipynb"], indirect=True)
def test_cameras_are_as_right_as_the_notebook_says(ran: str) -> None:
    assert "[_repr_png_ of View]" in ran
    assert "[_repr_html_ of Bundle]" in ran
    assert ran.count("  ok\n") == 8
    rows = re.findall(r"off by +([+-][\d.]+), sigma ([\d.]+)", ran)
    assert all(abs(float(off)) < 3 * float(sigma) for off, sigma in rows)
    assert float(re.findall(r"worst with the mannequin: ([\d.]+)", ran)[0]) < 5
    assert float(re.findall(r"worst without a body: ([\d.]+)", ran)[0]) < 10
    assert "'K': (3, 3), 'world_from_camera': (4, 4)" in ran


@pytest.mark.parametrize("ran", ["palette.ipynb"], indirect=True)
def test_colours_are_those_that_were_drawn(ran: str) -> None:
    drawn = json.loads((EXAMPLES / "truth.json").read_text())["palette"]
    found = re.findall(r"^(#[0-9a-f]{6}) ", ran, re.MULTILINE)
    assert len(found) >= 8
    assert set(found) <= {*drawn, "#000000"}  # the lines
    assert ran.count("[_repr_png_ of Image]") == 3
    shares = [float(share) for share in re.findall(r"([\d.]+)% of the opaque", ran)]
    assert shares[0] > 60
    counts = [int(count) for count in re.findall(r"%: (\d+) colours", ran)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > counts[-1]


@pytest.mark.slow
@pytest.mark.parametrize("ran", ["few_views.ipynb"], indirect=True)
def test_more_drawings_predict_better_and_mirror_images_take_nothing_off(ran: str) -> None:
    told = re.findall(r"(\d) drawings, symmetric (\w+): PSNR ([\d.]+) dB, outline ([\d.]+)%", ran)
    scores = {(count, symmetric): (float(p), float(o)) for count, symmetric, p, o in told}
    assert list(scores) == [("4", "off"), ("6", "off"), ("6", "auto")]
    assert scores["6", "off"] > scores["4", "off"]
    assert scores["6", "auto"][1] > scores["6", "off"][1] - 2
    assert "mean of 4: PSNR" in ran
    assert "[_repr_png_ of Run]" in ran
    assert "[_repr_html_ of LeaveOneOut]" in ran


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_they_are_small_and_hold_no_results(name: str) -> None:
    assert (EXAMPLES / name).stat().st_size < LARGEST_BYTES
    for cell in cells(name):
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


def test_every_notebook_is_run() -> None:
    source = Path(__file__).read_text(encoding="utf-8")
    assert len(NOTEBOOKS) == 3
    assert all(f'("ran", ["{name}"], indirect' in source for name in NOTEBOOKS)
