"""An unfinished training on disk, and back.

    checkpoint.json                  what is trained on what, and the SHA-256 of
    checkpoint-000120.safetensors    everything that the rest depends on (`FitState`)

The tensors are written first and the JSON, which names them, replaces the last one in one move: a
training killed at any moment leaves its last checkpoint whole. Nothing is pickled. On a CPU a
resumed training ends with the same bits as one that was never interrupted.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from toonset import __version__
from toonset.dataset.bundle.scene import Scene
from toonset.errors import BundleError
from toonset.json_file import read_json, validated, validation_reason
from toonset.nerf.kernels.threads import threads_in_use
from toonset.nerf.options import TrainOptions
from toonset.nerf.run.manifest import entry_of
from toonset.nerf.train.result import Step
from toonset.nerf.train.state import FitState
from toonset.read import read_whole, schema_version
from toonset.write import write_bytes, write_json

FILE, TENSORS = "checkpoint.json", "checkpoint-*.safetensors"
SCHEMA, VERSION = "toonset-checkpoint", 3  # 1: a step's rays were one batch; 2: borders were harder
MAX_BYTES = 4 * 2**30
GROUPS = ("parameters", "means", "squares", "rays")
SINGLE = ("queue", "generator", "torch_generator", "history")


class _Tensors(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: str = Field(pattern=r"^checkpoint-\d+\.safetensors$")
    bytes: int
    sha256: str


class CheckpointRecord(BaseModel):
    """What checkpoint.json says.

    Attributes:
        steps: steps done.
        options: of the training.
        scene: digest of what it is trained on.
        with_palette: whether labels are trained, too.
        threads: of torch; another number gives other last digits.
        versions: of what computes.
        tensors: the file with the state.
    """

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    steps: int = Field(ge=0)
    options: dict[str, Any]
    scene: str
    with_palette: bool
    threads: int = Field(ge=1, le=4096)
    versions: dict[str, str]
    tensors: _Tensors


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """An unfinished training.

    Attributes:
        record: what it is.
        options: of the training.
        state: where it stands.
    """

    record: CheckpointRecord
    options: TrainOptions
    state: FitState


def write_checkpoint(folder: Path, state: FitState, options: TrainOptions, scene: Scene) -> None:
    """Write an unfinished training into a folder, in place of its last checkpoint."""
    name = TENSORS.replace("*", f"{state.steps:06d}")
    data = save(_tensors(state))
    write_bytes(folder / name, data)
    content = {
        "schema": f"{SCHEMA}/{VERSION}",
        "steps": state.steps,
        "options": asdict(options),
        "scene": scene_digest(scene),
        "with_palette": scene.palette is not None,
        "threads": threads_in_use(),
        "versions": versions(),
        "tensors": {"name": name, **entry_of(data)},
    }
    write_json(folder / FILE, content)
    for old in folder.glob(TENSORS):
        if old.name != name:
            with contextlib.suppress(OSError):
                old.unlink()


def read_checkpoint(folder: Path) -> Checkpoint:
    """Return the unfinished training of a folder.

    Raises:
        BundleError: there is none, or a file of it is damaged or of another toonset.
    """
    record = read_record(folder)
    file = folder / record.tensors.name
    data = read_whole(file, "checkpoint", BundleError, MAX_BYTES)
    if entry_of(data) != record.tensors.model_dump(exclude={"name"}):
        raise BundleError(
            f"{file}: is not the file that training wrote ({FILE} has another SHA-256); "
            "train again without --resume"
        )
    try:
        state = _state(load(data))
    except (SafetensorError, ValueError, KeyError) as error:
        raise BundleError(f"{file}: is damaged ({error}); train again without --resume") from error
    return Checkpoint(record, options_of(record.options, folder / FILE), state)


def read_record(folder: Path) -> CheckpointRecord:
    """Return what checkpoint.json says; the state is not read.

    Raises:
        BundleError: it does not exist, or is damaged or of another toonset.
    """
    file = folder / FILE
    content = read_json(file)
    if schema_version(content, SCHEMA, VERSION, str(file), BundleError) != VERSION:
        raise BundleError(
            f"{file}: the training was begun by an earlier toonset, whose steps were others; train "
            "again without --resume"
        )
    return validated(CheckpointRecord, content, file)


def check_scene(checkpoint: Checkpoint, scene: Scene, file: Path) -> None:
    """Refuse to go on with a training on another scene than it began with.

    Raises:
        BundleError: pictures, cameras, labels, palette or mannequin have changed.
    """
    if scene_digest(scene) != checkpoint.record.scene:
        raise BundleError(
            f"{file}: was trained on other pictures, cameras, labels or mannequin than "
            f"{scene.name} holds now; restore them, or train again without --resume"
        )


def scene_digest(scene: Scene) -> str:
    """Return a SHA-256 of all that training sees of a scene; its name and place do not count."""
    digest = sha256()
    for frame in scene.frames:
        camera = frame.camera
        numbers = [camera.scale, *camera.size_wh, camera.k, camera.pixel_aspect]
        numbers += [] if frame.yaw_sigma is None else [frame.yaw_sigma]
        for values in (camera.rotation, camera.target, camera.center, numbers):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
        digest.update(np.ascontiguousarray(frame.rgba).tobytes())
        digest.update(b"" if frame.labels is None else np.ascontiguousarray(frame.labels).tobytes())
    digest.update(b"" if scene.palette is None else np.ascontiguousarray(scene.palette).tobytes())
    if scene.mannequin is not None:
        for values in (scene.mannequin.vertices, scene.mannequin.faces):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()


def options_of(content: Mapping[str, Any], file: Path) -> TrainOptions:
    """Return training options that were written as JSON.

    Raises:
        BundleError: they are not those of this toonset.
    """
    odd = content.keys() ^ {field.name for field in fields(TrainOptions)}
    if odd:
        raise BundleError(
            f"{file}: options {', '.join(sorted(odd))} are of another toonset; train again "
            "without --resume"
        )
    try:
        return TypeAdapter(TrainOptions).validate_python(dict(content))
    except ValidationError as error:
        raise BundleError(f"{file}: {validation_reason(error)}") from error


def versions() -> dict[str, str]:
    """Return the versions of what computes."""
    return {"toonset": __version__, "torch": torch.__version__, "numpy": np.__version__}


def _tensors(state: FitState) -> dict[str, Tensor]:
    rows = [(s.loss, s.photometric, s.cross_entropy, s.seconds) for s in state.history]
    tensors = {
        "queue": torch.tensor(state.queue, dtype=torch.int64),
        "generator": state.generator,
        "torch_generator": state.torch_generator,
        "history": torch.tensor(rows, dtype=torch.float64).reshape(-1, 4),
    }
    for group in GROUPS:
        values: dict[str, Tensor] = getattr(state, group)
        tensors |= {f"{group}.{name}": tensor.contiguous() for name, tensor in values.items()}
    return tensors


def _state(tensors: dict[str, Tensor]) -> FitState:
    groups: dict[str, dict[str, Tensor]] = {group: {} for group in GROUPS}
    for full_name, tensor in tensors.items():
        if full_name not in SINGLE:
            group, name = full_name.split(".", 1)
            groups[group][name] = tensor
    rows = tensors["history"].tolist()
    return FitState(
        history=tuple(Step(number, *row) for number, row in enumerate(rows)),
        queue=tuple(tensors["queue"].tolist()),
        generator=tensors["generator"],
        torch_generator=tensors["torch_generator"],
        **groups,
    )
