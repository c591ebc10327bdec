"""A run folder: read again as it was written, refused where it is damaged."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from safetensors.torch import load_file, save_file

from tests.nerf.ellipsoids import held_out, train_scene
from toonset.errors import BundleError
from toonset.nerf.render.turntable import turntable
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import read_field
from toonset.nerf.run.report import write_run
from toonset.nerf.train.labelling import label_scene
from toonset.nerf.train.result import Training


@pytest.fixture
def run_folder(tmp_path: Path, training: Training) -> Path:
    write_run(tmp_path, training, label_scene(train_scene())[0])
    return tmp_path


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


def truncate(folder: Path) -> None:
    file = folder / "model.safetensors"
    file.write_bytes(file.read_bytes()[:-1000])


def not_a_model(folder: Path) -> None:
    (folder / "model.safetensors").write_bytes(b"PK\x03\x04 nothing of the kind")


def drop_tensor(folder: Path) -> None:
    tensors = load_file(folder / "model.safetensors")
    del tensors["field.out.bias"]
    save_file(tensors, folder / "model.safetensors")


def wrong_shape(folder: Path) -> None:
    tensors = load_file(folder / "model.safetensors")
    tensors["field.planes"] = tensors["field.planes"][:-1].clone()
    save_file(tensors, folder / "model.safetensors")


def wrong_type(folder: Path) -> None:
    tensors = load_file(folder / "model.safetensors")
    tensors["field.planes"] = tensors["field.planes"].double()
    save_file(tensors, folder / "model.safetensors")


def not_a_number(folder: Path) -> None:
    tensors = load_file(folder / "model.safetensors")
    tensors["field.planes"][3, 2] = float("nan")
    save_file(tensors, folder / "model.safetensors")


def change_config(**changes: object) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        config = json.loads((folder / "config.json").read_text())
        config["field"].update(changes)
        (folder / "config.json").write_text(json.dumps(config))

    return change


def other_format(folder: Path) -> None:
    config = json.loads((folder / "config.json").read_text())
    config["format"] = 99
    (folder / "config.json").write_text(json.dumps(config))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (truncate, "damaged"),
        (not_a_model, "damaged"),
        (drop_tensor, "field.out.bias"),
        (wrong_shape, "field.planes is"),
        (wrong_type, "float64"),
        (not_a_number, "not finite"),
        (other_format, "format 99"),
        (change_config(hull_voxel=-1.0), "hull_voxel"),
        (change_config(hull_shape=[100000, 100000, 100000]), "hull_shape"),
        (change_config(hull_shape=[0, 3, 3]), "hull_shape"),
        (change_config(resolution=10**9), "resolution"),
        (change_config(palette=[[300, 0, 0]]), "palette"),
        (change_config(surprise=1), "surprise"),
        (lambda folder: (folder / "config.json").unlink(), "does not exist"),
        (lambda folder: (folder / "config.json").write_text("{"), "no valid JSON"),
    ],
)
def test_a_damaged_run_gets_one_clear_line(
    run_folder: Path, damage: Callable[[Path], object], message: str
) -> None:
    damage(run_folder)
    with pytest.raises(BundleError, match=message):
        read_field(run_folder)
