"""The lines that a user types to take a mesh or planes out of a run."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from toonset.cli.common import output
from toonset.dataset.mesh.load import load_mesh


def test_mesh_of_a_run(toonset: Callable[..., Any], run: Path, tmp_path: Path) -> None:
    out = tmp_path / "figure.glb"
    done = toonset("mesh", run, "-o", out, "--faces", 800, "--json")
    assert done.code == 0, done
    assert done.json["faces"] == len(load_mesh(out).faces) <= 800
    assert done.json["bytes"] == {"figure.glb": out.stat().st_size}
    assert "exists already" in toonset("mesh", run, "-o", out).reason
    assert "end -o in .glb, .obj, .ply" in toonset("mesh", run, "-o", tmp_path / "a.stl").reason

    drawn = tmp_path / "drawn.obj"
    done = toonset("mesh", run, "-o", drawn, "--faces", 800, "--texture", "--json")
    assert done.code == 0, done
    assert done.json["faces"] == len(load_mesh(drawn).faces) <= 800
    assert set(done.json["bytes"]) == {"drawn.obj", "drawn.mtl", "drawn.png"}
    assert 0 <= done.json["by_field"] < 0.5
    for arguments, reason in (
        (("a.ply", "--texture"), "holds no texture; end -o in .glb, .obj"),
        (("a.obj", "--texture", "--outline"), "end -o in .glb for --outline"),
        (("a.glb", "--outline"), "--outline belongs to --texture"),
    ):
        assert reason in toonset("mesh", run, "-o", tmp_path / arguments[0], *arguments[1:]).reason
    assert not list(tmp_path.glob("a.*"))


def test_a_mesh_is_light_unless_asked_and_says_how_far_it_is(
    toonset: Callable[..., Any], run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(output, "SECONDS_BETWEEN_LOG_LINES", 0.0)
    light = toonset("mesh", run, "-o", tmp_path / "light.glb")
    assert len(load_mesh(tmp_path / "light.glb").faces) in range(7900, 8001)
    shares = re.findall(r"^(finding the surface|merging triangles) (\d+)%$", light.err, re.M)
    assert len(shares) > 8
    assert shares[-1][0] == "merging triangles"
    whole = toonset("mesh", run, "-o", tmp_path / "whole.glb", "--faces", 1_000_000, "--json")
    assert whole.json["faces"] > 8000
    plain = " ".join(toonset("mesh", "-h").out.split())
    assert "[default: 8000; x>=100]" in plain
    assert "does not turn a PLY" in plain


def test_planes_of_a_run(toonset: Callable[..., Any], run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "planes"
    assert toonset("planes", run, "-o", folder).code == 0
    about = json.loads((folder / "planes.json").read_text())
    assert all((folder / plane["picture"]).is_file() for plane in about["planes"])
    assert "exists already" in toonset("planes", run, "-o", folder).reason
    assert toonset("planes", run, "-o", folder, "--force").code == 0
