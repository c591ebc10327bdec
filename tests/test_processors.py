"""What depends on the processor: the last digits of sums, and by them cameras, within limits."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Command, Outcome

MOST_SIGMAS = 3.0  # 1.3 on the five sheets of docs/limits.md
ANGLES = ("yaw_deg", "elevation_deg")


@pytest.fixture
def without_fma(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let processes use the instructions of an old processor."""
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Nehalem")
    monkeypatch.setenv("NPY_DISABLE_CPU_FEATURES", "X86_V3 X86_V4")
    monkeypatch.setenv("OPENCV_CPU_DISABLE", "AVX2,FMA3")


def views_of(bundle: Path) -> list[dict[str, Any]]:
    content = json.loads((bundle / "calibration.json").read_text())
    return list(content["views"])


@pytest.mark.usefixtures("without_fma")
def test_sheets_are_cut_the_same_by_other_instructions(
    drawn: Path, tmp_path: Path, toonset: Command, shell: Command, snapshot: Callable[..., Any]
) -> None:
    old, own = tmp_path / "old", tmp_path / "own"
    assert shell("split", drawn / "sheet.png", "-o", old).code == 0
    assert toonset("split", drawn / "sheet.png", "-o", own).code == 0  # has begun without them
    assert snapshot(old) == snapshot(own)


@pytest.mark.slow
@pytest.mark.usefixtures("without_fma")
def test_other_instructions_move_cameras_within_their_sigmas(
    drawn: Path, calibrated: tuple[Path, Outcome], tmp_path: Path, shell: Command
) -> None:
    old, mesh = tmp_path / "old", drawn / "mannequin.obj"
    assert shell("calibrate", drawn / "sheet.png", "--mesh", mesh, "-o", old).code in (0, 3)
    off = []
    for own, other in zip(views_of(calibrated[0]), views_of(old), strict=True):
        assert own["verdict"] == other["verdict"]
        for angle in ANGLES:
            turned = (own["camera"][angle] - other["camera"][angle] + 180) % 360 - 180
            off.append(abs(turned) / own["sigma"][angle])
    assert max(off) < MOST_SIGMAS
