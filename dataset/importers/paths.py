"""Find an imported view's picture and mask inside the folders that were named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from toonset.camera import Camera
from toonset.dataset.bundle.transforms_read import is_inside, spellings
from toonset.errors import BundleError


@dataclass(frozen=True, eq=False)
class ImportView:
    """One posed picture of another program.

    Attributes:
        name: of the picture, as the program has it.
        camera: in pixels of the picture.
        picture: its file.
        mask: its mask (white = figure), or None.
    """

    name: str
    camera: Camera
    picture: Path
    mask: Path | None


def find_picture(folders: Sequence[Path], name: str, where: str) -> Path:
    """Return the file of that name in the first folder that has it.

    Raises:
        BundleError: none has it, or the name leads out of the folder.
    """
    found = _first(folders, [name], where)
    if found is None:
        raise BundleError(f"{where}: the picture does not exist; put it there, or give --images")
    return found


def find_mask(folders: Sequence[Path], name: str) -> Path | None:
    """Return the mask of a picture: NAME.png (COLMAP's) or STEM.png; None if missing."""
    return _first(folders, [f"{name}.png", str(Path(name).with_suffix(".png"))], f"mask of {name}")


def _first(folders: Sequence[Path], names: Sequence[str], where: str) -> Path | None:
    try:
        for name in names:
            if not name or not name.isprintable():
                raise ValueError("control characters")
            for folder, own in product(folders, spellings(name)):
                if not is_inside(folder, folder / own):
                    raise BundleError(f"{where}: lies outside of the folder; it must be inside it")
                if (folder / own).is_file():
                    return folder / own
    except (OSError, ValueError, RuntimeError) as error:  # too long, a loop of links, a NUL
        raise BundleError(f"{where}: is no file name; correct it") from error
    return None
