"""A palette, its label maps and contours on disk, in a bundle or in a folder of their own.

palette.json         the colours
palette.gpl, .ase, .hex, .png   the same for other programs, and as a picture for people
labels/000.png ..    per picture: indexed PNG with all 256 entries, 255 transparent and unlabelled
contours/000.png ..  per picture: grey PNG, how far drawn lines cover each pixel
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.images.picture import encode_grey_png, encode_indexed_png, encode_png
from toonset.palette.extract import label_drawings
from toonset.palette.formats.registry import encode_palette
from toonset.palette.palette import Palette
from toonset.palette.pixels.labels import Space
from toonset.palette.swatch_image import draw_swatches
from toonset.write import new_folder, write_bytes

PALETTE_JSON, SWATCHES = "palette.json", "palette.png"
COPIES = (".gpl", ".ase", ".hex")  # of the colours, for other programs

Maps = Sequence[tuple[str, UInt8[np.ndarray, "_ _"]]]


def write_labelled(
    folder: Path,
    palette: Palette,
    names: Sequence[str],
    pictures: Sequence[UInt8[np.ndarray, "_ _ rgba=4"]],
    contours: Sequence[UInt8[np.ndarray, "_ _"]],
    space: Space = "rgb",
) -> None:
    """Label pictures whose contour maps are known, and write all; see `write_palette`."""
    labels = label_drawings(pictures, contours, palette, space)
    named = [list(zip(names, maps, strict=True)) for maps in (labels, contours)]
    write_palette(folder, palette, *named)


def write_palette(folder: Path, palette: Palette, labels: Maps, contours: Maps = ()) -> None:
    """Write palette.json and its copies, labels/ and contours/ into an existing folder.

    They replace older ones; without contours, older ones stay: they depend on the pictures alone.

    Everything is written beside the old files first and renamed at the end, palette.json last: a
    full disk leaves the older palette as it was, and whenever palette.json is there, labels fit it.

    Args:
        folder: a bundle, or a new folder.
        palette: the colours.
        labels: file name and label map of every picture.
        contours: file name and contour map of every picture.

    Raises:
        OutputError: the folder cannot be written.
    """
    files = {f"palette{end}": encode_palette(palette, end) for end in COPIES}
    files[SWATCHES] = encode_png(draw_swatches(palette))
    files[PALETTE_JSON] = encode_palette(palette, ".json")
    if contours:
        with new_folder(folder / "contours", force=True) as temporary:
            for name, values in contours:
                write_bytes(temporary / name, encode_grey_png(values))
    placed = folder / "labels"
    with new_folder(placed, force=True) as temporary:
        for name, values in labels:
            write_bytes(temporary / name, encode_indexed_png(values, palette.rgb))
        for name, data in files.items():
            write_bytes(temporary / name, data)
        (folder / PALETTE_JSON).unlink(missing_ok=True)
    for name in files:
        os.replace(placed / name, folder / name)
