"""Write sheets as a data set: WebDataset shards, Parquet shards, or folders.

    webdataset   a sample is one view: KEY.png, KEY.labels.png, KEY.json, with KEY = SHEET-000
    parquet      a row is one view: picture and label map as columns, and a column for every value
    folder       a folder is one sheet, a scene as nerfstudio and toonset read it; metadata.jsonl
                 has a line for every view

A view is the sample, for it is what a loader decodes and a batch of rays is drawn from, and all
that is known of the sheet stands in each: no sample needs another one. WebDataset splits names at
the first dot, so pictures of one sheet under one key could not be told from kinds of files. A
sheet's views follow each other in order and lie in one shard, so a loader that wants whole sheets
groups neighbours by `sheet`. A folder is for people and for programs that take one scene, so there
it is the sheet that has one.

The bytes depend on nothing but the sheets: their order is given, and files have no time or owner.
At most one shard's open part is in memory: a sheet, with Parquet a row group.
"""

from __future__ import annotations

import io
import json
import os
import tarfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from toonset.apps.batch.records import FIELDS, PackedView, SheetRecord
from toonset.dataset.bundle_files import IMAGES, LABELS
from toonset.errors import SetupError
from toonset.write import write_bytes

TAR_END = tarfile.RECORDSIZE  # a tar file is a multiple of it
ROW_GROUP = 32 * 2**20  # bytes of pictures that are read, and held here, at once
METADATA = "metadata.jsonl"
INSTALL_PARQUET = "pip install 'toonset[parquet]'"
PICTURES = ("image", "labels")  # columns with a file in each row
PICTURE = {"bytes": "binary", "path": "string"}

Put = Callable[[SheetRecord], None]
Opened = Callable[[BinaryIO], AbstractContextManager[Put]]


@dataclass(frozen=True)
class Shard:
    """One file of a data set, or a split's folder.

    Attributes:
        name: in the data set's folder.
        sheets: in it.
        views: in it.
        bytes: of it; of a folder those of all its files.
    """

    name: str
    sheets: int
    views: int
    bytes: int


def write_webdataset(
    folder: Path, split: str, sheets: Iterator[SheetRecord], most: int
) -> list[Shard]:
    """Write sheets as tar files of the WebDataset layout.

    Args:
        folder: a temporary one of `toonset.write.new_folder`.
        split: begins the files' names.
        sheets: in order.
        most: bytes of a shard; a larger sheet has a shard of its own.
    """
    return _write_shards(folder, split, "tar", sheets, most, _tar)


def write_parquet(
    folder: Path, split: str, sheets: Iterator[SheetRecord], most: int
) -> list[Shard]:
    """Write sheets as Parquet files that `datasets` decodes; arguments as `write_webdataset`.

    Raises:
        SetupError: pyarrow is missing.
    """
    check_parquet()
    return _write_shards(folder, split, "parquet", sheets, most, _parquet)


def write_folders(
    folder: Path, split: str, sheets: Iterator[SheetRecord], most: int
) -> list[Shard]:
    """Write sheets as folders, and a list of all views; arguments as `write_webdataset`.

    The list names pictures as `datasets` wants it of a folder of images; `most` says nothing here.
    """
    count = views = size = 0
    with _flushed(folder / split / METADATA) as listed:
        for sheet in sheets:
            for name, data in _scene(sheet):
                write_bytes(folder / split / sheet.name / name, data)
                size += len(data)
            for view in sheet.views:
                listed.write(json.dumps(_line(sheet, view), allow_nan=False).encode() + b"\n")
            count, views = count + 1, views + len(sheet.views)
        size += listed.tell()
    return [Shard(split, count, views, size)]


def check_parquet() -> None:
    """Refuse Parquet, before any work, where it cannot be written.

    Raises:
        SetupError: pyarrow is missing.
    """
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        raise SetupError(f"--to parquet needs pyarrow: {INSTALL_PARQUET}") from error


@contextmanager
def _flushed(path: Path) -> Iterator[BinaryIO]:
    """Yield a new file of a temporary folder; on disk when the block ends."""
    path.parent.mkdir(exist_ok=True)
    with open(path, "xb") as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def _write_shards(
    folder: Path, split: str, end: str, sheets: Iterator[SheetRecord], most: int, opened: Opened
) -> list[Shard]:
    """Write sheets into files until each is full."""
    shards: list[Shard] = []
    sheet = next(sheets, None)
    while sheet is not None:
        count, views, size = 0, 0, TAR_END
        path = folder / f"{split}-{len(shards):06d}.{end}"
        with _flushed(path) as file, opened(file) as put:
            while sheet is not None and (count == 0 or size + sheet.size <= most):
                put(sheet)
                count, views, size = count + 1, views + len(sheet.views), size + sheet.size
                sheet = next(sheets, None)
        shards.append(Shard(path.name, count, views, path.stat().st_size))
    return shards


