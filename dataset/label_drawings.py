"""Find and label the drawings' palette, with what a person corrected of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from toonset.dataset.bundle.palette_files import write_labelled
from toonset.dataset.split_folder.corrected import Given
from toonset.dataset.split_folder.pictures import Pictures, load_pictures
from toonset.errors import PaletteError, ToonsetError
from toonset.palette.choice import choose_palette
from toonset.palette.corrected import correct_palette
from toonset.palette.corrections import PaletteCorrections
from toonset.palette.extract import PaintMap
from toonset.palette.options import PaletteOptions
from toonset.palette.palette import Palette
from toonset.palette.pixels.ink_lines import find_contours
from toonset.palette.pixels.labels import Space
from toonset.palette.sheet_palette import Map


def label_drawings(
    drawn: Pictures,
    contours: list[Map],
    options: PaletteOptions = PaletteOptions(),
    given: Given | None = None,
    space: Space = "rgb",
) -> tuple[Palette, list[PaintMap] | None, tuple[str, ...]]:
    """Return the palette, its maps where a person corrected them, and notes for people.

    Args:
        drawn: the drawings.
        contours: how far drawn lines cover their pixels.
        options: how colours are chosen; those that corrections keep are kept, too.
        given: what a person corrected.
        space: in which the nearest colour is meant.

    Raises:
        ToonsetError: a colour that the drawings do not have; the message names option or key.
    """
    wanted = PaletteCorrections() if given is None else given.content.palette
    try:
        if wanted.keep:
            options = replace(options, keep=",".join(wanted.keep))
        found = choose_palette(drawn.pictures, contours, options, drawn.swatches)
    except ToonsetError as error:
        if given is None or not wanted.keep:
            raise
        raise PaletteError(str(error).replace("--keep", f"{given.path}: palette.keep")) from error
    maps: list[PaintMap] | None = None
    notes: tuple[str, ...] = ()
    if given is not None and wanted != PaletteCorrections():
        strokes, notes = given.strokes_on(drawn.pictures, drawn.places)
        found, maps = correct_palette(
            drawn.pictures, contours, found, wanted, strokes, where=str(given.path), space=space
        )
    return replace(found, title=found.title or drawn.title), maps, notes


def label_bundle(folder: Path, given: Given) -> None:
    """Find the palette of a bundle's drawings, as a person corrected it, and write it there.

    Raises:
        ToonsetError: the corrections speak of colours that the drawings do not have.
    """
    drawn = load_pictures([folder])
    contours = find_contours(drawn.pictures)
    found, maps, _ = label_drawings(drawn, contours, given=given)
    write_labelled(folder, found, drawn.names, drawn.pictures, contours, "rgb", maps)
