"""Read the files of a bundle as applications need them: one by one, or all of a view as bytes.

What is in which file is in `toonset.dataset.bundle.bundle`; names and types that applications use
of it are passed on here, so that they know one module of bundles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toonset.dataset.bundle.bundle import CALIBRATION as CALIBRATION
from toonset.dataset.bundle.bundle import IMAGES as IMAGES
from toonset.dataset.bundle.bundle import LABELS as LABELS
from toonset.dataset.bundle.bundle import WRITTEN as WRITTEN
from toonset.dataset.bundle.bundle import mannequin_of as mannequin_of
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.calibration_schema import CalibrationFile as CalibrationFile
from toonset.dataset.bundle.calibration_schema import InputFile as InputFile
from toonset.dataset.bundle.calibration_schema import ViewRecord as ViewRecord
from toonset.dataset.bundle.palette_files import PALETTE_JSON as PALETTE_JSON
from toonset.dataset.bundle.palette_files import palette_title as palette_title
from toonset.dataset.bundle.read_scene import (
    check_label_names,
    label_name,
    read_labels,
    read_palette_of,
    read_picture,
)
from toonset.dataset.bundle.transforms_read import PosedPicture, place_in, read_frames
from toonset.dataset.bundle.transforms_read import member as member
from toonset.dataset.bundle.transforms_read import transforms_file as transforms_file
from toonset.dataset.bundle.transforms_schema import FrameRecord as FrameRecord
from toonset.dataset.bundle.transforms_schema import read_records
from toonset.errors import BundleError
from toonset.palette.formats.json import read_palette_json
from toonset.palette.palette import Palette
from toonset.read import read_whole

PNG = b"\x89PNG\r\n\x1a\n"
SAME_CAMERA = 1e-6  # relative: both files are written from the same numbers
PINHOLE = ("fl_x", "fl_y", "cx", "cy", "w", "h")


def calibration_of(folder: Path) -> CalibrationFile:
    """Return what a bundle's calibration.json says.

    Raises:
        BundleError: it is missing, damaged, or a link out of the folder.
    """
    return read_calibration(place_in(folder, CALIBRATION))


def palette_of(folder: Path) -> Palette | None:
    """Return the palette of a bundle; None before it is found.

    Raises:
        ToonsetError: its file is damaged, or a link out of the folder.
    """
    file = member(folder, PALETTE_JSON)
    return None if file is None else read_palette_json(file)


@dataclass(frozen=True, eq=False)
class ViewFiles:
    """One view of a bundle.

    Attributes:
        record: of its camera, in transforms.json.
        judged: the same in calibration.json, with how sure it is.
        image: its picture, a PNG.
        labels: its label map, a PNG; None without a palette.
    """

    record: FrameRecord
    judged: ViewRecord
    image: bytes
    labels: bytes | None


@dataclass(frozen=True, eq=False)
class BundleFiles:
    """The files of a bundle that `calibrate` has written.

    Attributes:
        folder: the bundle.
        transforms: its file of cameras.
        calibration: what calibration.json says.
        mend: what to do where a file is missing or foreign, for messages.
    """

    folder: Path
    transforms: Path
    calibration: CalibrationFile
    mend: str

    @classmethod
    def of(cls, folder: Path, mend: str) -> BundleFiles:
        """Return the files of a folder.

        Raises:
            BundleError: one is missing or damaged.
        """
        transforms = transforms_file(folder)
        calibration = read_calibration(_there(folder, CALIBRATION, mend))
        return cls(folder, transforms, calibration, mend)

    def read(
        self, *, with_palette: bool, decode: bool
    ) -> tuple[Palette | None, tuple[ViewFiles, ...]]:
        """Return the palette, if it is wanted, and the views in order.

        Args:
            with_palette: label maps, too; both must be there.
            decode: look into the pictures, too, and not only at their bytes.

        Raises:
            ToonsetError: a file is missing, damaged, or does not belong to the others.
        """
        frames = read_frames(self.transforms, need_pictures=True)
        records = read_records(self.transforms).frames
        self._check(records)
        palette = self._palette(frames) if with_palette else None
        views = []
        for frame, record, judged in zip(frames, records, self.calibration.views, strict=True):
            if decode:
                read_picture(frame, self.transforms)
            labels = None if palette is None else self._labels(frame, palette, decode=decode)
            views.append(ViewFiles(record, judged, self._png(record.file_path), labels))
        return palette, tuple(views)

    def contents(self, *, with_palette: bool) -> Mapping[str, bytes]:
        """Return the files about cameras and palette, by name."""
        names = (self.transforms.name, CALIBRATION, *((PALETTE_JSON,) if with_palette else ()))
        return {name: read_whole(self._there(name), "JSON", BundleError) for name in names}

    def _there(self, name: str) -> Path:
        return _there(self.folder, name, self.mend)

    def _png(self, name: str) -> bytes:
        file = self._there(name)
        data = read_whole(file, "picture", BundleError)
        if not data.startswith(PNG):
            raise BundleError(f"{file}: is no PNG; {self.mend}")
        return data

    def _palette(self, frames: list[PosedPicture]) -> Palette | None:
        self._there(PALETTE_JSON)
        palette = read_palette_of(self.folder)
        if palette is not None:
            check_label_names(self.transforms, frames)
        return palette

    def _labels(self, frame: PosedPicture, palette: Palette, *, decode: bool) -> bytes:
        name = f"{LABELS}/{label_name(frame)}"
        self._there(name)
        if decode:
            read_labels(self.folder, frame, len(palette.colors))
        return self._png(name)

    def _check(self, records: list[FrameRecord]) -> None:
        """Refuse cameras that `calibrate` has not written, or not together."""
        views = self.calibration.views
        whole = all(
            None not in (one.toonset, *(getattr(one, name) for name in PINHOLE)) for one in records
        )
        named = [f"{IMAGES}/{Path(view.name).name}" for view in views]
        same = named == [record.file_path for record in records] and all(
            _is_same(record, view) for record, view in zip(records, views, strict=True)
        )
        if not (whole and same):
            mend = self.mend.replace("copy it back", "copy both back")
            raise BundleError(f"{self.transforms}: has other cameras than {CALIBRATION}; {mend}")


def _there(folder: Path, name: str, mend: str) -> Path:
    """Return a file of the bundle."""
    found = member(folder, name)
    if found is None:
        raise BundleError(f"{folder / name}: is missing; {mend}")
    return found


def _is_same(record: FrameRecord, view: ViewRecord) -> bool:
    """Return whether both files say the same of a view's camera."""
    one, other = record.toonset, view.camera
    if one is None or one.size_wh != other.size_wh:
        return False
    left = [*one.rotation, one.target, one.center, [one.scale, one.k]]
    right = [*other.camera_from_world_rotation, other.target, other.center_px]
    right = [*right, [other.scale_px_per_unit, other.k]]
    return np.allclose(np.hstack(left), np.hstack(right), SAME_CAMERA, SAME_CAMERA)
