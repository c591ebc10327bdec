"""A palette, its label maps and contours on disk, in a bundle or in a folder of their own.

palette.json         the colours
palette.gpl, .ase, .hex, .png   the same for other programs, and as a picture for people
labels/000.png ..    per picture: indexed PNG with all 256 entries, 255 transparent and unlabelled
tones/000.png ..     per picture of a shaded sheet: grey PNG, 0 = the paint lies in light, 1 = in
                     shadow, 255 = no paint
contours/000.png ..  per picture: grey PNG, how far drawn lines cover each pixel
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.images.picture import encode_grey_png, encode_indexed_png, encode_png
from toonset.palette.extract import PaintMap, paint_maps
from toonset.palette.formats.registry import encode_palette
from toonset.palette.names import clean_name
from toonset.palette.palette import Palette
from toonset.palette.pixels.labels import Space
from toonset.palette.swatch_image import draw_swatches
from toonset.write import check_removable, new_folder, remove_folder, write_bytes

PALETTE_JSON, SWATCHES = "palette.json", "palette.png"
COPIES = (".gpl", ".ase", ".hex")  # of the colours, for other programs

Maps = Sequence[tuple[str, UInt8[np.ndarray, "_ _"]]]


def palette_title(sheets: Iterable[str], folder: Path) -> str:
    """Return what a palette is called: the sheet's name if there is one sheet, else the folder's.

    Args:
        sheets: file names of the sheets that the drawings come from, if they are known.
        folder: where the drawings lie.
    """
    names = list(dict.fromkeys(sheets))
    return clean_name(Path(names[0]).stem if len(names) == 1 else folder.resolve().name)


def write_labelled(
    folder: Path,
    palette: Palette,
    names: Sequence[str],
    pictures: Sequence[UInt8[np.ndarray, "_ _ rgba=4"]],
    contours: Sequence[UInt8[np.ndarray, "_ _"]],
    space: Space = "rgb",
    maps: Sequence[PaintMap] | None = None,
) -> None:
    """Write a palette and the maps of pictures whose contours are known; see `write_palette`.

    Without `maps`, pixels are labelled here.
    """
    found = paint_maps(pictures, contours, palette, space) if maps is None else maps
    labels = [(name, one.labels) for name, one in zip(names, found, strict=True)]
    pairs = zip(names, found, strict=True)
    tones = [(name, one.tones) for name, one in pairs if one.tones is not None]
    write_palette(folder, palette, labels, list(zip(names, contours, strict=True)), tones)


def write_palette(
    folder: Path, palette: Palette, labels: Maps, contours: Maps = (), tones: Maps = ()
) -> None:
    """Write palette.json and its copies, labels/, tones/ and contours/ into an existing folder.

    They replace older ones. Without contours, older ones stay: they depend on the pictures alone;
    without tones, older ones go: a flat sheet has none.

    Everything is written beside the old files first and renamed at the end, palette.json last: a
    full disk leaves the older palette as it was, and whenever palette.json is there, labels and
    tones fit it.

    Args:
        folder: a bundle, or a new folder.
        palette: the colours.
        labels: file name and label map of every picture.
        contours: file name and contour map of every picture.
        tones: file name and tone map of every picture, where the palette has a shadow.

    Raises:
        OutputError: the folder cannot be written, or its tones/ holds what no palette wrote.
    """
    if not tones:
        check_removable(folder / "tones", "*.png")
    files = {f"palette{end}": encode_palette(palette, end) for end in COPIES}
    files[SWATCHES] = encode_png(draw_swatches(palette))
    files[PALETTE_JSON] = encode_palette(palette, ".json")
    if contours:
        with new_folder(folder / "contours", force=True) as temporary:
            for name, values in contours:
                write_bytes(temporary / name, encode_grey_png(values))
    placed = folder / "labels"
    with ExitStack() as whole:
        temporary = whole.enter_context(new_folder(placed, force=True))
        if tones:
            beside = whole.enter_context(new_folder(folder / "tones", force=True))
            for name, values in tones:
                write_bytes(beside / name, encode_grey_png(values))
        for name, values in labels:
            write_bytes(temporary / name, encode_indexed_png(values, palette.rgb))
        for name, data in files.items():
            write_bytes(temporary / name, data)
        (folder / PALETTE_JSON).unlink(missing_ok=True)
        if not tones:
            remove_folder(folder / "tones")
    for name in files:
        os.replace(placed / name, folder / name)
