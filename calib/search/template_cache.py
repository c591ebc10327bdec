"""Cache a mesh's templates in the user's cache folder.

A file is named by the hash of the mesh and of the templates' settings, so it never is out of date.
Whatever goes wrong with the folder (no home, no permission, a full disk, a damaged file), templates
are built as if there were no cache.

Environment: TOONSET_CACHE names the folder. Else it is `toonset` in the system's place for caches:
XDG_CACHE_HOME or ~/.cache; ~/Library/Caches on macOS; LOCALAPPDATA on Windows.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from hashlib import sha256
from pathlib import Path

import numpy as np

from toonset.calib.outline.mesh_edges import Surface
from toonset.calib.search import templates
from toonset.calib.search.templates import Templates, build_templates
from toonset.errors import OutputError
from toonset.write import write_bytes

VERSION = 1  # of the file, and of anything in `build_templates` that is not a setting
MOST_FILES = 100
MOST_BYTES = 10_000_000  # a whole file has a fraction of this


def load_bank(surface: Surface) -> Templates:
    """Return `build_templates(surface)`, read from the cache where it is there and whole."""
    path = bank_path(surface)
    if path is None:
        return build_templates(surface)
    bank = _read(path)
    if bank is None:
        bank = build_templates(surface)
        _keep(path, bank)
    return bank


def bank_path(surface: Surface) -> Path | None:
    """Return the file of the surface's templates, or None without a cache folder."""
    folder = _cache_folder()
    if folder is None:
        return None
    settings = (VERSION, templates.CELL_PX, templates.OVERSAMPLE, templates.FIGURE_OF_CELL)
    digest = sha256(repr(settings).encode())
    for array in (templates.grid(), surface.vertices, surface.faces):
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return folder / f"templates-{digest.hexdigest()[:32]}.npz"


def _cache_folder() -> Path | None:
    chosen = os.environ.get("TOONSET_CACHE")
    if chosen:
        return Path(chosen)
    try:
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "toonset"
        if sys.platform == "win32":
            local = os.environ.get("LOCALAPPDATA")
            return (Path(local) if local else Path.home() / "AppData" / "Local") / "toonset"
        xdg = os.environ.get("XDG_CACHE_HOME")
        return (Path(xdg) if xdg else Path.home() / ".cache") / "toonset"
    except RuntimeError:  # no home folder
        return None


def _read(path: Path) -> Templates | None:
    """Return the file's templates, or None unless it is there and whole."""
    try:
        if not path.is_file() or path.stat().st_size > MOST_BYTES:
            return None
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            quarters, boxes = file["quarters"], file["boxes"]
    except Exception:  # whatever NumPy's reader makes of damage: a bank is built anew
        return None
    rotations = templates.grid()
    count = len(rotations)
    whole = quarters.shape == (count, templates.CELL_PX**2) and quarters.dtype == np.uint8
    whole = whole and boxes.shape == (count, 4) and boxes.dtype == np.float64
    if not whole or quarters.max() > templates.OVERSAMPLE**2 or not np.isfinite(boxes).all():
        return None
    return Templates(rotations, quarters.astype(np.float32) / templates.OVERSAMPLE**2, boxes)


def _keep(path: Path, bank: Templates) -> None:
    file = io.BytesIO()
    quarters = np.round(bank.masks * templates.OVERSAMPLE**2).astype(np.uint8)
    np.savez(file, quarters=quarters, boxes=bank.boxes)
    with contextlib.suppress(OutputError, OSError):
        write_bytes(path, file.getvalue())
        _forget_the_oldest(path.parent)


def _forget_the_oldest(folder: Path) -> None:
    files = sorted(folder.glob("templates-*.npz"), key=lambda file: file.stat().st_mtime)
    for file in files[:-MOST_FILES]:
        file.unlink(missing_ok=True)
