"""Views of bundles and data sets as a PyTorch `Dataset`: pictures, labels and cameras as tensors.

Everything but the pictures is read, and checked, when the data set is opened; a picture is decoded
when its view is asked for, in whichever worker asks. No file stays open, so that a `DataLoader` may
fork or spawn its workers at any time. Parquet hands out whole row groups: views in their order are
read once, shuffled ones need a group each, for which the other formats are made.
"""

from __future__ import annotations

import math
import tarfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypedDict

import numpy as np
import torch
from jaxtyping import Float, Int64, UInt8
from pydantic import BaseModel, ConfigDict, Field
from torch import Tensor
from torch.utils.data import Dataset

from toonset.camera import Camera
from toonset.dataset.bundle.bundle import CALIBRATION, Bundle
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.camera_record import NativeCamera
from toonset.dataset.bundle.read_scene import (
    check_label_names,
    check_paints,
    check_size,
    label_name,
    read_palette_of,
)
from toonset.dataset.bundle.transforms_camera import camera_of, far_pinhole_of
from toonset.dataset.bundle.transforms_read import member, read_frames, transforms_file
from toonset.dataset.bundle.transforms_schema import (
    Focal,
    FrameRecord,
    Intrinsics,
    Row,
    read_records,
)
from toonset.dataset.images.picture import decode_indexed_png, decode_rgba
from toonset.errors import BundleError, CameraError, SetupError, UsageError, one_line
from toonset.json_file import read_json, validate
from toonset.palette.palette import Hex
from toonset.palette.pixels.labels import UNLABELLED
from toonset.read import parse_json, read_whole, schema_version

CARD, SCHEMA, VERSION = "card.json", "toonset-dataset", 1
METADATA = "metadata.jsonl"
ANGLES = ("yaw", "elevation", "roll")
PICTURES = ("image", "labels")  # columns of Parquet
MOST_BYTES = 512 * 2**20  # of a picture's file in a tar file
_Name = Annotated[str, Field(max_length=1024, pattern=r"^[^\x00-\x1f\x7f]+$")]  # of a file
Format = Literal["webdataset", "parquet", "folder"]
Split = Literal["train", "val", "test"]


class ViewItem(TypedDict):
    """One view; the module `toonset.camera` states all conventions.

    Attributes:
        name: sheet and picture, e.g. "knight/000.png"; of a bundle its folder is the sheet.
        image: sRGB in [0, 1], not multiplied by alpha.
        alpha: how far the figure covers a pixel, in [0, 1].
        labels: number of the palette colour, 255 = none (background, blends, no palette).
        K: intrinsics in pixels; the first pixel's centre is (0.5, 0.5).
        world_from_camera: pose, camera axes x right, y down, z forward. K and pose are those of a
            pinhole: the far one, 100 body heights away, where the view is orthographic.
        image_from_world: the exact projection of either kind: (u w, v w, w) of (x, y, z, 1); of an
            orthographic view its last row is 0 0 0 1.
        orthographic: whether it is.
        pinhole_error_px: by how much K and pose miss the exact projection, at most; 0 of pinholes.
        sigma: one standard deviation of yaw, elevation and roll, radians; NaN where a folder has
            no calibration.
        size_wh: width and height of the picture itself, without padding.
    """

    name: str
    image: Float[Tensor, "3 height width"]
    alpha: Float[Tensor, "1 height width"]
    labels: Int64[Tensor, "height width"]
    K: Float[Tensor, "3 3"]
    world_from_camera: Float[Tensor, "4 4"]
    image_from_world: Float[Tensor, "3 4"]
    orthographic: bool
    pinhole_error_px: float
    sigma: Float[Tensor, " 3"]
    size_wh: Int64[Tensor, " 2"]


