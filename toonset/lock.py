"""Hold outputs: one process at a time writes to a place, and clears what killed ones left there."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from contextvars import ContextVar
from pathlib import Path

from toonset.errors import OutputError

try:
    import fcntl
except ImportError:  # Windows: nothing is locked there
    fcntl = None  # type: ignore[assignment]

Lock = tuple[int, Path]  # descriptor and name of a locked file
TEMPORARY, OLD = ".tmp", ".old"  # ends of hidden names: being written; about to be replaced
_COMMAND: ContextVar[ExitStack | None] = ContextVar("command", default=None)
_GUARD = threading.Lock()
_HELD: dict[Path, tuple[Lock | None, int]] = {}  # by output: its lock, how often it is held


@contextlib.contextmanager
def command() -> Iterator[None]:
    """Hold every output that is claimed within the block until it ends."""
    with ExitStack() as stack:
        token = _COMMAND.set(stack)
        try:
            yield
        finally:
            _COMMAND.reset(token)


def claim(path: Path) -> None:
    """Hold an output until the command ends; nothing outside of a command.

    Raises:
        OutputError: another process holds it.
    """
    stack = _COMMAND.get()
    if stack is not None:
        stack.enter_context(hold(path))


@contextlib.contextmanager
def hold(path: Path) -> Iterator[None]:
    """Hold an output; who holds it may hold it again.

    The lock is the system's on a hidden file beside the output, so that it ends with the process,
    however that ends. What killed processes left of this output is removed.

    Raises:
        OutputError: another process holds it.
    """
    path = Path(os.path.abspath(path))
    _acquire(path)
    try:
        yield
    finally:
        _release(path)


def is_temporary(name: str) -> bool:
    """Return whether a name is one of those that writing leaves if it is killed."""
    return re.fullmatch(rf"\..+\.[a-z0-9_]{{8}}({TEMPORARY}|{OLD})", name) is not None


def _acquire(path: Path) -> None:
    with _GUARD:
        if path in _HELD:
            lock, times = _HELD[path]
            _HELD[path] = lock, times + 1
            return
        _HELD[path] = _locked(path), 1
    _clear(path)


def _release(path: Path) -> None:
    with _GUARD:
        lock, times = _HELD.pop(path)
        if times > 1:
            _HELD[path] = lock, times - 1
        elif lock is not None:
            with contextlib.suppress(OSError):
                os.unlink(lock[1])
            os.close(lock[0])


def _locked(path: Path) -> Lock | None:
    """Return the locked file; None where the place or the system has no locks."""
    if fcntl is None or path.name == "":
        return None
    while True:
        file = _lock_file(path)
        try:
            descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError:  # not writable, or a name too long: whoever writes there says so
            return None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(descriptor), os.stat(file)):
                return descriptor, file
        except BlockingIOError as error:
            os.close(descriptor)
            raise OutputError(
                f"{path}: is in use by another toonset; wait for it, or choose another -o"
            ) from error
        except FileNotFoundError:  # its last owner has just taken it away: once more
            pass
        except OSError:  # a file system without locks
            os.close(descriptor)
            return None
        os.close(descriptor)


def _lock_file(path: Path) -> Path:
    """Return the file to lock, in the nearest folder that exists."""
    parent = next(place for place in path.parents if place.is_dir())
    return parent / f".{'~'.join(path.relative_to(parent).parts)}.lock"


def _clear(path: Path) -> None:
    """Remove what killed processes left; an old output that was put aside comes back."""
    pattern = re.compile(rf"\.{re.escape(path.name)}\.[a-z0-9_]{{8}}({TEMPORARY}|{OLD})")
    with contextlib.suppress(OSError):
        left = [entry for entry in path.parent.iterdir() if pattern.fullmatch(entry.name)]
        for entry in sorted(left, key=lambda entry: entry.stat().st_mtime, reverse=True):
            if entry.suffix == OLD and not path.exists():
                os.replace(entry, path)
            elif entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink()
