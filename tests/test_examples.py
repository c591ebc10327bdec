"""The numbered examples run as they stand, one after the other, and write what they say."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SHORT = {"03_train.py": ["30"], "05_turntable.py": ["2"]}  # steps, views


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return what every example prints; they share one folder."""
    out = tmp_path_factory.mktemp("examples") / "out"
    said = {"folder": str(out)}
    for script in sorted(EXAMPLES.glob("0*.py")):
        command = [sys.executable, str(script), str(out), *SHORT.get(script.name, [])]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        said[script.name] = done.stdout
    return said


def test_they_are_numbered_from_one_to_five(told: dict[str, str]) -> None:
    assert [name[:2] for name in told if name.endswith(".py")] == ["01", "02", "03", "04", "05"]


def test_cameras_are_found_and_written(told: dict[str, str]) -> None:
    said = told["01_sheet_to_cameras.py"]
    assert said.count(" up  ok\n") == 8
    assert "sheet: ok" in said
    assert (Path(told["folder"]) / "bundle" / "overlay.png").is_file()


def test_the_palette_is_printed_and_drawn(told: dict[str, str]) -> None:
    assert "#d95430" in told["02_palette.py"]
    assert (Path(told["folder"]) / "labels.png").is_file()


def test_a_field_is_trained_turned_and_meshed(told: dict[str, str]) -> None:
    assert told["03_train.py"].startswith("30 steps, ")
    folder = Path(told["folder"])
    assert (folder / "run" / "preview.png").is_file()
    assert sorted(path.name for path in (folder / "turn").iterdir()) == ["000.png", "001.png"]
    assert (folder / "figure.glb").is_file()


def test_gradients_bring_a_camera_back(told: dict[str, str]) -> None:
    *_, last = told["04_refine_a_camera.py"].splitlines()
    assert float(last.split()[1]) < 0.1
