"""Read the data sets of `toonset pack`: card.json says which files hold the views of a split."""

from __future__ import annotations

import tarfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.transforms_camera import camera_of
from toonset.dataset.bundle.transforms_read import member
from toonset.dataset.bundle.transforms_schema import Focal, FrameRecord, Intrinsics, Row
from toonset.dataset.stored_views import (
    PICTURES,
    Stored,
    StoredView,
    arrow_checked,
    parquet_of,
    radians,
    stored_view,
)
from toonset.errors import BundleError, CameraError, UsageError, one_line
from toonset.json_file import read_json, validate
from toonset.palette.palette import Hex
from toonset.read import parse_json, read_whole, schema_version

CARD, SCHEMA, VERSION = "card.json", "toonset-dataset", 1
METADATA = "metadata.jsonl"
MOST_BYTES = 512 * 2**20  # of a picture's file in a tar file
_Name = Annotated[str, Field(max_length=1024, pattern=r"^[^\x00-\x1f\x7f]+$")]  # of a file
Format = Literal["webdataset", "parquet", "folder"]
Split = Literal["train", "val", "test"]


class _File(BaseModel):
    name: _Name
    views: int = Field(ge=1)


class _SplitFiles(BaseModel):
    files: list[_File]


class _Card(BaseModel):
    format: Format
    splits: dict[Split, _SplitFiles] = Field(min_length=1)


class _Color(BaseModel):
    hex: Hex


class _Values(BaseModel):
    """What a loader needs of a view's values; other keys are for other readers."""

    model_config = ConfigDict(allow_inf_nan=False)
    sheet: str = Field(pattern=r"^[\w-]+$", max_length=255)
    view: int = Field(ge=0)
    transform_matrix: tuple[Row, Row, Row, Row]
    fl_x: Focal
    fl_y: Focal
    cx: float
    cy: float
    w: int
    h: int
    camera: NativeCamera
    sigma_yaw_deg: float = Field(ge=0)
    sigma_elevation_deg: float = Field(ge=0)
    sigma_roll_deg: float = Field(ge=0)
    palette: list[_Color]
    file_name: _Name | None = None  # of a folder
    labels_file_name: _Name | None = None


def views_of_pack(source: Path, split: Split | None) -> Iterator[StoredView]:
    """Yield the views of a data set's split."""
    place = source / CARD
    content = read_json(place)
    if schema_version(content, SCHEMA, VERSION, str(place), BundleError) is None:
        raise BundleError(f"{place}: states no schema; pack the data set again")
    card = validate(_Card, content, place)
    there = ", ".join(card.splits)
    if split is None and len(card.splits) > 1:
        raise UsageError(f"{source}: has the splits {there}; name one: split=...")
    chosen = next(iter(card.splits)) if split is None else split
    if chosen not in card.splits:
        raise UsageError(f"{source}: has no split {chosen!r}, but {there}; name one of them")
    readers = {"webdataset": _in_tar, "parquet": _in_parquet, "folder": _in_folder}
    for file in card.splits[chosen].files:
        found = member(source, file.name)
        if found is None:
            raise BundleError(f"{source / file.name}: is missing; copy the data set again")
        views = list(readers[card.format](found))
        if len(views) != file.views:
            raise BundleError(
                f"{found}: has {len(views)} views, {CARD} says {file.views}; copy it again"
            )
        yield from views


def _from_values(where: str, values: _Values, image: Stored, labels: Stored | None) -> StoredView:
    name = f"{values.sheet}/{values.view:03d}.png"
    pinhole = values.model_dump(include={"fl_x", "fl_y", "cx", "cy", "w", "h"})
    record = FrameRecord(
        file_path=name, transform_matrix=values.transform_matrix, toonset=values.camera, **pinhole
    )
    try:
        camera = camera_of(Intrinsics(), record, None)
    except (CameraError, BundleError) as error:
        raise BundleError(f"{where}: {error}; copy the data set again") from error
    colors = [color.hex for color in values.palette]
    sigma = radians([values.sigma_yaw_deg, values.sigma_elevation_deg, values.sigma_roll_deg])
    if colors and labels is None:
        raise BundleError(f"{where}: has a palette but no labels; copy the data set again")
    return stored_view(name, record, camera, image, labels if colors else None, colors, sigma)


def _in_folder(folder: Path) -> Iterator[StoredView]:
    file = folder / METADATA
    for number, line in enumerate(read_whole(file, "JSON", BundleError).splitlines(), 1):
        where = f"{file}: line {number}"
        content = parse_json(line, where, BundleError)
        values = validate(_Values, content, Path(where))
        stored = []
        for name in (values.file_name, values.labels_file_name):
            found = None if name is None else member(folder, name)
            if name is not None and found is None:
                raise BundleError(f"{folder / name}: is missing; copy the data set again")
            stored.append(None if found is None else Stored(found))
        if stored[0] is None:
            raise BundleError(f"{where}: has no file_name; copy the data set again")
        yield _from_values(where, values, stored[0], stored[1])


def _in_tar(file: Path) -> Iterator[StoredView]:
    held: dict[str, dict[str, tarfile.TarInfo]] = {}
    try:
        with tarfile.open(file, "r:") as tar:
            for info in tar:
                key, _, end = info.name.partition(".")
                if not info.isreg() or not 0 < info.size <= MOST_BYTES:
                    raise BundleError(f"{file}: {info.name!r} is no file of a view")
                held.setdefault(key, {})[end] = info
            for key, parts in held.items():
                where = f"{file}: {key}"
                if "png" not in parts or "json" not in parts:
                    raise BundleError(f"{where}: has no picture or no values")
                source = tar.extractfile(parts["json"])
                assert source is not None  # a regular file
                content = parse_json(source.read(), where, BundleError)
                image, labels = _part(file, parts["png"]), parts.get("labels.png")
                stored = None if labels is None else _part(file, labels)
                yield _from_values(where, validate(_Values, content, Path(where)), image, stored)
    except (tarfile.TarError, OSError, EOFError) as error:
        reason = one_line(error)
        raise BundleError(f"{file}: is no whole tar file ({reason}); copy it again") from error


def _part(file: Path, info: tarfile.TarInfo) -> Stored:
    return Stored(file, info.offset_data, info.size)


def _in_parquet(file: Path) -> Iterator[StoredView]:
    with parquet_of(file) as parquet:
        there = arrow_checked(file, lambda: parquet.schema_arrow.names)
        if not set(PICTURES) <= set(there):
            raise BundleError(f"{file}: has no columns {' and '.join(PICTURES)}; pack it again")
        columns = [name for name in there if name not in PICTURES]
        for group in range(parquet.num_row_groups):
            rows = arrow_checked(file, _rows_of, parquet, group, columns)
            for number, content in enumerate(rows):
                at = (group, number)
                image, labels = (Stored(file, row=at, column=name) for name in PICTURES)
                where = f"{file}: row {number} of group {group}"
                yield _from_values(where, validate(_Values, content, Path(where)), image, labels)


def _rows_of(parquet: Any, group: int, columns: Sequence[str]) -> list[dict[str, Any]]:
    return parquet.read_row_group(group, columns=columns).to_pylist()
