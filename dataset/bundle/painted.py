"""Read a bundle's drawings with their palette and labels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from toonset.dataset.bundle.read_scene import (
    check_label_names,
    label_name,
    read_contour,
    read_labels,
    read_palette_of,
    read_picture,
    read_tones,
)
from toonset.dataset.bundle.transforms_read import read_frames, transforms_file
from toonset.errors import BundleError
from toonset.palette.extract import PaintMap
from toonset.palette.palette import Palette


@dataclass(frozen=True, eq=False)
class Painted:
    """A drawing and its paint.

    Attributes:
        name: of its label map's file.
        picture: the character on transparent ground.
        paint: labels and tones.
        contour: how far drawn lines cover every pixel, 255 = wholly.
    """

    name: str
    picture: UInt8[np.ndarray, "height width 4"]
    paint: PaintMap
    contour: UInt8[np.ndarray, "height width"]


def read_painted(path: Path) -> tuple[Palette, list[Painted]]:
    """Return a bundle's palette and its drawings.

    Raises:
        BundleError: a file is missing, broken, or does not belong to the others.
        PaletteError: palette.json is broken.
        PictureError: a picture cannot be read.
    """
    file = transforms_file(path)
    root = file.parent
    palette = read_palette_of(root)
    if palette is None:
        raise BundleError(f"{root}: has no palette.json; run `toonset palette` first")
    frames = read_frames(file, need_pictures=True)
    check_label_names(file, frames)
    found = []
    for frame in frames:
        picture = read_picture(frame, file)
        labels = read_labels(root, frame, len(palette.colors))
        contour = read_contour(root, frame)
        tones = read_tones(root, frame) if palette.has_tones else None
        parts = {"labels": labels, "contours": contour}
        if palette.has_tones:
            parts["tones"] = tones
        for folder, values in parts.items():
            if values is None:
                name = f"{folder}/{label_name(frame)}"
                raise BundleError(f"{root / name}: is missing; run `toonset palette` again")
        assert labels is not None
        assert contour is not None
        found.append(Painted(label_name(frame), picture, PaintMap(labels, tones), contour))
    return palette, found
