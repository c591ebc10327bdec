"""Drawings in: sheets, single views, folders of them, sprite strips, and split folders.

Views are numbered through in the order given. A file without a figure stops everything: left out
in silence it would shift the numbers and labels of all that follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from toonset.cli.common.cutting import Cutting
from toonset.cli.common.output import Printer
from toonset.dataset.split_folder.places import sheet_places

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import UInt8

    from toonset.dataset.split.sheet import SheetOptions
    from toonset.dataset.split_folder.views import Split

    Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True, eq=False)
class Drawings:
    """What was read.

    Attributes:
        split: the views that are left after --drop, and their sheets.
        found: number of views before --drop.
        pictures: per sheet, its pixels; None where only its views are left (a split folder).
        files: role and path of every file that was read.
        notes: what a person should know of the files: changes, duplicates, uneven cells.
    """

    split: Split
    found: int
    pictures: tuple[Picture | None, ...]
    files: tuple[tuple[str, Path], ...]
    notes: tuple[str, ...] = ()

    @property
    def doubts(self) -> tuple[str, ...]:
        """Return what a person should look at.

        All warnings count: of the splitter (figures that touch or are cut, a background that is
        not plain) and of the files (copies, cells that do not divide the sheet, a changed folder).
        What was left out of a sheet (text, frames, specks, views of --drop) is no doubt: it is
        ordinary, and the overlay shows it. Nor is what a split folder says of its sheets: a person
        has had the chance to look.
        """
        sheets = zip(self.split.sources, self.pictures, strict=True)
        cut_now = [source for source, picture in sheets if picture is not None]
        warned = [f"{source.name}: {text}" for source in cut_now for text in source.warnings]
        return (*warned, *self.notes)


def load_drawings(paths: Sequence[Path], cutting: Cutting, printer: Printer) -> Drawings:
    """Return the views of all sheets, in order and named through.

    Args:
        paths: files and folders.
        cutting: how sheets are cut.
        printer: says what folders hold besides.

    Raises:
        PictureError, SheetError: a file is no picture or shows no figure, is given twice, a split
            folder is broken, or an option does not fit the sheets.
    """
    from toonset.dataset.split_folder.checks import odd_files

    places, notes = sheet_places(paths)
    for note in notes:
        printer.say(note)
    options = _options_per_sheet(places, cutting)
    parts = [
        _of_split_folder(place) if sheet_options is None else _of_sheet(place, sheet_options)
        for place, sheet_options in zip(places, options, strict=True)
    ]
    whole = _joined(parts)
    boxes = [("boxes", cutting.boxes)] if cutting.boxes is not None else []
    kept = _dropped(replace(whole, files=(*whole.files, *boxes)), cutting.dropped)
    if any(place.is_dir() for place in places):  # a split folder has been looked at
        return kept
    return replace(kept, notes=(*kept.notes, *odd_files(kept.split)))  # --drop settles a doubt


def check_label_count(text: str, drawings: Drawings) -> None:
    """Refuse labels that are not one per kept view, where --drop explains the difference.

    Raises:
        SheetError: another number of labels than of views that are left.
    """
    from toonset.errors import SheetError

    kept, given = len(drawings.split.views), text.count(",") + 1
    if text and drawings.found > kept and given != kept:
        raise SheetError(
            f"--views: {given} labels for {kept} views (--drop left {kept} of {drawings.found}); "
            'give one per kept view in sheet order, "?" where you do not know'
        )


def _options_per_sheet(places: Sequence[Path], cutting: Cutting) -> list[SheetOptions | None]:
    """Return how every sheet is cut; None for a split folder, which is cut already."""
    from toonset.dataset.split.sheet import SheetOptions
    from toonset.errors import SheetError

    is_cut = [place.is_dir() for place in places]
    if cutting.given and any(is_cut):
        folder = places[is_cut.index(True)]
        raise SheetError(
            f"{cutting.given[0]}: {folder} is cut already; give the sheet that it was cut from"
        )
    common = SheetOptions(background_rgb=cutting.background_rgb, grid=cutting.cells)
    options = [None if cut else common for cut in is_cut]
    if cutting.boxes is None:
        return options
    from toonset.dataset.split_folder.boxes import read_boxes

    boxes = read_boxes(cutting.boxes)
    if len(boxes) != len(places):
        raise SheetError(
            f"--boxes: {cutting.boxes} has boxes of {len(boxes)} sheet(s), {len(places)} are "
            "given; split sheet by sheet"
        )
    return [replace(common, boxes=of_sheet) for of_sheet in boxes]


def _of_split_folder(folder: Path) -> Drawings:
    from toonset.dataset.images.folder import picture_files
    from toonset.dataset.split_folder.places import IMAGES, SPLIT_FILE
    from toonset.dataset.split_folder.read import read_split

    split, notes = read_split(folder)
    views = [("view", path) for path in picture_files(folder / IMAGES)[0]]
    nothing = (None,) * len(split.sources)
    files = (("split", folder / SPLIT_FILE), *views)
    return Drawings(split, len(split.views), nothing, files, notes)


def _of_sheet(path: Path, options: SheetOptions) -> Drawings:
    from toonset.dataset.images.picture import decode_rgba
    from toonset.dataset.split.sheet import split_sheet
    from toonset.dataset.split_folder.boxes import check_boxes
    from toonset.dataset.split_folder.views import split_of_sheet
    from toonset.errors import PictureError, SheetError
    from toonset.read import read_whole

    data = read_whole(path, "picture", PictureError)
    picture = decode_rgba(data, path)
    height, width = picture.shape[:2]
    check_boxes(options.boxes, (width, height), "--boxes")
    try:
        sheet = split_sheet(picture, options)
    except SheetError as error:
        raise SheetError(f"{path}: {error}") from error
    split = split_of_sheet(path.name, data, (width, height), sheet)
    notes = _uneven_cells(path, (width, height), options.grid)
    return Drawings(split, len(split.views), (picture,), (("sheet", path),), notes)


def _uneven_cells(
    path: Path, size_wh: tuple[int, int], grid: tuple[int, int] | None
) -> tuple[str, ...]:
    sides = zip(size_wh, grid or (1, 1), ("wide", "high"), strict=True)
    return tuple(
        f"{path.name}: {pixels} px {way}, which {count} cells do not divide evenly: is it the "
        "right --grid?"
        for pixels, count, way in sides
        if pixels % count
    )


def _joined(parts: Sequence[Drawings]) -> Drawings:
    from toonset.dataset.split_folder.views import joined

    split = joined([part.split for part in parts])
    return Drawings(
        split,
        len(split.views),
        tuple(picture for part in parts for picture in part.pictures),
        tuple(file for part in parts for file in part.files),
        tuple(note for part in parts for note in part.notes),
    )


def _dropped(drawings: Drawings, dropped: frozenset[int]) -> Drawings:
    from toonset.dataset.split_folder.views import without
    from toonset.errors import SheetError

    unknown = [number for number in sorted(dropped) if number >= drawings.found]
    if unknown:
        raise SheetError(
            f"--drop: there is no view {unknown[0]}; the {drawings.found} views are numbered from "
            f"0 to {drawings.found - 1}, as in overlay.png"
        )
    if len(dropped) == drawings.found:
        raise SheetError(f"--drop: leaves none of {drawings.found} views; keep at least one")
    return replace(drawings, split=without(drawings.split, dropped))
