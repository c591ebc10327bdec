"""The drawn look's files: read again as written, refused where they are damaged."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from tests.nerf.bodies import Hand
from tests.nerf.bodies import camera_at as body_camera
from tests.nerf.ellipsoids import train_scene
from tests.nerf.look.painted import camera_at, geometry, with_an_arm
from tests.nerf.look.test_shaped import drawn, misty
from tests.nerf.run.damage import Harm, config, tensors, written
from toonset.dataset.images.picture import encode_png, load_rgba
from toonset.errors import BundleError, ToonsetError
from toonset.nerf.look.blend import blend_view
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import read_field
from toonset.nerf.train.result import Training
from toonset.palette.pixels.ramp_labels import Ramp

PICTURES, PAINT, SURFACES = "drawings.png", "paint.png", "drawings.safetensors"


@pytest.fixture(scope="module")
def egg_run(tmp_path_factory: pytest.TempPathFactory, training: Training, egg: Drawings) -> Path:
    result = replace(training.result, drawings=egg)
    return written(tmp_path_factory.mktemp("egg"), replace(training, result=result))


@pytest.fixture(scope="module")
def shaped_run(tmp_path_factory: pytest.TempPathFactory, training: Training) -> Path:
    result = replace(training.result, drawings=drawn(Hand(shadow=0.7)))
    return written(tmp_path_factory.mktemp("shaped"), replace(training, result=result))


@pytest.fixture
def folder(egg_run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(egg_run, tmp_path / "run"))


@pytest.fixture
def shaped_folder(shaped_run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(shaped_run, tmp_path / "run"))


def test_views_are_the_same_after_loading(folder: Path, egg: Drawings) -> None:
    loaded = read_field(folder).drawings
    assert loaded is not None
    shown = geometry(camera_at(0.4))
    a, b = blend_view(egg, shown), blend_view(loaded, shown)
    np.testing.assert_array_equal(a.rgb, b.rgb)
    np.testing.assert_array_equal(a.ink, b.ink)
    assert loaded.outline == egg.outline
    pixels = 8 * 120 * 120
    for name, most in ((PICTURES, 0.5), (PAINT, 0.5), (SURFACES, 1.6)):
        assert (folder / name).stat().st_size < most * pixels


def test_ramps_of_painted_drawings_are_the_same_after_loading(
    tmp_path: Path, training: Training, egg: Drawings
) -> None:
    stops = np.array([(0.2, 0.01, 0.02), (0.7, 0.03, 0.06)])
    ramps = tuple(Ramp(stops + 0.01 * i, 0.5, 0.1) for i in range(len(egg.palette)))
    result = replace(training.result, drawings=replace(egg, ramps=ramps))
    folder = written(tmp_path / "egg", replace(training, result=result))
    loaded = read_field(folder).drawings
    assert loaded is not None
    assert len(loaded.paint_ramps) == len(egg.paints)
    for one, own in zip(ramps, loaded.ramps, strict=True):
        np.testing.assert_array_equal(one.stops, own.stops)
        assert (one.light, one.spread) == (own.light, own.spread)
    for one, own in zip(replace(egg, ramps=ramps).textures, loaded.textures, strict=True):
        np.testing.assert_array_equal(one.labels, own.labels)
    config(lambda found: found["field"]["drawings"]["ramps"].pop())(folder)
    with pytest.raises(BundleError, match="must have one ramp per palette colour; train again"):
        read_field(folder)


def test_limbs_of_single_drawings_are_the_same_after_loading(
    tmp_path: Path, training: Training
) -> None:
    found = with_an_arm()
    result = replace(training.result, drawings=found)
    folder = written(tmp_path / "arm", replace(training, result=result))
    loaded = read_field(folder).drawings
    assert loaded is not None
    a, b = (blend_view(one, geometry(camera_at(0.4))) for one in (found, loaded))
    np.testing.assert_array_equal(a.rgb, b.rgb)
    tensors(SURFACES, lambda held: held.pop("limbs.0.faces"))(folder)
    with pytest.raises(BundleError, match=r"limbs\.0\.faces; train again"):
        read_field(folder)


def test_a_mannequins_shape_lines_and_shadow_are_the_same_after_loading(
    shaped_folder: Path,
) -> None:
    shaped, loaded = drawn(Hand(shadow=0.7)), read_field(shaped_folder).drawings
    assert loaded is not None
    assert loaded.steps == shaped.steps
    assert loaded.shade == shaped.shade
    a, b = (blend_view(one, misty(body_camera(0.4))) for one in (shaped, loaded))
    np.testing.assert_array_equal(a.rgb, b.rgb)
    assert loaded.shape is not None
    assert "depth" not in load_file(shaped_folder / SURFACES)  # the shape takes its place
    assert (shaped_folder / SURFACES).stat().st_size < 80_000


def test_a_run_without_drawings_says_how_to_get_them(training: Training, tmp_path: Path) -> None:
    old = read_field(written(tmp_path, training))
    assert old.drawings is None
    view = render(old, train_scene().frames[0].camera)
    with pytest.raises(BundleError, match="no drawn look; train again"):
        view.picture("drawn")


def look(change: Callable[[dict[str, Any]], object]) -> Harm:
    return config(lambda content: change(content["field"]["drawings"]))


def surfaces(change: Callable[[dict[str, torch.Tensor]], object]) -> Harm:
    return tensors(SURFACES, change)


def special(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)  # nobody ever writes into it


def smaller(folder: Path) -> None:
    cut = load_rgba(folder / PICTURES)[:, :-1]
    (folder / PICTURES).write_bytes(encode_png(np.ascontiguousarray(cut)))


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (lambda folder: (folder / PICTURES).unlink(), PICTURES),
        (lambda folder: (folder / SURFACES).unlink(), "no regular file; train again"),
        (lambda folder: special(folder / SURFACES), "no regular file; train again"),
        (lambda folder: (folder / PAINT).unlink(), PAINT),
        (lambda folder: (folder / PAINT).write_bytes(b"no picture"), PAINT),
        (lambda folder: (folder / PICTURES).write_bytes(b"no picture"), PICTURES),
        (lambda folder: (folder / SURFACES).write_bytes(b"no tensors"), "is damaged"),
        (smaller, "config.json asks for 960 x 120"),
        (surfaces(lambda t: t.pop("flow.3")), "flow.3"),
        (surfaces(lambda t: t.update(more=torch.zeros(2))), "more"),
        (surfaces(lambda t: t.update(depth=t["depth"].int())), "depth"),
        (surfaces(lambda t: t["flow.0"].fill_(float("nan"))), "flow.0 holds displacements"),
        (surfaces(lambda t: t["flow.0"].fill_(float("inf"))), "flow.0 holds displacements"),
        (look(lambda d: d.update(height=-1)), "height"),
        (look(lambda d: d.update(palette=[])), "palette"),
        (look(lambda d: d["outline"].update(width_px=1e9)), "width_px"),
        (look(lambda d: d["pairs"][0].update(pair=[0, 77])), "drawings; train again"),
        (look(lambda d: d["cameras"].pop()), "config.json asks for"),
        (look(lambda d: d["cameras"][0].update(scale=-1.0)), "scale"),
        (
            look(lambda d: d["pairs"][0]["camera"].update(scale=1e300)),
            "config.json: field.drawings: ",
        ),
        (look(lambda d: d["cameras"][0]["rotation"].reverse()), "config.json: field.drawings: "),
        (look(lambda d: d.update(soup=1)), "soup"),
    ],
)
def test_damage_gets_one_clear_line(folder: Path, harm: Harm, said: str) -> None:
    harm(folder)
    with pytest.raises(ToonsetError) as refused:
        read_field(folder)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (surfaces(lambda t: t.pop("places")), "places"),
        (surfaces(lambda t: t.pop("faces")), "faces"),
        (surfaces(lambda t: t.update(faces=t["faces"].int())), "faces"),
        (surfaces(lambda t: t.update(faces=t["faces"][:0])), "faces"),
        (surfaces(lambda t: t.update(faces=t["faces"][:, :2].contiguous())), "faces"),
        (surfaces(lambda t: t.update(places=t["places"][:9])), "vertices that are not there"),
        (look(lambda d: d["shape"].update(step=0)), "step"),
        (look(lambda d: d.update(shape=None)), "depth"),
        (look(lambda d: d["steps"].update(near_px=-1)), "near_px"),
        (look(lambda d: d["shade"].update(factor=[1, 2, 3])), "factor"),
        (look(lambda d: d["shade"].update(slope=[1, 2])), "slope"),
    ],
)
def test_damage_to_a_shape_gets_one_clear_line(shaped_folder: Path, harm: Harm, said: str) -> None:
    test_damage_gets_one_clear_line(shaped_folder, harm, said)
