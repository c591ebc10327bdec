"""A run folder: read again as it was written, refused where it is damaged."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.nerf.ellipsoids import held_out
from tests.nerf.run.damage import Harm, config, tensors, written
from toonset.errors import BundleError
from toonset.nerf.render.turntable import turntable
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import read_field
from toonset.nerf.train.result import Training


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, training: Training) -> Path:
    return written(tmp_path_factory.mktemp("run"), training)


@pytest.fixture
def run_folder(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "run"))


def test_a_run_folder_renders_the_same_after_loading(run_folder: Path, training: Training) -> None:
    loaded = read_field(run_folder)
    for camera in (held_out().frames[0].camera, turntable(loaded, 3, 0.1)[1]):
        a, b = render(training.result, camera), render(loaded, camera)
        np.testing.assert_array_equal(a.rgb, b.rgb)
        np.testing.assert_array_equal(a.depth, b.depth)
        np.testing.assert_array_equal(a.labels, b.labels)
    names = {"model.safetensors", "config.json", "metrics.json", "history.csv", "preview.png"}
    assert {file.name for file in run_folder.iterdir()} == names
    assert len((run_folder / "history.csv").read_text().splitlines()) == 1 + len(training.history)
    assert json.loads((run_folder / "metrics.json").read_text())["train"]["psnr"] > 24


PLANES, MODEL = "field.planes", "model.safetensors"


def model(change: Callable[[dict[str, Any]], object]) -> Harm:
    return tensors(MODEL, change)


def field(**changes: object) -> Harm:
    return config(lambda content: content["field"].update(changes))


def truncate(folder: Path) -> None:
    (folder / MODEL).write_bytes((folder / MODEL).read_bytes()[:-1000])


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (truncate, "damaged"),
        (lambda folder: (folder / MODEL).write_bytes(b"PK\x03\x04 nothing of the kind"), "damaged"),
        (model(lambda t: t.pop("field.out.bias")), "field.out.bias"),
        (model(lambda t: t.update({PLANES: t[PLANES][:-1].clone()})), "field.planes is"),
        (model(lambda t: t.update({PLANES: t[PLANES].double()})), "float64"),
        (model(lambda t: t[PLANES][3, 2].fill_(float("nan"))), "not finite"),
        (config(lambda content: content.update(format=99)), "format 99"),
        (field(hull_voxel=-1.0), "hull_voxel"),
        (field(hull_voxel=1e-300), "hull_voxel"),
        (field(hull_voxel=1e9), "step .* cuts the hull into more"),
        (field(hull_low=[0, 1e300, 0]), "hull_low"),
        (field(step=1e-6), "step .* cuts the hull into more"),
        (field(k=1e-300), "k 1e-300"),
        (field(hull_shape=[100000, 100000, 100000]), "hull_shape"),
        (field(hull_shape=[0, 3, 3]), "hull_shape"),
        (field(resolution=10**9), "resolution"),
        (field(palette=[[300, 0, 0]]), "palette"),
        (field(surprise=1), "surprise"),
        (lambda folder: (folder / "config.json").unlink(), "does not exist"),
        (lambda folder: (folder / "config.json").write_text("{"), "no valid JSON"),
    ],
)
def test_a_damaged_run_gets_one_clear_line(run_folder: Path, damage: Harm, message: str) -> None:
    damage(run_folder)
    with pytest.raises(BundleError, match=message):
        read_field(run_folder)
