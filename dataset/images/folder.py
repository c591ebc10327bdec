"""List a folder's pictures in natural order: view2 before view10; say what else lies there.

A folder means its flat pictures only. Working files (PSD, Krita ...) are read where they are named:
beside hero.psd there usually is the hero.png that was exported from it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from toonset.errors import SheetError

# what loses least first: of hero.png and hero.jpg the first is the drawing
ENDINGS = (".png", ".tif", ".tiff", ".bmp", ".webp", ".avif", ".gif", ".jpg", ".jpeg")
WORKING = (".psd", ".psb", ".kra", ".ora", ".pdf")
UNREAD = (
    *(".heic", ".heif", ".jxl", ".jp2", ".j2k", ".jpx", ".exr", ".hdr", ".tga", ".dds", ".svg"),
    *(".clip", ".sai", ".sai2", ".procreate", ".xcf", ".aseprite", ".afphoto", ".afdesign", ".mdp"),
    *(".ai", ".eps"),
)
MOST_NAMES = 3  # of files that are left out; more are counted


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


def left_out_lines(others: Sequence[str]) -> list[str]:
    """Return lines, for people, about a folder's files that are not taken; drawings come first."""
    rest = [name for name in others if not name.lower().endswith((*WORKING, *UNREAD))]
    said = drawing_lines(others)
    return [*said, f"no pictures, left out: {_some(rest)}"] if rest else said


def drawing_lines(others: Sequence[str]) -> list[str]:
    """Return those lines of `left_out_lines` that are about drawings."""
    working = [name for name in others if name.lower().endswith(WORKING)]
    unread = [name for name in others if name.lower().endswith(UNREAD)]
    kinds = (
        (working, f"working files, left out: {_some(working)}; name one itself to read it"),
        (unread, f"of kinds that are not read, left out: {_some(unread)}; save them as PNG"),
    )
    return [line for names, line in kinds if names]


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more


def natural_key(name: str) -> tuple[tuple[tuple[int, int | str], ...], str]:
    """Return a sort key by which view2 comes before view10; capitals make no difference."""
    parts = re.split(r"([0-9]+)", name.casefold())
    key = tuple((0, int(part)) if part.isdecimal() else (1, part) for part in parts if part)
    return key, name
