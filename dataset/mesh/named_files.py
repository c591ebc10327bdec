"""Find the files that a mesh names, in its own folder and nowhere else.

Meshes name them as they lay on another computer: with drives, absolute paths, backslashes, quotes,
capitals that the file does not have. The longest end of such a path that leads to a file below the
mesh's folder is meant.
"""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

MOST_FOLDERS = 16  # of a path that are tried


def beside(mesh_path: Path, name: str) -> Path | None:
    """Return the file below the mesh's own folder that a name means; None if there is none."""
    folder = os.path.realpath(mesh_path.parent)

    def names_in(place: str) -> Sequence[str]:
        try:
            return os.listdir(os.path.join(folder, place))
        except OSError:
            return ()

    for found in matches(name, names_in):
        file = os.path.realpath(os.path.join(folder, found))
        if os.path.commonpath([folder, file]) == folder and os.path.isfile(file):
            return Path(file)
    return None


def matches(name: str, names_in: Callable[[str], Sequence[str]]) -> Iterator[str]:
    """Yield the paths below a folder that a name may mean, the likeliest first.

    Args:
        name: as a file has it.
        names_in: returns the names in a folder below that folder, "" for itself.
    """
    for written in dict.fromkeys([name, unquote(name)]):
        for end in ends_of(written):
            found = ""
            for part in end:
                names = names_in(found)
                own = part if part in names else _alike(part, names)
                if own is None:
                    break
                found = f"{found}/{own}" if found else own
            else:
                yield found


def ends_of(name: str) -> Iterator[list[str]]:
    """Yield the ends of a path, folder by folder, the longest first; nothing of one to no file."""
    path = name.strip().strip("\"'").replace("\\", "/")
    parts = [part for part in path.split("/") if part not in ("", ".")]
    if "\0" in name or not parts:
        return
    for start in range(max(0, len(parts) - MOST_FOLDERS), len(parts)):
        if ".." not in parts[start:]:
            yield parts[start:]


def _alike(name: str, names: Sequence[str]) -> str | None:
    """Return the name that differs in capitals or in how its accents are written only."""
    wanted = _plain(name)
    return next((one for one in sorted(names) if _plain(one) == wanted), None)


def _plain(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()
