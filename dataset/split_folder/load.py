"""Load drawings: sheets, single views, folders of them, sprite strips, and split folders.

Views are numbered through in the order given. A file without a figure stops everything: left out
in silence it would shift the numbers and labels of all that follow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from string import ascii_uppercase
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.images import photoshop
from toonset.dataset.images.folder import picture_files
from toonset.dataset.images.layers import layers_line
from toonset.dataset.images.matting_network import MattingNetwork, read_network, without_background
from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.split.captions import with_captions
from toonset.dataset.split.figures.rows import Taken
from toonset.dataset.split.pages import straightened
from toonset.dataset.split.sheet import PictureOptions, Segmentation, split_picture
from toonset.dataset.split_folder.boxes import check_boxes, read_boxes
from toonset.dataset.split_folder.checks import odd_files
from toonset.dataset.split_folder.corrected import Given
from toonset.dataset.split_folder.options import SheetOptions
from toonset.dataset.split_folder.places import IMAGES, SPLIT_FILE, sheet_places
from toonset.dataset.split_folder.read import read_split
from toonset.dataset.split_folder.view_labels import parse_labels
from toonset.dataset.split_folder.views import Split, join_splits, split_of_sheet, without
from toonset.errors import PictureError, SheetError, UsageError, as_text
from toonset.palette.names import rgb_of_hex
from toonset.read import read_whole
from toonset.view import SHEET, InputFile, Origin, View

Picture = UInt8[np.ndarray, "height width 4"]
Paths = str | Path | Sequence[str | Path]
STRAIGHTENED = "the page lies at an angle: places are those of the page seen from straight above"


@dataclass(frozen=True, eq=False)
class Sheet:
    """The drawings of one or more sheets.

    Attributes:
        split: the views, and the sheets that they were cut from.
        found: number of views before some were dropped.
        pictures: per sheet, its pixels; None where only its views are left (a split folder).
        files: what was read.
        options: how the sheets were cut, as typed; only what was given.
        notes: what a person should know of the files: changes, duplicates, uneven cells.
        skipped: what folders hold besides, in words.
    """

    split: Split
    found: int
    pictures: tuple[Picture | None, ...]
    files: tuple[InputFile, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    skipped: tuple[str, ...] = ()

    @property
    def views(self) -> tuple[View, ...]:
        """Return the drawings in sheet order, named 000.png, 001.png, ..."""
        return self.split.views

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what a person should look at, for a view may be wrong.

        All warnings count: of the splitter (figures that touch or are cut, a background that is
        not plain) and of the files (copies, cells that do not divide the sheet, a changed folder).
        What was left out of a sheet (text, frames, specks, dropped views) is not a warning: it is
        ordinary, and the overlay shows it. Nor is what a split folder says of its sheets: a person
        has had the chance to look.
        """
        sheets = zip(self.split.sources, self.pictures, strict=True)
        cut_now = [source for source, picture in sheets if picture is not None]
        warned = [f"{source.name}: {text}" for source in cut_now for text in source.warnings]
        return (*warned, *self.notes)

    @property
    def outfits(self) -> tuple[str, ...]:
        """Return the letters of the rows that show the same directions, in other clothes.

        `split_sheet` takes each of them as `outfit`. There are none where the rows of the group
        that was taken go on turning, of several sheets, and of a split folder.
        """
        if len(self.pictures) != 1 or self.pictures[0] is None:
            return ()
        taken = (group for group in self.split.sources[0].groups if group.taken and group.outfits)
        return tuple(ascii_uppercase[: sum(len(group.rows) for group in taken)])