class ViewDataset(Dataset[ViewItem]):
    """Views of a bundle, or of a data set that `toonset pack` wrote, one after the other.

    Pictures and alpha are float32, cameras float64, for a far pinhole's numbers are large. Views
    differ in size: without `padded`, load them one by one (`batch_size=None`) or as lists
    (`collate_fn=list`). Several bundles: `torch.utils.data.ConcatDataset`.

    Attributes:
        source: the folder.
        largest_wh: of any picture.
    """

    def __init__(
        self, source: str | Path | Bundle, *, split: Split | None = None, padded: bool = False
    ) -> None:
        """Read the values of all views.

        Args:
            source: a bundle, its folder, any folder with a transforms.json and RGBA pictures, or
                the folder of a data set (webdataset, parquet or folder).
            split: of a data set that has several: "train", "val" or "test".
            padded: give all pictures the size of the largest, with nothing at their right and
                lower edges; pixels and cameras stay as they are.

        Raises:
            BundleError: a file is missing, damaged, or leads out of the folder.
            UsageError: there is no such split, or several and none is named.
            SetupError: pyarrow is needed and missing.
        """
        self.source = source.folder if isinstance(source, Bundle) else Path(source)
        self._views = _views_of(self.source, split)
        sizes = [view.camera.size_wh for view in self._views]
        self.largest_wh = (max(w for w, _ in sizes), max(h for _, h in sizes))
        self._padded = padded

    def __len__(self) -> int:
        """Return the number of views."""
        return len(self._views)

    def __iter__(self) -> Iterator[ViewItem]:
        """Return the views in their order."""
        return (self[number] for number in range(len(self)))

    def __repr__(self) -> str:
        """Return where it is from and how many views it has."""
        return f"ViewDataset({str(self.source)!r}, {len(self)} views)"

    def __getitem__(self, index: int) -> ViewItem:
        """Return a view; negative numbers count from the end.

        Raises:
            IndexError: there is no such view.
            BundleError: a picture is gone, or of another size than its camera says.
            PictureError: it cannot be decoded.
        """
        view = self._views[index]
        rgba, labels = view.pixels()
        if self._padded:
            size_wh = self.largest_wh
            rgba, labels = _padded(rgba, size_wh, 0), _padded(labels, size_wh, UNLABELLED)
        planes = torch.from_numpy(np.ascontiguousarray(rgba.transpose(2, 0, 1))).float() / 255
        far = view.far_pinhole
        return {
            "name": view.name,
            "image": planes[:3],
            "alpha": planes[3:],
            "labels": torch.from_numpy(labels.astype(np.int64)),
            "K": torch.from_numpy(far.K),
            "world_from_camera": torch.from_numpy(far.world_from_camera),
            "image_from_world": torch.from_numpy(_projection(view.camera)),
            "orthographic": view.camera.is_orthographic,
            "pinhole_error_px": view.pinhole_error_px,
            "sigma": torch.tensor(view.sigma, dtype=torch.float64),
            "size_wh": torch.tensor(view.camera.size_wh),
        }

    def palette(self, index: int) -> UInt8[Tensor, "colors 3"]:
        """Return the sRGB colours that a view's labels number; empty without a palette."""
        return torch.tensor(self._views[index].palette, dtype=torch.uint8).reshape(-1, 3)


@dataclass(frozen=True)
class _Stored:
    """Where a picture's file lies: a file itself, or a part of one.

    Attributes:
        file: that holds it.
        start: byte of a tar file at which it begins.
        size: in bytes; 0: the whole file.
        row: of a Parquet file, as row group and row in it.
        column: of a Parquet file.
    """

    file: Path
    start: int = 0
    size: int = 0
    row: tuple[int, int] | None = None
    column: str = ""

    def read(self) -> bytes:
        """Return the picture's file."""
        if self.row is not None:
            group, number = self.row
            table = _row_group(self.file, group, self.file.stat().st_mtime_ns)
            value = _arrow_checked(self.file, lambda: table.column(self.column)[number].as_py())
            if not value or not value["bytes"]:
                raise BundleError(f"{self.file}: row {number} of group {group} has no picture")
            return bytes(value["bytes"])
        if not self.size:
            return read_whole(self.file, "picture", BundleError)
        try:
            with open(self.file, "rb") as file:
                file.seek(self.start)
                return file.read(self.size)
        except OSError as error:
            raise BundleError(f"{self.file}: cannot be read ({error.strerror})") from error


