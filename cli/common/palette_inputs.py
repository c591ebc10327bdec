"""What `toonset palette` looks at: a bundle, what `toonset split` wrote, folders, or pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toonset.cli.common.output import Printer
from toonset.dataset.split_folder.places import is_split_folder, sheet_places

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import UInt8

    Picture = UInt8[np.ndarray, "_ _ 4"]

BUNDLE = Path("bundle")


@dataclass(frozen=True, eq=False)
class Drawn:
    """The pictures of one character.

    Attributes:
        names: file name of each picture's label map.
        pictures: the character on transparent ground.
        bundle: the folder that they belong to; None for loose pictures.
    """

    names: tuple[str, ...]
    pictures: tuple[Picture, ...]
    bundle: Path | None


def bundle_of(places: Sequence[Path]) -> Path | None:
    """Return the bundle's folder, or None where pictures, or folders of them, are given.

    Raises:
        BundleError: a bundle together with something else.
    """
    from toonset.errors import BundleError

    bundles = [place for place in places if _is_meant_as_bundle(place)]
    if not bundles:
        return None
    if len(places) > 1:
        raise BundleError(f"{bundles[0]}: a bundle stands alone; name one bundle, or only pictures")
    return places[0].parent if places[0].suffix.lower() == ".json" else places[0]


def _is_meant_as_bundle(place: Path) -> bool:
    from toonset.dataset.bundle.transforms_read import NAMES

    if place.is_dir():
        marks = (*NAMES, "calibration.json")  # a bundle that has lost its cameras is broken
        return any((place / name).is_file() for name in marks)
    if place.suffix.lower() == ".json":
        return place.name != "split.json"
    return not place.suffix and not place.exists()  # the bundle's reader says so


def load_drawn(places: list[Path], printer: Printer) -> Drawn:
    """Return the pictures that the arguments mean.

    Raises:
        BundleError: a bundle that cannot be read, or stands beside something else.
        SheetError: a folder without pictures, or a split folder that is broken.
        PictureError: a picture that cannot be read.
    """
    bundle = bundle_of(places)
    if bundle is not None:
        return _bundled(places[0], bundle, printer)
    pictures: list[Picture] = []
    found, notes = sheet_places([_inner(place) for place in places])
    for note in notes:
        printer.say(note)
    for place in found:
        pictures += _views(place, printer) if place.is_dir() else [_loaded(place, printer)]
    names = tuple(f"{number:03d}.png" for number in range(len(pictures)))
    return Drawn(names, tuple(pictures), None)


def _inner(place: Path) -> Path:
    """Return the folder images/ of a folder that has one but neither cameras nor a split."""
    images = place / "images"
    return images if images.is_dir() and not is_split_folder(place) else place


def _bundled(place: Path, bundle: Path, printer: Printer) -> Drawn:
    from toonset.dataset.bundle.transforms_read import picture_paths
    from toonset.errors import BundleError

    paths = picture_paths(place)
    names = tuple(f"{path.stem}.png" for path in paths)
    if len(set(names)) < len(names):
        raise BundleError(f"{place}: two pictures have the same file name; rename one")
    return Drawn(names, tuple(_loaded(path, printer) for path in paths), bundle)


def _views(folder: Path, printer: Printer) -> list[Picture]:
    from toonset.dataset.split_folder.read import read_split

    split, notes = read_split(folder)
    for note in notes:
        printer.say(note)
    return [view.rgba for view in split.views]


def _loaded(path: Path, printer: Printer) -> Picture:
    from toonset.dataset.images.picture import load_rgba

    return _foreground(load_rgba(path), path, printer)


def _foreground(picture: Picture, path: Path, printer: Printer) -> Picture:
    """Return the picture with its plain background made transparent, if it is opaque."""
    import numpy as np

    from toonset.dataset.split.sheet import split_sheet
    from toonset.errors import SheetError

    if (picture[..., 3] < 255).any():
        return picture
    try:
        sheet = split_sheet(picture)
    except SheetError as error:
        printer.say(f"{path.name}: every pixel counts as the character's ({error})")
        return picture
    whole = np.zeros_like(picture)
    for view in sheet.views:
        x, y, width, height = view.box
        window = whole[y : y + height, x : x + width]
        window[view.rgba[..., 3] > 0] = view.rgba[view.rgba[..., 3] > 0]
    return whole
