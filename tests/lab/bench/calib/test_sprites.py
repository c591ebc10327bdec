"""The calibration benchmark on game sprites: yaws in degrees or bins, shadows, one chart."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lab.bench.cases.bodies import random_body
from lab.bench.cases.sprites import (
    MANNEQUIN,
    OWN_MESH,
    SpriteCase,
    bench_sprites,
    laid_out_anew,
    sprite_cases,
    sprites_table,
)
from toonset.camera import Camera
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.load import save_obj
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import make_turnaround
from toonset.errors import BundleError

METHODS = {
    "default",
    "labels",
    "no body",
    "no body, rolled",
    "no body, reversed",
    "no body, both",
    "no body, front",
    "no body, labels",
}


def calibration_at(*yaws_deg: float) -> SimpleNamespace:
    """Return what of a calibration is measured."""
    views = [
        SimpleNamespace(
            camera=Camera.looking_at(np.zeros(3), math.radians(yaw), 0.0, 1.0, (4, 4)),
            verdict="ok",
            sigmas=SimpleNamespace(yaw=0.1),
        )
        for yaw in yaws_deg
    ]
    return SimpleNamespace(views=views, is_certain=True)


@pytest.fixture(scope="module")
def sprites(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a character of 4 sprites with its mesh, and one without."""
    root = tmp_path_factory.mktemp("sprites")
    options = SynthOptions(views=4, cell_px=64, outline_px=0, elevation_deg=30, supersample=2)
    made = make_turnaround(random_body(5), options, 0)
    (root / "body.obj").write_bytes(save_obj(made.mesh))
    for name in ("exact", "free"):
        place = root / "sprites" / name
        place.mkdir(parents=True)
        info: dict[str, object] = {"yaw_deg": [0, 90, 180, 270]}
        if name == "exact":
            info |= {"mesh": "body.obj", "alpha": "below 200 is the shadow"}
        (place / "info.json").write_text(json.dumps(info))
        for i, view in enumerate(made.views):
            rgba = view.rgba.copy()
            rgba[-4:, :, 3] = 150
            (place / f"view_{i}.png").write_bytes(encode_png(rgba))
    return root / "sprites"


def test_a_shadow_is_cut_where_the_sprites_have_one(sprites: Path) -> None:
    exact, free = sprite_cases(sprites)
    assert (exact.group, free.group) == (OWN_MESH, MANNEQUIN)
    assert not exact.views[0].rgba[-4:].any()
    assert free.views[0].mask[-4:].all()
    assert set(np.unique(exact.views[0].rgba[..., 3]) // 200) <= {0, 1}
    assert exact.yaws == pytest.approx(np.radians([0, 90, 180, 270]))


def laid_out(case: SpriteCase, *, rolled: bool, way: int) -> list[int]:
    return [round(math.degrees(yaw)) for yaw in laid_out_anew(case, rolled=rolled, way=way).yaws]


def test_a_sheet_is_laid_out_anew(sprites: Path) -> None:
    case, _ = sprite_cases(sprites)
    assert laid_out(case, rolled=False, way=1) == [0, 90, 180, 270]
    assert laid_out(case, rolled=True, way=1) == [90, 180, 270, 0]
    assert laid_out(case, rolled=True, way=-1) == [0, 270, 180, 90]
    anew = laid_out_anew(case, rolled=True, way=-1)
    assert anew.views[-1] is case.views[1]


def test_sprites_with_their_mesh_are_measured_in_degrees(sprites: Path) -> None:
    records = bench_sprites(sprite_cases(sprites, "exact"), 0)
    assert {r.method for r in records} == METHODS
    exact = {r.metric: r for r in records if r.method == "labels"}
    assert exact["yaw error"].median < 3
    assert exact["right 45 deg bin"].value == 1


def test_sprites_without_a_mesh_are_asked_for_their_bin(
    sprites: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = calibration_at(20, 70, 0, 0)
    for name in ("find_cameras", "calibrate_without_body"):
        monkeypatch.setattr(f"lab.bench.cases.sprites.{name}", lambda *_, **__: found)
    records = bench_sprites(sprite_cases(sprites), 0)
    free = {r.metric: r for r in records if (r.group, r.method) == (MANNEQUIN, "default")}
    assert (free["right 45 deg bin"].value, free["right 45 deg bin"].n) == (0.5, 4)
    assert free["wrong but ok"].value == 2
    assert "yaw error" not in free
    text = sprites_table(records)
    assert OWN_MESH in text.splitlines()
    assert max(map(len, text.splitlines())) <= 120


@pytest.mark.parametrize("info", [{}, [], {"yaw_deg": ["left"]}, {"yaw_deg": []}, {"yaw_deg": 3}])
def test_sprites_that_do_not_say_their_yaws_are_refused(tmp_path: Path, info: object) -> None:
    (tmp_path / "cat").mkdir()
    (tmp_path / "cat" / "info.json").write_text(json.dumps(info))
    with pytest.raises(BundleError, match="yaw_deg"):
        list(sprite_cases(tmp_path))