@dataclass(frozen=True)
class _StoredView:
    """All of a view but its pixels."""

    name: str
    camera: Camera
    distance: float  # of the far pinhole, world units
    pinhole_error_px: float
    image: _Stored
    labels: _Stored | None = None
    palette: tuple[tuple[int, int, int], ...] = ()
    sigma: tuple[float, ...] = field(default=(math.nan,) * len(ANGLES))

    @property
    def far_pinhole(self) -> Camera:
        return self.camera.as_pinhole(self.distance)

    def pixels(self) -> tuple[UInt8[np.ndarray, "h w 4"], UInt8[np.ndarray, "h w"]]:
        """Return picture and labels, checked against camera and palette."""
        where = self.image.file if not self.image.size else Path(f"{self.image.file}: {self.name}")
        rgba = decode_rgba(self.image.read(), where)
        check_size(where, rgba, self.camera, "its camera")
        if self.labels is None:
            return rgba, np.full(rgba.shape[:2], UNLABELLED, np.uint8)
        labels = decode_indexed_png(self.labels.read(), where)
        check_size(where, labels, self.camera, "its camera")
        check_paints(where, labels, len(self.palette), "label")
        return rgba, labels


def _views_of(source: Path, split: Split | None) -> list[_StoredView]:
    if source.is_dir() and member(source, CARD) is not None:
        return list(_packed(source, split))
    if split is not None:
        raise UsageError(f"{source}: has no {CARD}, a bundle has no splits; leave split out")
    return _of_bundle(source)


def _projection(camera: Camera) -> Float[np.ndarray, "3 4"]:
    """Return the matrix of the exact camera: see `toonset.camera`, both sides times 1 + k z."""
    local = np.column_stack([camera.rotation, -camera.rotation @ camera.target])
    w = camera.k * local[2] + [0, 0, 0, 1]
    u, v = camera.scale_uv[:, None] * local[:2] + camera.center[:, None] * w
    return np.stack([u, v, w])


def _padded(pixels: np.ndarray, size_wh: tuple[int, int], value: int) -> np.ndarray:
    """Return a picture with room at the right and below."""
    width, height = size_wh
    room = ((0, height - pixels.shape[0]), (0, width - pixels.shape[1]))
    return np.pad(pixels, (*room, *((0, 0),) * (pixels.ndim - 2)), constant_values=value)


# ---- bundles -------------------------------------------------------------------------------------


def _of_bundle(source: Path) -> list[_StoredView]:
    """Return the views of a bundle, or of a folder with a transforms.json."""
    file = transforms_file(source)
    root, posed, records = file.parent, read_frames(file, need_pictures=True), read_records(file)
    palette = read_palette_of(root)
    colors = () if palette is None else tuple(color.rgb for color in palette.colors)
    if palette is not None:
        check_label_names(file, posed)
    sigmas = _sigmas_of(root)
    views = []
    for frame, record in zip(posed, records.frames, strict=True):
        assert frame.picture is not None  # read_frames has seen to it
        name = Path(frame.file_path).name
        map_file = member(root, f"labels/{label_name(frame)}") if colors else None
        labels = None if map_file is None else _Stored(map_file)
        sigma = sigmas.get(name, (math.nan,) * len(ANGLES))
        called = f"{file.resolve().parent.name}/{name}"
        stored = _Stored(frame.picture)
        views.append(_view(called, record, frame.camera, stored, labels, colors, sigma))
    return views


