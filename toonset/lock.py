"""Hold outputs: one process at a time writes to a place, and clears what killed ones left there."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import threading
import time
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
NEW = ".new"  # of a hidden folder: files that are decided to come to lie beside it
GONE, BEFORE = ".gone", ".before"  # in it: names that are to go; what has been replaced
PALETTE = "palette"  # the one set of files that has folders, too
FOLDERS = ("contours", "coverage", "labels", "tones")
MOST_GONE = 4096  # bytes of names that are to go
PATIENCE_S, NAP_S = 10.0, 0.02  # to wait for a process that is moving files into place
_COMMAND: ContextVar[ExitStack | None] = ContextVar("command", default=None)
_GUARD = threading.Lock()
_HELD: dict[Path, tuple[tuple[Lock, ...], int]] = {}  # by output: locks, how often it is held


@contextlib.contextmanager
def command() -> Iterator[None]:
    """Hold every output that is claimed within the block until it ends."""
    with ExitStack() as stack:
        token = _COMMAND.set(stack)
        try:
            yield
        finally:
            _COMMAND.reset(token)


def claim(path: Path, name: Path | None = None) -> None:
    """Hold an output until the command ends; nothing outside of a command.

    Nor within a temporary folder: it is its writer's own, and will have another name by then.

    Args:
        path: the output.
        name: what a message calls it, if it is another one's of its set.

    Raises:
        OutputError: another process holds it.
    """
    stack = _COMMAND.get()
    if stack is not None and not any(is_temporary(folder.name) for folder in path.parents):
        stack.enter_context(hold(path, name))


@contextlib.contextmanager
def hold(path: Path, name: Path | None = None, patience_s: float = 0) -> Iterator[None]:
    """Hold an output; who holds it may hold it again.

    The lock is the system's on a hidden file beside the output, so that it ends with the process,
    however that ends. What killed processes left of this output is finished or removed.

    Args:
        path: the output.
        name: what a message calls it, if it is another one's of its set.
        patience_s: how long to wait for another process.

    Raises:
        OutputError: another process holds it, or what one left cannot be finished.
    """
    path = Path(os.path.abspath(path))
    _acquire(path, name or path, patience_s)
    try:
        yield
    finally:
        _release(path)


def set_of(path: Path) -> Path:
    """Return what files that are replaced together are held by: their name up to its first dot.

    White space counts as "_", since the files that belong to an OBJ have none in their names.
    """
    path = Path(os.path.abspath(path))
    name = "_".join(path.name.split())
    start = name[:1] + name[1:].split(".")[0]
    return path.with_name(start if start.strip(".") else "_") if path.name else path


def is_of_set(path: Path, held: Path) -> bool:
    """Return whether a file or folder may be replaced together with a set's others.

    Folders of the palette only: a bundle from elsewhere may bring a hidden folder of any name.
    """
    if path.is_symlink():
        return False
    if path.name in FOLDERS and held.name == PALETTE:
        return path.is_dir() or not path.exists()
    return set_of(path).name == held.name and not path.is_dir()


def settle(path: Path) -> None:
    """Finish what a killed process had decided to write at `path` and beside it; before reading.

    Raises:
        OutputError: the place cannot be written.
    """
    held = set_of(path)
    try:
        decided = decided_folder(held)
        is_left = decided.is_dir() and not decided.is_symlink()
    except (OSError, ValueError):  # whoever reads there says so
        return
    if is_left:
        with hold(held, path, PATIENCE_S):
            pass


def decided_folder(held: Path) -> Path:
    """Return the hidden folder of files that are decided to be replaced together."""
    return held.with_name(f".{held.name}{NEW}")


def move_into_place(decided: Path) -> None:
    """Let decided files and folders take their places beside `decided`, which is removed.

    Whoever is killed here is followed by somebody who does what is left.

    Raises:
        OutputError: the folder holds what no toonset puts there.
        OSError: the place cannot be written.
    """
    before, gone, beside = decided / BEFORE, decided / GONE, decided.parent
    held = beside / decided.name.removeprefix(".").removesuffix(NEW)
    new = [entry for entry in decided.iterdir() if entry not in (before, gone)]
    old = _names_in(gone)
    moved = [*new, *(beside / name for name in (*old, *(entry.name for entry in new)))]
    for path in (before, *moved):
        known = not path.is_symlink() if path == before else is_of_set(path, held)
        if path.parent not in (decided, beside) or not known:
            raise OutputError(f"{decided}: holds {path.name!r}, which no toonset wrote; remove it")
    before.mkdir(exist_ok=True)
    for name in old:
        _put_into(before, beside / name)
    for entry in sorted(new, key=lambda entry: (entry.is_file(), entry.name)):
        if entry.is_dir():
            _put_into(before, beside / entry.name)
        os.replace(entry, beside / entry.name)
    flush(beside)
    shutil.rmtree(decided)


def _names_in(gone: Path) -> list[str]:
    """Return the names that are to go."""
    if not os.path.lexists(gone):
        return []
    if gone.is_symlink() or not gone.is_file() or gone.stat().st_size > MOST_GONE:
        raise OutputError(f"{gone}: was written by no toonset; remove its folder")
    return gone.read_text("utf-8", "replace").splitlines()


def flush(folder: Path) -> None:
    """Write a folder's names to disk, where the system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def is_temporary(name: str) -> bool:
    """Return whether a name is one of those that writing leaves if it is killed."""
    return named(name) != name


