"""Resolve which files and folders a command's arguments mean.

- a file is a sheet; one figure is fine, so "one file per view" needs nothing special;
- a folder with a split.json is what `toonset split` wrote, perhaps corrected by hand;
- any other folder stands for the pictures in it, view2 before view10.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

SPLIT_FILE, IMAGES, OVERLAY = "split.json", "images", "overlay.png"
NOT_SHEETS = {"transforms.json": "images", "config.json": None}  # a bundle, a trained run


def is_split_folder(path: Path) -> bool:
    """Return whether `toonset split` has written a folder."""
    return (path / SPLIT_FILE).is_file()


def sheet_places(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return picture files and split folders, and notes of what is left out.

    Plain folders are replaced by their pictures.

    Raises:
        SheetError: a folder without pictures, a bundle, or a file that is given twice.
    """
    from toonset.dataset.images.folder import drawing_lines, left_out_lines, picture_files
    from toonset.errors import SheetError

    places: list[Path] = []
    notes: list[str] = []
    for given in paths:
        path = given.parent if given.name == SPLIT_FILE and given.is_file() else given
        if not path.is_dir() or is_split_folder(path):
            places.append(path)
            continue
        _check_no_result(path)
        pictures, others = picture_files(path)
        if not pictures:
            told = [*drawing_lines(others), "name a sheet, or its folder"]
            raise SheetError(f"{path}: is a folder without pictures; {told[0]}")
        notes += [f"{path}: {line}" for line in left_out_lines(others)]
        places += pictures
    _check_once(places)
    return places, notes


def _check_no_result(folder: Path) -> None:
    """Refuse a folder whose pictures are not drawings (an overlay, renders)."""
    from toonset.errors import SheetError

    for name, images in NOT_SHEETS.items():
        if (folder / name).is_file():
            advice = f"give {folder / images}" if images else "give the drawings"
            raise SheetError(f"{folder}: holds {name}, so it is no folder of sheets; {advice}")
    if (folder / OVERLAY).is_file() and (folder / IMAGES).is_dir():
        raise SheetError(
            f"{folder}: holds {OVERLAY} and {IMAGES}/ as a split folder does, but no {SPLIT_FILE}; "
            f"give {folder / IMAGES}, or split the sheet again"
        )


def _check_once(places: Sequence[Path]) -> None:
    from toonset.errors import SheetError

    seen: set[Path] = set()
    for place in places:
        real = place.absolute() if place.is_symlink() else _resolved(place)
        if real in seen:
            raise SheetError(f"{place}: is given twice; name every drawing once")
        seen.add(real)


def _resolved(place: Path) -> Path:
    try:
        return place.resolve()
    except (OSError, RuntimeError):  # a loop of links: the picture's reader says so
        return place.absolute()
