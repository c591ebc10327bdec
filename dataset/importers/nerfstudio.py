"""Read nerfstudio, instant-ngp and NeRF-synthetic folders for an import."""

from __future__ import annotations

from pathlib import Path

from toonset.dataset.bundle.transforms_read import read_frames
from toonset.dataset.bundle.transforms_schema import FrameRecord, read_records
from toonset.dataset.importers.paths import ImportView, find_picture
from toonset.errors import BundleError

SPLITS = ("train", "val", "test")


def transforms_files(path: Path) -> tuple[Path, ...]:
    """Return the transforms files of a path: itself, transforms.json, or the three of a scene."""
    if path.suffix.lower() == ".json" and path.is_file():
        return (path,)
    if (path / "transforms.json").is_file():
        return (path / "transforms.json",)
    files = (path / f"transforms_{split}.json" for split in SPLITS)
    return tuple(file for file in files if file.is_file())


def read_transforms(files: tuple[Path, ...]) -> list[ImportView]:
    """Return every picture of the files once, in file order.

    Raises:
        BundleError: a file is broken, is a bundle already, or its cameras cannot be honoured.
    """
    views: dict[Path, ImportView] = {}
    for file in files:
        records = read_records(file).frames
        if any(record.toonset is not None for record in records):
            raise BundleError(
                f"{file}: is of a bundle already (its frames have a `toonset` key); use it as it "
                "is, or copy the folder"
            )
        frames = read_frames(file, need_pictures=True)
        for record, frame in zip(records, frames, strict=True):
            assert frame.picture is not None  # need_pictures
            name = str(frame.picture.relative_to(file.parent))
            mask = _mask(file, record)
            view = ImportView(name, frame.camera, frame.picture, mask)
            views.setdefault(frame.picture.resolve(), view)
    return list(views.values())


def _mask(file: Path, record: FrameRecord) -> Path | None:
    """Return the mask that nerfstudio's `mask_path` names."""
    named = (record.model_extra or {}).get("mask_path")
    if named is None:
        return None
    where = f"{file}: mask_path of {record.file_path[:80]!r}"
    if not isinstance(named, str):
        raise BundleError(f"{where}: is no text; correct the file")
    return find_picture([file.parent], named, where)
