"""A palette, its label maps and contours on disk, in a bundle or in a folder of their own.

palette.json, .gpl   the colours
labels/000.png ..    per picture: indexed PNG with all 256 entries, 255 transparent and unlabelled
contours/000.png ..  per picture: grey PNG, how far drawn lines cover each pixel
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.picture import encode_grey_png, encode_indexed_png
from toonset.files import new_folder, write_bytes
from toonset.palette.files import to_gpl, to_json
from toonset.palette.palette import Palette

PALETTE_GPL, PALETTE_JSON = "palette.gpl", "palette.json"

Maps = Sequence[tuple[str, UInt8[np.ndarray, "_ _"]]]


def write_palette(folder: Path, palette: Palette, labels: Maps, contours: Maps = ()) -> None:
    """Write palette.json, palette.gpl, labels/ and contours/ into an existing folder.

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
    files = {
        PALETTE_GPL: to_gpl(palette).encode(),
        PALETTE_JSON: (json.dumps(to_json(palette), indent=2, allow_nan=False) + "\n").encode(),
    }
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
