"""A palette and its label maps on disk, in a bundle or in a folder of their own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.picture import encode_indexed_png
from toonset.errors import OutputError
from toonset.files import new_folder, write_bytes, write_json
from toonset.palette.files import to_gpl, to_json
from toonset.palette.palette import Palette

Labels = Sequence[tuple[str, UInt8[np.ndarray, "_ _"]]]


def write_palette(folder: Path, palette: Palette, labels: Labels) -> None:
    """Write palette.json, palette.gpl and labels/ into an existing folder, replacing older ones.

    palette.json is taken away first and written last: whenever it is there, the labels fit it.

    Args:
        folder: a bundle, or a new folder.
        palette: the colours.
        labels: file name and label map of every picture.

    Raises:
        OutputError: the folder cannot be written.
    """
    try:
        (folder / "palette.json").unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"{folder}: cannot be written ({error.strerror}); check its permissions"
        ) from error
    with new_folder(folder / "labels", force=True) as temporary:
        for name, values in labels:
            write_bytes(temporary / name, encode_indexed_png(values, palette.rgb))
    write_bytes(folder / "palette.gpl", to_gpl(palette).encode())
    write_json(folder / "palette.json", to_json(palette))
