"""Load one character's pictures: of a bundle, a split folder, other folders, or loose files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.bundle.bundle import CALIBRATION
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.calibration_schema import CalibrationFile, ViewRecord
from toonset.dataset.bundle.palette_files import palette_title
from toonset.dataset.bundle.transforms_read import NAMES, picture_paths, place_in, transforms_file
from toonset.dataset.images.picture import load_rgba
from toonset.dataset.split.beside_views import Swatch
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.split_folder.places import is_split_folder, sheet_places
from toonset.dataset.split_folder.read import read_split
from toonset.errors import BundleError, PictureError, SheetError
from toonset.read import check_there
from toonset.view import SHEET, Box, InputFile

Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True, eq=False)
class Pictures:
    """The pictures of one character.

    Attributes:
        names: file name of each picture's label map.
        pictures: the character on transparent ground.
        notes: what a person should know of the files.
        title: what to call the character: its sheet's name, or the folder's.
        places: where each picture lies in which sheet; None where nobody has recorded it.
        swatches: of the palettes that the sheets print, 8-bit sRGB, in reading order.
    """

    names: tuple[str, ...]
    pictures: tuple[Picture, ...]
    notes: tuple[str, ...]
    title: str
    places: tuple[Place | None, ...]
    swatches: tuple[tuple[int, int, int], ...] = ()


@dataclass(frozen=True)
class Place:
    """Place of a picture in its sheet.

    Attributes:
        sheet: the picture that it was cut from.
        box: (x, y, width, height) in it, pixels.
    """

    sheet: InputFile
    box: Box


def bundle_of(places: Sequence[Path]) -> Path | None:
    """Return the bundle's folder, or None where pictures, or folders of them, are given.

    Raises:
        BundleError: a bundle together with something else.
    """
    bundles = [place for place in places if _is_meant_as_bundle(place)]
    if not bundles:
        return None
    if len(places) > 1:
        raise BundleError(f"{bundles[0]}: a bundle stands alone; name one bundle, or only pictures")
    return places[0].parent if places[0].suffix.lower() == ".json" else places[0]


def check_pictures(places: Sequence[Path]) -> None:
    """Refuse places that are not there, before any work.

    Raises:
        BundleError: no such bundle, or one beside something else.
        PictureError: no such picture.
    """
    if bundle_of(places) is not None:
        transforms_file(places[0])
    else:
        check_there(places, "picture", PictureError)


def load_pictures(places: Sequence[Path]) -> Pictures:
    """Return the pictures that files and folders mean.

    Raises:
        BundleError: a bundle that cannot be read, or stands beside something else.
        SheetError: a folder without pictures, or a split folder that is broken.
        PictureError: a picture cannot be read.
    """
    if bundle_of(places) is not None:
        return _of_bundle(places[0])
    notes: list[str] = []
    pictures, sheets = [], []
    at_sheet: list[Place | None] = []
    printed: list[Swatch] = []
    found, skipped = sheet_places([_inner(place) for place in places])
    notes += skipped
    for place in found:
        if place.is_dir():
            split, changed = read_split(place)
            notes += changed
            pictures += [view.rgba for view in split.views]
            sheets += [source.name for source in split.sources]
            printed += [one for source in split.sources for one in source.swatches]
            files = [InputFile(SHEET, one.name, one.sha256) for one in split.sources]
            pairs = zip(split.views, split.source_of, strict=True)
            at_sheet += [Place(files[of], view.box) for view, of in pairs]
        else:
            picture, swatches = _loaded(place, notes)
            pictures.append(picture)
            printed += swatches
            sheets.append(place.name)
            height, width = pictures[-1].shape[:2]
            at_sheet.append(Place(InputFile.of(SHEET, place), (0, 0, width, height)))
    names = tuple(f"{number:03d}.png" for number in range(len(pictures)))
    folder = places[0] if places[0].is_dir() else places[0].parent
    title = palette_title(sheets, folder)
    colors = tuple(dict.fromkeys(one.color for one in printed))
    return Pictures(names, tuple(pictures), tuple(notes), title, tuple(at_sheet), colors)


def _of_bundle(place: Path) -> Pictures:
    notes: list[str] = []
    paths = picture_paths(place)
    names = tuple(f"{path.stem}.png" for path in paths)
    if len(set(names)) < len(names):
        raise BundleError(f"{place}: two pictures have the same file name; rename one")
    pictures = tuple(_loaded(path, notes)[0] for path in paths)
    found = _calibration(place)
    sheets = (file.name for file in (found.inputs if found else ()) if file.role == SHEET)
    title = palette_title(sheets, transforms_file(place).parent)
    lies = {view.name: _place(view) for view in found.views} if found else {}
    at_sheet = tuple(lies.get(path.name) for path in paths)
    printed = [rgb for view in found.views for rgb in view.swatches] if found else []
    return Pictures(names, pictures, tuple(notes), title, at_sheet, tuple(dict.fromkeys(printed)))


def _calibration(place: Path) -> CalibrationFile | None:
    try:
        return read_calibration(place_in(transforms_file(place).parent, CALIBRATION))
    except BundleError:  # of other programs there is none; `toonset check` tells of a broken one
        return None


def _place(view: ViewRecord) -> Place | None:
    if view.sheet is None or view.box is None:
        return None
    return Place(InputFile(SHEET, view.sheet.name, view.sheet.sha256), view.box)


def _is_meant_as_bundle(place: Path) -> bool:
    if place.is_dir():
        marks = (*NAMES, "calibration.json")  # a bundle that has lost its cameras is broken
        return any((place / name).is_file() for name in marks)
    if place.suffix.lower() == ".json":
        return place.name != "split.json"
    return not place.suffix and not place.exists()  # the bundle's reader says so


def _inner(place: Path) -> Path:
    """Return the folder images/ of a folder that has one but neither cameras nor a split."""
    images = place / "images"
    return images if images.is_dir() and not is_split_folder(place) else place


def _loaded(path: Path, notes: list[str]) -> tuple[Picture, tuple[Swatch, ...]]:
    """Return a picture with its plain background made transparent, if it is opaque.

    With the palette that such a picture prints.
    """
    picture = load_rgba(path)
    if (picture[..., 3] < 255).any():
        return picture, ()
    try:
        segmentation = split_picture(picture)
    except SheetError as error:
        notes.append(f"{path.name}: every pixel counts as the character's ({error})")
        return picture, ()
    whole = np.zeros_like(picture)
    for view in segmentation.views:
        x, y, width, height = view.box
        window = whole[y : y + height, x : x + width]
        window[view.rgba[..., 3] > 0] = view.rgba[view.rgba[..., 3] > 0]
    return whole, segmentation.swatches
