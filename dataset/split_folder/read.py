"""Read a split folder back, after a person may have corrected it.

images/ says which views there are, in the natural order of their names, and what they show;
split.json only knows where a picture came from. When both disagree:

- a picture is gone: the view is left out;
- a picture was renamed: it keeps its box and label, its name gives its place in the order;
- a picture was repainted at the same size: it keeps its box and label, its line is measured again;
- a picture was repainted at another size, or is new: it is a sheet of its own, of one figure;
- a crop's size was changed: refused, the picture is cut already (`--boxes split.json` cuts anew).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.images.folder import picture_files
from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.silhouettes.line_width import contour_width_px
from toonset.dataset.split.background import is_transparent
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.split_folder.places import IMAGES, SPLIT_FILE
from toonset.dataset.split_folder.views import Source, Split, numbered
from toonset.dataset.split_folder.write import ViewRecord, read_records
from toonset.errors import PictureError, SheetError
from toonset.read import read_whole
from toonset.view import View

OPAQUE = 128  # alpha from which a pixel is the figure's


@dataclass(frozen=True, eq=False)
class _Picture:
    """A file of images/ and what split.json says of it, if anything."""

    path: Path
    data: bytes
    record: ViewRecord | None = None

    @property
    def digest(self) -> str:
        return sha256(self.data).hexdigest()

    @property
    def shown(self) -> str:
        return f"{IMAGES}/{self.path.name}"


def read_split(folder: Path) -> tuple[Split, tuple[str, ...]]:
    """Return the views of a split folder, and what has been changed in it, for people.

    Raises:
        SheetError: split.json is broken, a picture holds no figure or several, or a box was
            changed.
        PictureError: a picture cannot be read, or is a link that leads out of the folder.
    """
    sources, records = read_records(folder)
    pictures, others = _pictures(folder)
    pictures, gone = _matched(pictures, records)
    notes = [f"{folder}: {IMAGES}/{record.name} is gone: the view is left out" for record in gone]
    notes += [f"{folder}: {IMAGES}/{name} is no picture: left out" for name in others]
    found = list(sources)
    views, source_of = [], []
    for picture in pictures:
        view, source, note = _view(folder, picture)
        if source is not None:
            found.append(source)
        record = picture.record
        source_of.append(len(found) - 1 if source or record is None else record.sheet)
        said = (record.label, record.caption) if record else ("", "")
        views.append(replace(view, label=said[0] or "", caption=said[1] or ""))
        notes += [f"{folder}: {picture.shown} {note}"] if note else []
    return Split(tuple(found), numbered(views), tuple(source_of)), tuple(notes)


def _pictures(folder: Path) -> tuple[list[_Picture], tuple[str, ...]]:
    if not (folder / IMAGES).is_dir():
        raise SheetError(f"{folder}: has no folder {IMAGES}; split the sheet again")
    paths, others = picture_files(folder / IMAGES)
    if not paths:
        raise SheetError(f"{folder / IMAGES}: holds no picture; split the sheet again")
    for path in paths:
        if not path.resolve().is_relative_to(folder.resolve()):
            raise PictureError(f"{path}: is a link that leads out of {folder}; put a copy there")
    read = [_Picture(path, read_whole(path, "picture", PictureError)) for path in paths]
    return read, others


def _matched(
    pictures: list[_Picture], records: tuple[ViewRecord, ...]
) -> tuple[list[_Picture], list[ViewRecord]]:
    """Return the pictures with their records, and the records without a picture.

    The same file comes first, whatever its name is now; then the same name.
    """
    free = list(records)
    found: dict[int, ViewRecord] = {}
    rules: tuple[Callable[[_Picture, ViewRecord], bool], ...] = (
        lambda p, r: p.digest == r.sha256 and p.path.name == r.name,
        lambda p, r: p.digest == r.sha256,
        lambda p, r: p.path.name == r.name,
    )
    for is_same in rules:
        for index, picture in enumerate(pictures):
            if index in found:
                continue
            record = next((r for r in free if is_same(picture, r)), None)
            if record is not None:
                found[index] = record
                free.remove(record)
    return [_Picture(p.path, p.data, found.get(i)) for i, p in enumerate(pictures)], free


def _view(folder: Path, picture: _Picture) -> tuple[View, Source | None, str]:
    """Return a view, its sheet where that is no longer split.json's, and what was changed."""
    rgba = decode_rgba(picture.data, picture.path)
    height, width = rgba.shape[:2]
    record, name = picture.record, picture.path.name
    same_size = record is not None and record.crop[2:] == (width, height)
    if record is not None and picture.digest == record.sha256:
        if not same_size:
            raise SheetError(
                f"{folder / SPLIT_FILE}: {record.name}: its crop is {record.crop[2]} x "
                f"{record.crop[3]} px, its picture {width} x {height}; correct it, or cut the "
                f"sheet anew with `toonset split SHEET --boxes {SPLIT_FILE}`"
            )
        note = "" if name == record.name else f"was {record.name}: it keeps its box and label"
        return View(rgba, record.crop, record.line_width_px, name), None, note
    figure = _figure(rgba, picture.path)
    line = contour_width_px(figure)
    if record is not None and same_size:
        note = f"was repainted: its line width is now {line:.1f} px"
        return View(figure, record.crop, line, name), None, note
    note = f"is not from the sheet: its place is unknown ({width} x {height} px)"
    source = Source(picture.shown, picture.digest, (width, height))
    return View(figure, (0, 0, width, height), line, name), source, note


def _figure(rgba: UInt8[np.ndarray, "height width 4"], path: Path) -> np.ndarray:
    """Return a repainted picture with the paper round its figure see-through."""
    if not (rgba[..., 3] >= OPAQUE).any():
        raise SheetError(f"{path}: shows nothing opaque; paint the figure, or delete the file")
    if is_transparent(rgba):
        return rgba
    try:
        sheet = split_picture(rgba)
    except SheetError as error:
        raise SheetError(f"{path}: {error}") from error
    if len(sheet.views) != 1:
        raise SheetError(
            f"{path}: shows {len(sheet.views)} figures, one is needed; erase the others, or split "
            "it like a sheet"
        )
    cut = np.zeros_like(rgba)
    x, y, width, height = sheet.views[0].box
    cut[y : y + height, x : x + width] = sheet.views[0].rgba
    return cut
