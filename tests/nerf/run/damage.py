"""Run folders for tests: written once, copied, then harmed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import load_file, save_file

from tests.nerf.ellipsoids import train_scene
from toonset.nerf.run.report import write_run
from toonset.nerf.train.labelling import label_scene
from toonset.nerf.train.result import Training

Harm = Callable[[Path], object]


def written(folder: Path, training: Training) -> Path:
    write_run(folder, training, label_scene(train_scene())[0])
    return folder


def config(change: Callable[[dict[str, Any]], object]) -> Harm:
    def applied(folder: Path) -> None:
        content = json.loads((folder / "config.json").read_text())
        change(content)
        (folder / "config.json").write_text(json.dumps(content))

    return applied


def tensors(file: str, change: Callable[[dict[str, torch.Tensor]], object]) -> Harm:
    def applied(folder: Path) -> None:
        found = load_file(folder / file)
        change(found)
        save_file(found, folder / file)

    return applied