# ---- webdataset ----------------------------------------------------------------------------------


@contextmanager
def _tar(file: BinaryIO) -> Iterator[Put]:
    """Yield what adds a sheet to a tar file."""
    with tarfile.open(fileobj=file, mode="w", format=tarfile.PAX_FORMAT) as tar:
        yield partial(_add_members, tar)


def _add_members(tar: tarfile.TarFile, sheet: SheetRecord) -> None:
    for view in sheet.views:
        for end, data in view.parts:
            member = tarfile.TarInfo(f"{view.key}.{end}")  # of root, of 1970
            member.size = len(data)
            tar.addfile(member, io.BytesIO(data))


# ---- parquet -------------------------------------------------------------------------------------


@contextmanager
def _parquet(file: BinaryIO) -> Iterator[Put]:
    """Yield what adds a sheet to a Parquet file."""
    from pyarrow import Table, parquet

    schema, rows, held = parquet_schema(), list[dict[str, Any]](), 0
    plain = [name for name, kind in FIELDS.items() if isinstance(kind, str)]
    texts = [name for name in plain if FIELDS[name] == "string"]
    how: dict[str, Any] = {"use_dictionary": texts, "write_statistics": plain}  # never of pictures

    def flush() -> None:
        nonlocal held
        if rows:
            writer.write_table(Table.from_pylist(rows, schema))
        rows.clear()
        held = 0

    def put(sheet: SheetRecord) -> None:
        nonlocal held
        rows.extend(map(_row, sheet.views))
        held += sheet.size
        if held >= ROW_GROUP:
            flush()

    with parquet.ParquetWriter(file, schema, compression="zstd", **how) as writer:
        yield put
        flush()


def _row(view: PackedView) -> dict[str, Any]:
    image = {"bytes": view.image, "path": f"{view.key}.png"}
    labels = view.labels and {"bytes": view.labels, "path": f"{view.key}.labels.png"}
    return {"image": image, "labels": labels, **view.values}


def parquet_schema() -> Any:
    """Return the columns, with the features of `datasets` as it writes them itself."""
    import pyarrow

    columns = {**{name: PICTURE for name in PICTURES}, **FIELDS}
    features = {name: _feature(kind) for name, kind in FIELDS.items()}
    features = {**{name: {"_type": "Image"} for name in PICTURES}, **features}
    said = json.dumps({"info": {"features": features}})
    fields = [(name, _arrow(kind)) for name, kind in columns.items()]
    return pyarrow.schema(fields, metadata={"huggingface": said})


def _arrow(kind: Any) -> Any:
    """Return the Arrow type of a value."""
    import pyarrow

    if isinstance(kind, list):
        return pyarrow.list_(_arrow(kind[0]))
    if isinstance(kind, Mapping):
        return pyarrow.struct([(name, _arrow(one)) for name, one in kind.items()])
    return pyarrow.type_for_alias(kind)


def _feature(kind: Any) -> Any:
    """Return the feature of a value, as every version of `datasets` reads it."""
    if isinstance(kind, list):
        return [_feature(kind[0])]
    if isinstance(kind, Mapping):
        return {name: _feature(one) for name, one in kind.items()}
    return {"dtype": kind, "_type": "Value"}


# ---- folder --------------------------------------------------------------------------------------


def _scene(sheet: SheetRecord) -> Iterator[tuple[str, bytes]]:
    """Yield the files of a sheet's folder."""
    yield from sheet.files.items()
    for view in sheet.views:
        yield f"{IMAGES}/{view.name}", view.image
        if view.labels is not None:
            yield f"{LABELS}/{view.label_name}", view.labels


def _line(sheet: SheetRecord, view: PackedView) -> dict[str, Any]:
    """Return a view's line of the list."""
    names = {"file_name": f"{sheet.name}/{IMAGES}/{view.name}"}
    if view.labels is not None:
        names["labels_file_name"] = f"{sheet.name}/{LABELS}/{view.label_name}"
    return {**names, **view.values}