def _sigmas_of(root: Path) -> dict[str, tuple[float, ...]]:
    """Return the angles' sigmas by picture, radians; empty without calibration.json."""
    file = member(root, CALIBRATION)
    views = () if file is None else read_calibration(file).views
    return {v.name: _radians([getattr(v.sigma, f"{a}_deg") for a in ANGLES]) for v in views}


def _radians(degrees: Sequence[float]) -> tuple[float, ...]:
    return tuple(math.radians(angle) for angle in degrees)


def _view(
    name: str,
    record: FrameRecord,
    camera: Camera,
    image: _Stored,
    labels: _Stored | None,
    palette: Sequence[tuple[int, int, int]],
    sigma: tuple[float, ...],
) -> _StoredView:
    """Return a view; its far pinhole stands where transforms.json has it."""
    if not camera.is_orthographic:
        return _StoredView(name, camera, 1 / camera.k, 0.0, image, labels, tuple(palette), sigma)
    distance, error_px = far_pinhole_of(camera, record)
    return _StoredView(name, camera, distance, error_px, image, labels, tuple(palette), sigma)


# ---- data sets of `toonset pack` -----------------------------------------------------------------


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


def _packed(source: Path, split: Split | None) -> Iterator[_StoredView]:
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


def _from_values(
    where: str, values: _Values, image: _Stored, labels: _Stored | None
) -> _StoredView:
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
    sigma = _radians([values.sigma_yaw_deg, values.sigma_elevation_deg, values.sigma_roll_deg])
    if colors and labels is None:
        raise BundleError(f"{where}: has a palette but no labels; copy the data set again")
    return _view(name, record, camera, image, labels if colors else None, colors, sigma)


def _in_folder(folder: Path) -> Iterator[_StoredView]:
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
            stored.append(None if found is None else _Stored(found))
        if stored[0] is None:
            raise BundleError(f"{where}: has no file_name; copy the data set again")
        yield _from_values(where, values, stored[0], stored[1])


def _in_tar(file: Path) -> Iterator[_StoredView]:
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


def _part(file: Path, info: tarfile.TarInfo) -> _Stored:
    return _Stored(file, info.offset_data, info.size)


def _in_parquet(file: Path) -> Iterator[_StoredView]:
    with _parquet_of(file) as parquet:
        there = _arrow_checked(file, lambda: parquet.schema_arrow.names)
        if not set(PICTURES) <= set(there):
            raise BundleError(f"{file}: has no columns {' and '.join(PICTURES)}; pack it again")
        columns = [name for name in there if name not in PICTURES]
        for group in range(parquet.num_row_groups):
            rows = _arrow_checked(file, _rows_of, parquet, group, columns)
            for number, content in enumerate(rows):
                at = (group, number)
                image, labels = (_Stored(file, row=at, column=name) for name in PICTURES)
                where = f"{file}: row {number} of group {group}"
                yield _from_values(where, validate(_Values, content, Path(where)), image, labels)


def _rows_of(parquet: Any, group: int, columns: Sequence[str]) -> list[dict[str, Any]]:
    return parquet.read_row_group(group, columns=columns).to_pylist()


def _parquet_of(file: Path) -> Any:
    """Open a Parquet file."""
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise SetupError(f"{file}: needs pyarrow: pip install 'toonset[parquet]'") from error
    return _arrow_checked(file, parquet.ParquetFile, file)


def _arrow_checked(file: Path, call: Any, *arguments: Any, **named: Any) -> Any:
    from pyarrow import ArrowException

    try:
        return call(*arguments, **named)
    except (ArrowException, OSError, KeyError, ValueError) as error:
        reason = one_line(str(error).partition("\n")[0] or type(error).__name__)
        raise BundleError(f"{file}: is no whole Parquet file ({reason}); copy it again") from error


@lru_cache(maxsize=2)
def _row_group(file: Path, group: int, changed_ns: int) -> Any:
    """Return the pictures of a row group; each process keeps the last two."""
    with _parquet_of(file) as parquet:
        return _arrow_checked(file, parquet.read_row_group, group, columns=list(PICTURES))