def split_sheet(
    sheet: Paths, options: SheetOptions = SheetOptions(), *, corrections: str | Path | None = None
) -> Sheet:
    """Return the drawings of a character sheet, cut out with alpha.

    Args:
        sheet: a picture, several (one file per view, or several sheets), a folder of them, or a
            folder that `toonset split` wrote.
        options: how it is cut, and what the views show. `Sheet.outfits` lists the letters that
            `outfit` takes, of rows that show the same directions.
        corrections: file of what a person corrected of one of the sheets (docs/formats.md).

    Raises:
        ToonsetError: a file is not a picture or shows no figure, is given twice, a split folder is
            broken, or an option cannot be understood or does not fit the sheets.
    """
    paths = [sheet] if isinstance(sheet, str | Path) else sheet
    if not paths:
        raise UsageError("split_sheet: no sheet; give a picture, several, or a folder")
    options.check()
    given = None if corrections is None else Given.of(corrections)
    if given is not None:
        given.check_beside(
            boxes=options.boxes,
            grid=options.grid,
            background=options.background,
            drop=options.drop,
            views=options.labels,
            group=options.group,
            outfit=options.outfit,
        )
    return _labelled(_load([Path(path) for path in paths], options, given), options.labels)


def _load(paths: Sequence[Path], cutting: SheetOptions, given: Given | None) -> Sheet:
    """Return the views of all sheets, in order and named through."""
    places, skipped = sheet_places(paths)
    cut = _options_per_sheet(places, cutting)
    where = "--boxes"
    if given is not None:
        cut = _as_corrected(places, cut, given)
        where = f"{given.path}: boxes" if given.content.boxes else where
    told = cutting.names_figures or bool(given is not None and given.content.figures_key)
    network = None if cutting.matting is None else read_network(Path(cutting.matting))
    parts = [
        _of_split_folder(place)
        if options is None
        else _of_sheet(place, options, where, network, told=told)
        for place, options in zip(places, cut, strict=True)
    ]
    whole = replace(_joined(parts), skipped=tuple(skipped))
    for role, file in (("boxes", cutting.boxes), ("matting", cutting.matting)):
        if file is not None:
            whole = replace(whole, files=(*whole.files, InputFile.of(role, Path(file))))
    if given is not None:
        split, notes = given.applied(whole.split)
        files = (*whole.files, InputFile.of("corrections", given.path))
        whole = replace(whole, split=split, notes=(*whole.notes, *notes), files=files)
    kept = _dropped(whole, cutting.dropped)
    if not any(place.is_dir() for place in places):  # a split folder has been looked at
        kept = replace(kept, notes=(*kept.notes, *odd_files(kept.split)))
    return _with_origin(replace(kept, options=cutting.as_options()))


def _labelled(sheet: Sheet, text: str) -> Sheet:
    """Return the views with labels as typed; without text, with those that they have.

    Raises:
        SheetError: not one label per view, or a word that is no direction.
    """
    if not text:
        return sheet
    kept, given = len(sheet.views), text.count(",") + 1
    if sheet.found > kept and given != kept:
        raise SheetError(
            f"--views: {given} labels for {kept} views (--drop left {kept} of {sheet.found}); "
            'give one per kept view in sheet order, "?" where you do not know'
        )
    parse_labels(text, kept)
    words = ["" if word.strip() == "?" else word.strip() for word in text.split(",")]
    pairs = zip(sheet.views, words, strict=True)
    views = tuple(replace(view, label=word, caption="") for view, word in pairs)
    return replace(sheet, split=replace(sheet.split, views=views))


def _with_origin(sheet: Sheet) -> Sheet:
    """Return the sheet whose views know where they come from."""
    split, origin = sheet.split, Origin(sheet.files, sheet.options)
    cut_now = [picture is not None for picture in sheet.pictures]
    papers = [split.sources[of].background if cut_now[of] else None for of in split.source_of]
    sheets = [InputFile(SHEET, source.name, source.sha256) for source in split.sources]
    printed = [tuple(one.color for one in source.swatches) for source in split.sources]
    views = tuple(
        replace(view, origin=origin, paper=paper, sheet=sheets[of], swatches=printed[of])
        for view, paper, of in zip(split.views, papers, split.source_of, strict=True)
    )
    return replace(sheet, split=replace(split, views=views))


