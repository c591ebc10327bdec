"""Write a trained run to disk, and read it back.

    model.safetensors   parameters of field and classifier, and the hull
    config.json         what is needed to build them, and the resolved options
    metrics.json        how training went
    drawings.png        the drawings as they were trained on, side by side
    paint.png           the same without the lines and shadows that new views have drawn anew
    drawings.safetensors  their surface, and how far their paint lies apart
    history.csv         every step's losses
    preview.png         four views of the result

Nothing is pickled, and no file names a place: a run folder may be moved. Loading checks every name,
shape, type and value before use.
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from safetensors.torch import save

from toonset.errors import BundleError, UsageError
from toonset.json_file import LARGEST, Number, Size, read_json, validation_reason
from toonset.nerf.fields.classifier import PaletteClassifier
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.fields.triplane import TriplaneField
from toonset.nerf.hull.hull import Hull
from toonset.nerf.options import TrainOptions
from toonset.nerf.run.drawings import (
    ORIGINALS,
    PAINT,
    PICTURES,
    SURFACES,
    DrawingsRecord,
    load_tensors,
    read_drawings,
    write_drawings,
)
from toonset.nerf.run.tensors import packed, unpack
from toonset.write import write_bytes

CONFIG, MODEL = "config.json", "model.safetensors"
WRITTEN = (
    *(
        MODEL,
        CONFIG,
        "metrics.json",
        "history.csv",
        "preview.png",
        PICTURES,
        ORIGINALS,
        PAINT,
        SURFACES,
    ),
    "manifest.json",  # of runs of before, which --force may replace
)
FORMAT = 5
MOST_CELLS = 512  # along one side, of planes and hull alike
MOST_ALONG = 4096  # samples on a ray, and steps along the hull's longest side


class FieldRecord(BaseModel):
    """Record that rebuilds a `TrainedField` around the tensors of model.safetensors."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    resolution: int = Field(ge=1, le=MOST_CELLS)
    channels: int = Field(ge=1, le=256)
    hidden: int = Field(ge=1, le=1024)
    hull_low: tuple[Number, Number, Number]
    hull_voxel: Size
    hull_shape: tuple[int, int, int]
    step: Size
    samples: int = Field(ge=1, le=MOST_ALONG)
    palette: list[tuple[int, int, int]] | None = Field(default=None, max_length=255)
    k: float = Field(ge=0, le=1e9)
    size_px: int = Field(ge=1, le=16384)
    drawings: DrawingsRecord | None = None

    @classmethod
    def of(cls, trained: TrainedField) -> FieldRecord:
        """Return the record of a field."""
        field = trained.field
        assert isinstance(field, TriplaneField)
        low = trained.hull.low.tolist()
        shape = tuple(trained.hull.support.shape)
        palette = None if trained.palette is None else [tuple(c) for c in trained.palette.tolist()]
        return cls(
            resolution=field.resolution,
            channels=field.hidden.in_features,
            hidden=field.hidden.out_features,
            hull_low=(low[0], low[1], low[2]),
            hull_voxel=trained.hull.voxel,
            hull_shape=(shape[0], shape[1], shape[2]),
            step=trained.step,
            samples=trained.samples,
            palette=palette,
            k=trained.k,
            size_px=trained.size_px,
            drawings=None if trained.drawings is None else DrawingsRecord.of(trained.drawings),
        )


class _Format(BaseModel):
    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    format: int


class _Config(_Format):
    field: FieldRecord


def write_field(folder: Path, trained: TrainedField, about: dict[str, Any]) -> dict[str, Any]:
    """Write model.safetensors; return the content of config.json.

    Args:
        folder: an existing folder.
        trained: the field.
        about: further entries of config.json (options, versions).
    """
    record = FieldRecord.of(trained)
    write_bytes(folder / MODEL, model_of(trained))
    if trained.drawings is not None:
        write_drawings(folder, trained.drawings)
    return {"format": FORMAT, "field": record.model_dump(mode="json"), **about}


def model_of(trained: TrainedField) -> bytes:
    """Return the content of model.safetensors."""
    return save(packed(trained))


def read_field(folder: str | Path) -> TrainedField:
    """Return the field of a run folder.

    Raises:
        BundleError: a file is missing or damaged, or holds what no training writes.
    """
    folder = Path(folder)
    config_file, model_file = folder / CONFIG, folder / MODEL
    for file in (config_file, model_file):
        if not file.is_file():
            inside = sorted(folder.glob(f"*/{CONFIG}"))  # of a bundle
            if inside:
                raise BundleError(f"{folder}: is no run; did you mean {inside[0].parent}?")
            raise BundleError(f"{file}: does not exist; `toonset train` writes run folders")
    record = _record(config_file)
    trained = _empty(record)
    unpack(load_tensors(model_file), trained, str(model_file))
    if record.drawings is None:
        return trained
    return replace(trained, drawings=read_drawings(folder, record.drawings))


def read_options(folder: Path) -> TrainOptions:
    """Return the options that a run was trained with.

    Raises:
        BundleError: config.json is missing or damaged, or has options that no training takes.
    """
    file = folder / CONFIG
    content = read_json(file)
    said = content.get("options") if isinstance(content, dict) else None
    known = {each.name for each in fields(TrainOptions)}
    if not isinstance(said, dict) or set(said) != known:
        raise BundleError(f"{file}: its options are not those of this toonset; train again")
    try:
        options = TrainOptions(**said)
        options.check()
    except UsageError as error:
        raise BundleError(f"{file}: options: {error}; train again") from error
    return options


def _record(file: Path) -> FieldRecord:
    content = read_json(file)
    try:
        written = _Format.model_validate(content).format
        if written != FORMAT:
            raise BundleError(f"{file}: format {written}, this toonset reads {FORMAT}; train again")
        record = _Config.model_validate(content).field
    except ValidationError as error:
        raise BundleError(f"{file}: {validation_reason(error)}") from error
    if not all(1 <= n <= MOST_CELLS for n in record.hull_shape):
        raise BundleError(
            f"{file}: hull_shape {record.hull_shape}, 1 to {MOST_CELLS} is needed; train again"
        )
    if record.step * MOST_ALONG < record.hull_voxel * max(record.hull_shape):
        raise BundleError(
            f"{file}: step {record.step:g} cuts the hull into more than {MOST_ALONG}; train again"
        )
    if 0 < record.k < 1 / LARGEST:
        raise BundleError(f"{file}: k {record.k:g}, 0 or {1 / LARGEST:g} is needed; train again")
    if record.palette is not None and not all(0 <= v <= 255 for c in record.palette for v in c):
        raise BundleError(f"{file}: a palette value is not in 0..255; train again")
    return record


def _empty(record: FieldRecord) -> TrainedField:
    low = np.array(record.hull_low)
    hull = Hull(low, record.hull_voxel, torch.zeros(record.hull_shape))
    field = TriplaneField(hull.box, record.resolution, record.channels, record.hidden)
    palette = None if record.palette is None else np.array(record.palette, dtype=np.uint8)
    classifier = None if palette is None else PaletteClassifier(len(palette))
    return TrainedField(
        field, hull, record.step, record.samples, classifier, palette, record.k, record.size_px
    )
