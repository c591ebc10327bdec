"""The drawn look's files: read again as written, refused where they are damaged."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from tests.nerf.bodies import Hand
from tests.nerf.bodies import camera_at as body_camera
from tests.nerf.ellipsoids import train_scene
from tests.nerf.look.painted import camera_at, geometry
from tests.nerf.look.test_shaped import drawn, misty
from toonset.dataset.images.picture import encode_png, load_rgba
from toonset.errors import BundleError, ToonsetError
from toonset.nerf.look.blend import drawn_view
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import read_field
from toonset.nerf.run.report import write_run
from toonset.nerf.train.labelling import labelled
from toonset.nerf.train.result import Training

CONFIG, PICTURES, PAINT = "config.json", "drawings.png", "paint.png"
SURFACES = "drawings.safetensors"


def written(folder: Path, training: Training, look: Drawings) -> Path:
    result = replace(training.result, drawings=look)
    write_run(folder, replace(training, result=result), labelled(train_scene())[0])
    return folder


@pytest.fixture(scope="module")
def egg_run(tmp_path_factory: pytest.TempPathFactory, training: Training, egg: Drawings) -> Path:
    return written(tmp_path_factory.mktemp("egg"), training, egg)


@pytest.fixture(scope="module")
def shaped_run(tmp_path_factory: pytest.TempPathFactory, training: Training) -> Path:
    return written(tmp_path_factory.mktemp("shaped"), training, drawn(Hand(shadow=0.7)))


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
    a, b = drawn_view(egg, shown), drawn_view(loaded, shown)
    np.testing.assert_array_equal(a.rgb, b.rgb)
    np.testing.assert_array_equal(a.ink, b.ink)
    assert loaded.outline == egg.outline
    pixels = 8 * 120 * 120
    for name, most in ((PICTURES, 0.5), (PAINT, 0.5), (SURFACES, 1.6)):
        assert (folder / name).stat().st_size < most * pixels


def test_a_mannequins_shape_lines_and_shadow_are_the_same_after_loading(
    shaped_folder: Path,
) -> None:
    shaped, loaded = drawn(Hand(shadow=0.7)), read_field(shaped_folder).drawings
    assert loaded is not None
    assert loaded.steps == shaped.steps
    assert loaded.shade == shaped.shade
    a, b = (drawn_view(one, misty(body_camera(0.4))) for one in (shaped, loaded))
    np.testing.assert_array_equal(a.rgb, b.rgb)
    assert loaded.shape is not None
    assert "depth" not in load_file(shaped_folder / SURFACES)  # the shape takes its place
    assert (shaped_folder / SURFACES).stat().st_size < 80_000


def test_a_run_without_drawings_says_how_to_get_them(training: Training, tmp_path: Path) -> None:
    write_run(tmp_path, training, labelled(train_scene())[0])
    old = read_field(tmp_path)
    assert old.drawings is None
    view = render(old, train_scene().frames[0].camera)
    with pytest.raises(BundleError, match="no drawn look; train again"):
        view.picture("drawn")


def config(change: Callable[[dict[str, Any]], None]) -> Callable[[Path], None]:
    def applied(folder: Path) -> None:
        content = json.loads((folder / CONFIG).read_text())
        change(content["field"]["drawings"])
        (folder / CONFIG).write_text(json.dumps(content))

    return applied


def tensors(change: Callable[[dict[str, torch.Tensor]], object]) -> Callable[[Path], None]:
    def applied(folder: Path) -> None:
        found = load_file(folder / SURFACES)
        change(found)
        save_file(found, folder / SURFACES)

    return applied


def smaller(folder: Path) -> None:
    cut = load_rgba(folder / PICTURES)[:, :-1]
    (folder / PICTURES).write_bytes(encode_png(np.ascontiguousarray(cut)))


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (lambda folder: (folder / PICTURES).unlink(), PICTURES),
        (lambda folder: (folder / SURFACES).unlink(), SURFACES),
        (lambda folder: (folder / PAINT).unlink(), PAINT),
        (lambda folder: (folder / PAINT).write_bytes(b"no picture"), PAINT),
        (lambda folder: (folder / PICTURES).write_bytes(b"no picture"), PICTURES),
        (lambda folder: (folder / SURFACES).write_bytes(b"no tensors"), "is damaged"),
        (smaller, "config.json asks for 960 x 120"),
        (tensors(lambda t: t.pop("flow.3")), "flow.3"),
        (tensors(lambda t: t.update(more=torch.zeros(2))), "more"),
        (tensors(lambda t: t.update(depth=t["depth"].int())), "depth"),
        (tensors(lambda t: t["flow.0"].fill_(float("nan"))), "flow.0 holds displacements"),
        (tensors(lambda t: t["flow.0"].fill_(float("inf"))), "flow.0 holds displacements"),
        (config(lambda d: d.update(height=-1)), "height"),
        (config(lambda d: d.update(palette=[])), "palette"),
        (config(lambda d: d["outline"].update(width_px=1e9)), "width_px"),
        (config(lambda d: d["pairs"][0].update(pair=[0, 77])), "pair"),
        (config(lambda d: d["cameras"].pop()), "config.json asks for"),
        (config(lambda d: d["cameras"][0].update(scale=-1.0)), "scale"),
        (config(lambda d: d.update(soup=1)), "soup"),
    ],
)
def test_damage_gets_one_clear_line(
    folder: Path, harm: Callable[[Path], object], said: str
) -> None:
    harm(folder)
    with pytest.raises(ToonsetError) as refused:
        read_field(folder)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (tensors(lambda t: t.pop("places")), "places"),
        (tensors(lambda t: t.pop("faces")), "faces"),
        (tensors(lambda t: t.update(faces=t["faces"].int())), "faces"),
        (tensors(lambda t: t.update(faces=t["faces"][:0])), "faces"),
        (tensors(lambda t: t.update(faces=t["faces"][:, :2].contiguous())), "faces"),
        (tensors(lambda t: t.update(places=t["places"][:9])), "vertices that are not there"),
        (config(lambda d: d["shape"].update(step=0)), "step"),
        (config(lambda d: d.update(shape=None)), "depth"),
        (config(lambda d: d["steps"].update(near_px=-1)), "near_px"),
        (config(lambda d: d["shade"].update(factor=[1, 2, 3])), "factor"),
        (config(lambda d: d["shade"].update(slope=[1, 2])), "slope"),
    ],
)
def test_damage_to_a_shape_gets_one_clear_line(
    shaped_folder: Path, harm: Callable[[Path], object], said: str
) -> None:
    test_damage_gets_one_clear_line(shaped_folder, harm, said)
