"""Write a palette, its label maps and contours, in a bundle or in a folder of their own.

palette.json         the colours
palette.gpl, .ase, .hex, .png   the same for other programs, and as a picture for people
labels/000.png ..    per picture: indexed PNG with all 256 entries, 255 transparent and unlabelled
tones/000.png ..     per picture of a shaded sheet: grey PNG, 0 = the paint lies in light, 1 = in
                     shadow, 255 = no paint
coverage/000.png ..  per picture: RGB PNG, which paints cover each pixel and how far
contours/000.png ..  per picture: grey PNG, how far drawn lines cover each pixel
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.images.picture import encode_grey_png, encode_indexed_png, encode_png
from toonset.lock import FOLDERS
from toonset.palette.names import clean_name
from toonset.palette.palette import Palette
from toonset.palette.pixels.labels import Space
from toonset.write import check_removable, new_files, write_bytes

if TYPE_CHECKING:
    from toonset.palette.extract import PaintMap

PALETTE_JSON, SWATCHES = "palette.json", "palette.png"
COPIES = (".gpl", ".ase", ".hex")  # of the colours, for other programs

Maps = Sequence[tuple[str, UInt8[np.ndarray, "_ _"]]]
Coverages = Sequence[tuple[str, UInt8[np.ndarray, "_ _ rgb=3"]]]


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
    from toonset.palette.coverage import coverage_map
    from toonset.palette.extract import paint_maps

    found = paint_maps(pictures, contours, palette, space) if maps is None else maps
    labels = [(name, one.labels) for name, one in zip(names, found, strict=True)]
    pairs = zip(names, found, strict=True)
    tones = [(name, one.tones) for name, one in pairs if one.tones is not None]
    drawings = zip(names, pictures, found, contours, strict=True)
    coverage = [
        (name, coverage_map(rgba, paint, lines, palette)) for name, rgba, paint, lines in drawings
    ]
    inked = list(zip(names, contours, strict=True))
    write_palette(folder, palette, labels, inked, tones, coverage)


def check_map_folders(folder: Path) -> None:
    """Refuse a folder whose folders of maps hold what no palette wrote: they are replaced.

    Raises:
        OutputError: they do, or are files or links.
    """
    for name in FOLDERS:
        check_removable(folder / name, "*.png")


def write_palette(
    folder: Path,
    palette: Palette,
    labels: Maps,
    contours: Maps = (),
    tones: Maps = (),
    coverage: Coverages = (),
) -> None:
    """Write palette.json and its copies, label, tone, coverage and contour maps into a folder.

    They replace older ones. Without contours, older ones stay: they depend on the pictures alone;
    without tones or coverage, older ones go: a flat sheet has no tones.

    All of them change at once or none does: see `toonset.write.new_files`.

    Args:
        folder: a bundle, or a new folder.
        palette: the colours.
        labels: file name and label map of every picture.
        contours: file name and contour map of every picture.
        tones: file name and tone map of every picture, where the palette has a shadow.
        coverage: file name and coverage of every picture: see `toonset.palette.coverage`.

    Raises:
        OutputError: the folder cannot be written, or a map folder holds what no palette wrote.
    """
    from toonset.palette.formats.registry import encode_palette
    from toonset.palette.swatch_image import draw_swatches

    folders: dict[str, Maps | Coverages] = {
        "labels": labels,
        "contours": contours,
        "tones": tones,
        "coverage": coverage,
    }
    gone = [name for name in ("tones", "coverage") if not folders[name]]
    check_map_folders(folder)
    with new_files(folder / PALETTE_JSON, gone, force=True) as new:
        for place, maps in folders.items():
            for name, values in maps:
                write_bytes(new / place / name, _encode_map(place, values, palette))
        for end in (*COPIES, ".json"):
            write_bytes(new / f"palette{end}", encode_palette(palette, end))
        write_bytes(new / SWATCHES, encode_png(draw_swatches(palette)))


def _encode_map(place: str, values: np.ndarray, palette: Palette) -> bytes:
    if place == "labels":
        return encode_indexed_png(values, palette.rgb)
    return encode_grey_png(values) if values.ndim == 2 else encode_png(values)