def named(name: str) -> str:
    """Return what is written under a temporary name; other names as they are."""
    found = re.fullmatch(rf"\.(.+)\.[a-z0-9_]{{8}}({TEMPORARY}|{OLD})", name)
    return found[1] if found else name


def _acquire(path: Path, name: Path, patience_s: float) -> None:
    with _GUARD:
        locks, times = _HELD.get(path, ((), 0))
        if _lock_file(path) not in [file for _, file in locks]:  # its folder may have come since
            new = _locked(path, name, patience_s)
            locks = locks if new is None else (*locks, new)
        _HELD[path] = locks, times + 1
    if times:
        return
    try:
        _finish(path)
    except OutputError:
        _release(path)
        raise
    if locks:  # else it may be another's who writes
        _sweep(path)


def _release(path: Path) -> None:
    with _GUARD:
        locks, times = _HELD.pop(path)
        if times > 1:
            _HELD[path] = locks, times - 1
            return
        for descriptor, file in reversed(locks):
            with contextlib.suppress(OSError):
                if os.path.samestat(os.fstat(descriptor), os.stat(file)):
                    os.unlink(file)
            os.close(descriptor)


def _locked(path: Path, name: Path, patience_s: float) -> Lock | None:
    """Return the locked file; None where the place or the system has no locks."""
    if fcntl is None or path.name == "":
        return None
    until = time.monotonic() + patience_s
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
            if time.monotonic() < until:
                time.sleep(NAP_S)
                continue
            raise OutputError(
                f"{name}: is in use by another toonset; wait for it, or choose another -o"
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


def _finish(path: Path) -> None:
    """Go on with moving files into place where another process was killed."""
    decided = decided_folder(path)
    try:
        if decided.is_dir() and not decided.is_symlink():
            move_into_place(decided)
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(
            f"{decided}: holds results that cannot be put in place ({reason}); make the folder "
            "writable"
        ) from error


def _sweep(path: Path) -> None:
    """Remove what killed processes left; an old output that was put aside comes back."""
    pattern = re.compile(rf"\.{re.escape(path.name)}\.[a-z0-9_]{{8}}({TEMPORARY}|{OLD})")
    with contextlib.suppress(OSError):
        left = [entry for entry in path.parent.iterdir() if pattern.fullmatch(entry.name)]
        for entry in sorted(left, key=lambda entry: entry.lstat().st_mtime, reverse=True):
            if entry.suffix == OLD and not path.exists():
                os.replace(entry, path)
            elif entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink()


def _put_into(folder: Path, path: Path) -> None:
    """Move a file or folder away, if it is there."""
    if os.path.lexists(path):
        os.replace(path, Path(tempfile.mkdtemp(dir=folder)) / path.name)
