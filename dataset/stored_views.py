"""Views on disk: all of a view but its pixels, which are decoded when they are asked for.

A picture is a file, a part of a tar file, or a cell of a Parquet file. No file stays open, so that
processes may fork or spawn at any time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.dataset.bundle.bundle import CALIBRATION
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.read_scene import (
    check_label_names,
    check_paints,
    check_size,
    label_name,
    read_palette_of,
)
from toonset.dataset.bundle.transforms_camera import far_pinhole_of
from toonset.dataset.bundle.transforms_read import member, read_frames, transforms_file
from toonset.dataset.bundle.transforms_schema import FrameRecord, read_records
from toonset.dataset.images.picture import decode_indexed_png, decode_rgba
from toonset.errors import BundleError, SetupError, one_line
from toonset.palette.pixels.labels import UNLABELLED
from toonset.read import read_whole

ANGLES = ("yaw", "elevation", "roll")
PICTURES = ("image", "labels")  # columns of Parquet


@dataclass(frozen=True)
class Stored:
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

    def where(self, name: str) -> Path:
        """Return what messages call the picture of a view."""
        whole = self.row is None and not self.size
        return self.file if whole else Path(f"{self.file}: {name}")

    def read(self) -> bytes:
        """Return the picture's file.

        Raises:
            BundleError: it cannot be read.
        """
        if self.row is not None:
            group, number = self.row
            value = arrow_checked(self.file, _cell, self.file, group, number, self.column)
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
class StoredView:
    """All of a view but its pixels."""

    name: str
    camera: Camera
    distance: float  # of the far pinhole, world units
    pinhole_error_px: float
    image: Stored
    labels: Stored | None = None
    palette: tuple[tuple[int, int, int], ...] = ()
    sigma: tuple[float, ...] = field(default=(math.nan,) * len(ANGLES))

    @property
    def far_pinhole(self) -> Camera:
        """Return the pinhole that stands for an orthographic camera; a pinhole is itself."""
        return self.camera.as_pinhole(self.distance)

    def pixels(self) -> tuple[UInt8[np.ndarray, "h w 4"], UInt8[np.ndarray, "h w"]]:
        """Return picture and labels, checked against camera and palette.

        Raises:
            BundleError: one cannot be read, or has another size or more colours.
            PictureError: one cannot be decoded.
        """
        where = self.image.where(self.name)
        rgba = decode_rgba(self.image.read(), where)
        check_size(where, rgba, self.camera, "its camera")
        if self.labels is None:
            return rgba, np.full(rgba.shape[:2], UNLABELLED, np.uint8)
        where = self.labels.where(f"labels of {self.name}")
        labels = decode_indexed_png(self.labels.read(), where)
        check_size(where, labels, self.camera, "its camera")
        check_paints(where, labels, len(self.palette), "label")
        return rgba, labels


def views_of_bundle(source: Path) -> list[StoredView]:
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
        labels = None if map_file is None else Stored(map_file)
        sigma = sigmas.get(name, (math.nan,) * len(ANGLES))
        called = f"{file.resolve().parent.name}/{name}"
        stored = Stored(frame.picture)
        views.append(stored_view(called, record, frame.camera, stored, labels, colors, sigma))
    return views


def _sigmas_of(root: Path) -> dict[str, tuple[float, ...]]:
    """Return the angles' sigmas by picture, radians; empty without calibration.json."""
    file = member(root, CALIBRATION)
    views = () if file is None else read_calibration(file).views
    return {v.name: radians([getattr(v.sigma, f"{a}_deg") for a in ANGLES]) for v in views}


def radians(degrees: Sequence[float]) -> tuple[float, ...]:
    """Return angles in radians."""
    return tuple(math.radians(angle) for angle in degrees)


def stored_view(
    name: str,
    record: FrameRecord,
    camera: Camera,
    image: Stored,
    labels: Stored | None,
    palette: Sequence[tuple[int, int, int]],
    sigma: tuple[float, ...],
) -> StoredView:
    """Return a view; its far pinhole stands where transforms.json has it."""
    if not camera.is_orthographic:
        return StoredView(name, camera, 1 / camera.k, 0.0, image, labels, tuple(palette), sigma)
    distance, error_px = far_pinhole_of(camera, record)
    return StoredView(name, camera, distance, error_px, image, labels, tuple(palette), sigma)


def parquet_of(file: Path) -> Any:
    """Open a Parquet file."""
    try:
        from pyarrow import parquet
    except ImportError as error:
        raise SetupError(f"{file}: needs pyarrow: pip install 'toonset[parquet]'") from error
    return arrow_checked(file, parquet.ParquetFile, file)


def arrow_checked(file: Path, call: Any, *arguments: Any, **named: Any) -> Any:
    """Return the result of a call into pyarrow.

    Raises:
        BundleError: it cannot read the file.
    """
    from pyarrow import ArrowException

    try:
        return call(*arguments, **named)
    except (ArrowException, OSError, KeyError, ValueError) as error:
        reason = one_line(str(error).partition("\n")[0] or type(error).__name__)
        raise BundleError(f"{file}: is no whole Parquet file ({reason}); copy it again") from error


def _cell(file: Path, group: int, number: int, column: str) -> Any:
    return _row_group(file, group, file.stat().st_mtime_ns).column(column)[number].as_py()


@lru_cache(maxsize=2)
def _row_group(file: Path, group: int, changed_ns: int) -> Any:
    """Return the pictures of a row group; each process keeps the last two."""
    with parquet_of(file) as parquet:
        return arrow_checked(file, parquet.read_row_group, group, columns=list(PICTURES))
