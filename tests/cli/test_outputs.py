"""The lines that a user types to take a mesh out of a run."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from toonset.cli.common import output
from toonset.dataset.mesh.load import load_mesh
from toonset.errors import PaletteError
from toonset.nerf.options import MeshOptions
from toonset.nerf.surface import texture


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


def without_palette(*_: Any, **__: Any) -> None:
    raise PaletteError("it has no palette")


def test_blender_gets_the_painted_body(
    toonset: Callable[..., Any],
    bundle: Path,
    run: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run.rename(bundle / "run")
    asked = ("export", bundle, "--to", "blender", "-o")
    done = toonset(*asked, tmp_path / "own")
    assert done.code == 0, done
    body = load_mesh(tmp_path / "own" / "body.glb")
    mannequin = load_mesh(tmp_path / "own" / "mannequin.obj")
    assert len(body.faces) <= MeshOptions.faces
    assert abs(body.height / mannequin.height - 1) < 0.1  # one world
    given = tmp_path / "own" / "body.glb"
    assert toonset(*asked, tmp_path / "given", "--body", given).code == 0
    assert (tmp_path / "given" / "body.glb").read_bytes() == given.read_bytes()
    assert toonset(*asked, tmp_path / "bare", "--body", "none").code == 0
    assert not (tmp_path / "bare" / "body.glb").exists()
    for file, reason in (("no.glb", "no.glb: no such file"), ("own/mannequin.obj", "is no GLB")):
        assert reason in toonset(*asked, tmp_path / "x", "--body", tmp_path / file).reason
    assert not (tmp_path / "x").exists()
    elsewhere = ("export", bundle, "--to", "gltf", "--body", given, "-o", tmp_path / "x")
    assert "--body belongs to --to blender" in toonset(*elsewhere).reason
    with monkeypatch.context() as patch:
        patch.setattr(texture, "texture_surface", without_palette)
        told = toonset(*asked, tmp_path / "unpainted")
    assert (told.code, "no painted body: it has no palette" in told.err) == (0, True)
    (bundle / "run" / "model.safetensors").unlink()
    assert toonset(*asked, tmp_path / "x").code == 2  # a broken run is not passed over


def test_a_mesh_in_several_palettes(toonset: Callable[..., Any], run: Path, tmp_path: Path) -> None:
    colors = json.loads((run / "config.json").read_text())["field"]["palette"]
    rows = "\n".join(f"{255 - r} {255 - g} {255 - b}" for r, g, b in colors)
    dusk = tmp_path / "dusk.gpl"
    dusk.write_text(f"GIMP Palette\nName: <Dusk>\n#\n{rows}\n")
    out, asked = tmp_path / "figure.glb", ("mesh", run, "--faces", 800, "-o")
    typed = ("--variants", "#aabbcc", "--nearest")
    done = toonset(*asked, out, "--texture", "--variants", dusk, *typed, "--json")
    assert done.code == 0, done
    assert done.json["variants"] == ["original", "<Dusk>", "colours 2"]
    assert len(load_mesh(out).faces) == done.json["faces"]
    plain = toonset(*asked, tmp_path / "plain.glb", "--variants", dusk)
    assert "in the colours original, <Dusk>;" in plain.out
    for arguments, reason in (
        (("a.glb", "--variants", "#aabbcc"), "--variants #aabbcc: 1 colours, the run has"),
        (("a.glb", "--variants", tmp_path / "no.gpl"), "no.gpl: no such file"),
        (("a.obj", "--variants", dusk), "holds no variants; end -o in .glb"),
        (("a.obj", "--texture", "--variants", dusk), "holds no variants; end -o in .glb"),
        (("a.glb", "--nearest"), "--nearest belongs to --variants"),
    ):
        assert reason in toonset(*asked, tmp_path / arguments[0], *arguments[1:]).reason
    assert not list(tmp_path.glob("a.*"))


def test_a_mesh_is_light_unless_asked_and_says_how_far_it_is(toonset, run, tmp_path, monkeypatch):
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