def _options_per_sheet(
    places: Sequence[Path], cutting: SheetOptions
) -> list[PictureOptions | None]:
    """Return how every sheet is cut; None for a split folder, which is cut already."""
    is_cut = [place.is_dir() for place in places]
    if cutting.given and any(is_cut):
        folder = places[is_cut.index(True)]
        raise SheetError(
            f"{cutting.given[0]}: {folder} is cut already; give the sheet that it was cut from"
        )
    common = PictureOptions(
        background_rgb=cutting.background_rgb, grid=cutting.cells, taken=cutting.taken
    )
    options = [None if cut else common for cut in is_cut]
    if cutting.boxes is None:
        return options
    boxes = read_boxes(Path(cutting.boxes))
    if len(boxes) != len(places):
        raise SheetError(
            f"--boxes: {cutting.boxes} has boxes of {len(boxes)} sheet(s), {len(places)} are "
            "given; split sheet by sheet"
        )
    return [replace(common, boxes=of_sheet) for of_sheet in boxes]


def _as_corrected(
    places: Sequence[Path], options: Sequence[PictureOptions | None], given: Given
) -> list[PictureOptions | None]:
    """Return how every sheet is cut, the corrected one as its corrections say."""
    said, found = given.content, list(options)
    if not (said.figures_key or said.background):
        return found
    number = 0
    if len(places) > 1:
        files = [i for i, place in enumerate(places) if not place.is_dir()]
        number = files[given.number_of_sheet([InputFile.of(SHEET, places[i]) for i in files])]
    cut = found[number]
    if cut is None:
        raise SheetError(
            f"{given.path}: {places[number]} is cut already; give the sheet that it was cut from"
        )
    if said.background:
        cut = replace(cut, background_rgb=rgb_of_hex(said.background, "background"))
    if said.figures_key:
        taken = SheetOptions(group=said.group, outfit=said.outfit).taken
        cut = replace(cut, boxes=said.boxes, taken=taken)
    found[number] = cut
    return found


def _of_split_folder(folder: Path) -> Sheet:
    split, notes = read_split(folder)
    views = [("view", path) for path in picture_files(folder / IMAGES)[0]]
    files = tuple(InputFile.of(*file) for file in (("split", folder / SPLIT_FILE), *views))
    return Sheet(split, len(split.views), (None,) * len(split.sources), files, notes=notes)


def _of_sheet(
    path: Path, options: PictureOptions, where: str, network: MattingNetwork | None, *, told: bool
) -> Sheet:
    """Return the views of one file; `told`: a person said which figures are wanted."""
    data = read_whole(path, "picture", PictureError)
    picture = decode_rgba(data, path)
    if network is not None:
        picture = without_background(picture, network)
    flat = straightened(picture)
    picture = picture if flat is None else flat
    height, width = picture.shape[:2]
    check_boxes(options.boxes, (width, height), where)

    def another(taken: Taken) -> Segmentation:
        return split_picture(picture, replace(options, taken=taken))

    try:
        found = split_picture(picture, options)
        found = with_captions(picture, found, None if told else another)
    except SheetError as error:
        raise SheetError(f"{path}: {error}") from error
    if flat is not None:
        found = replace(found, remarks=(STRAIGHTENED, *found.remarks))
    if data.startswith(photoshop.MAGIC):
        boxes = [view.figure_box for view in found.views]
        line = layers_line(photoshop.photoshop_layers(data, path), (width, height), boxes)
        found = replace(found, remarks=(*found.remarks, *filter(None, [line])))
    split = split_of_sheet(as_text(path.name), data, (width, height), found)
    files = (InputFile(SHEET, path.name, split.sources[0].sha256),)
    notes = _uneven_cells(path, (width, height), options.grid)
    return Sheet(split, len(split.views), (picture,), files, notes=notes)


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


def _joined(parts: Sequence[Sheet]) -> Sheet:
    split = join_splits([part.split for part in parts])
    return Sheet(
        split,
        len(split.views),
        tuple(picture for part in parts for picture in part.pictures),
        tuple(file for part in parts for file in part.files),
        notes=tuple(note for part in parts for note in part.notes),
    )


def _dropped(sheet: Sheet, dropped: frozenset[int]) -> Sheet:
    unknown = [number for number in sorted(dropped) if number >= sheet.found]
    if unknown:
        raise SheetError(
            f"--drop: there is no view {unknown[0]}; the {sheet.found} views are numbered from "
            f"0 to {sheet.found - 1}, as in overlay.png"
        )
    if len(dropped) == sheet.found:
        raise SheetError(f"--drop: leaves none of {sheet.found} views; keep at least one")
    return replace(sheet, split=without(sheet.split, dropped))
