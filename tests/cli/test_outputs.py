"""The lines that a user types to take a mesh or planes out of a run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from toonset.dataset.mesh.load import load_mesh


def test_mesh_and_planes_of_a_run(toonset: Callable[..., Any], run: Path, tmp_path: Path) -> None:
    out = tmp_path / "figure.glb"
    done = toonset("mesh", run, "-o", out, "--faces", 800, "--json")
    assert done.code == 0, done
    assert done.json["faces"] == len(load_mesh(out).faces) <= 800
    assert done.json["bytes"] == {"figure.glb": out.stat().st_size}
    assert "exists already" in toonset("mesh", run, "-o", out).reason
    assert "end -o in .glb, .obj, .ply" in toonset("mesh", run, "-o", tmp_path / "a.stl").reason

    folder = tmp_path / "planes"
    assert toonset("planes", run, "-o", folder).code == 0
    about = json.loads((folder / "planes.json").read_text())
    assert all((folder / plane["picture"]).is_file() for plane in about["planes"])
    assert "exists already" in toonset("planes", run, "-o", folder).reason
    assert toonset("planes", run, "-o", folder, "--force").code == 0
