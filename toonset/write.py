"""Writing without half-written results: temporary name, flush to disk, rename."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from toonset.errors import OutputError


def write_bytes(path: Path, data: bytes) -> None:
    """Write `data` to `path` so that `path` holds either its old content or all of the new.

    Raises:
        OutputError: the place cannot be written (missing permission, full disk, a folder there).
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
    except OSError as error:
        raise _output_error(path, error) from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise _output_error(path, error) from error


def write_json(path: Path, value: Any) -> None:
    """Write `value` as JSON (no NaN, two-space indent, sorted as given), atomically."""
    write_bytes(path, (json.dumps(value, indent=2, allow_nan=False) + "\n").encode())


@contextlib.contextmanager
def new_folder(path: Path, *, force: bool = False) -> Iterator[Path]:
    """Yield an empty temporary folder that becomes `path` when the block ends without an error.

    Args:
        path: the folder to make.
        force: replace an existing folder; without it one that is not empty is refused.

    Raises:
        OutputError: `path` exists and `force` is off, or the place cannot be written.
    """
    path = Path(os.path.abspath(path))
    check_new_folder(path, force=force)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent))
        temporary.chmod(0o777 & ~_umask())
    except OSError as error:
        raise _output_error(path, error) from error
    try:
        yield temporary
        _swap_in(temporary, path)
    except OSError as error:
        raise _output_error(path, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def check_new_folder(path: Path, *, force: bool = False) -> None:
    """Refuse, before any work, an output folder that `new_folder` would refuse.

    Raises:
        OutputError: `path` is a file, or a folder with something in it and `force` is off, or
            its parent cannot be written.
    """
    path = Path(os.path.abspath(path))
    try:
        existing = next(p for p in (path, *path.parents) if p.exists())
    except OSError as error:  # a name that is too long, a loop of links
        raise _output_error(path, error) from error
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path}: is a file, a folder is needed; choose another -o")
    if path.is_dir() and any(path.iterdir()) and not force:
        raise OutputError(
            f"{path}: exists already; pass --force to replace it, or choose another -o"
        )
    if not existing.is_dir():
        raise OutputError(f"{path}: {existing} is a file, not a folder; choose another -o")
    try:  # by trying: permission bits say nothing to root, nor about read-only disks
        os.rmdir(tempfile.mkdtemp(prefix=f".{path.name[:64]}.", suffix=".tmp", dir=existing))
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(
            f"{path}: {existing} is not writable ({reason}); choose another -o"
        ) from error


def _swap_in(temporary: Path, path: Path) -> None:
    if not path.exists():
        os.replace(temporary, path)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{path.name}.old.", suffix=".tmp", dir=path.parent))
    os.replace(path, old)
    os.replace(temporary, path)
    shutil.rmtree(old, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _output_error(path: Path, error: OSError) -> OutputError:
    reason = error.strerror or str(error)
    return OutputError(f"{path}: cannot be written ({reason}); free space or choose another -o")
