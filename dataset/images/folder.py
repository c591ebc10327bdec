"""List a folder's pictures in natural order: view2 before view10."""

from __future__ import annotations

import re
from pathlib import Path

from toonset.errors import SheetError

ENDINGS = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp", ".gif")


def picture_files(folder: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Return a folder's pictures in natural order, and the names of its other files.

    Pictures are told by their endings; names that start with a dot are the system's and are
    counted neither way.

    Raises:
        SheetError: the folder cannot be read.
    """
    try:
        entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    except OSError as error:
        reason = error.strerror or str(error)
        raise SheetError(f"{folder}: cannot be read ({reason}); check its permissions") from error
    entries.sort(key=lambda entry: natural_key(entry.name))
    pictures = tuple(entry for entry in entries if entry.suffix.lower() in ENDINGS)
    others = tuple(entry.name for entry in entries if entry not in pictures)
    return pictures, others


def natural_key(name: str) -> tuple[tuple[tuple[int, int | str], ...], str]:
    """Return a sort key by which view2 comes before view10; capitals make no difference."""
    parts = re.split(r"([0-9]+)", name.casefold())
    key = tuple((0, int(part)) if part.isdecimal() else (1, part) for part in parts if part)
    return key, name
