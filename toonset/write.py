"""Write files and folders in one step: under a temporary name, flushed to disk, renamed."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fnmatch
import json
import os
import re
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from toonset import lock
from toonset.errors import OutputError
from toonset.lock import GONE, OLD, TEMPORARY, flush, hold, is_of_set, is_temporary

LEFT_BY_DESKTOPS = (".DS_Store", "Thumbs.db", "desktop.ini")
THERE_ALREADY = (errno.ENOTEMPTY, errno.EEXIST)
ENDINGS = {signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}


def write_bytes(path: Path, data: bytes, *, lasting: bool = True) -> None:
    """Write `data` to `path` so that `path` holds either its old content or all of the new.

    Args:
        path: the file.
        data: its content.
        lasting: wait until the disk has it; else it may be lost if the machine loses power.

    Raises:
        OutputError: the place cannot be written (missing permission, full disk, a folder there).
    """
    new = next((folder for folder in path.parents if is_temporary(folder.name)), None)
    try:
        if new is not None and not new.is_dir():  # another program took it away, with its files
            raise FileNotFoundError(errno.ENOENT, "another program has removed it meanwhile")
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=TEMPORARY, dir=path.parent)
    except OSError as error:
        raise _output_error(path, error) from error
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            if lasting:
                os.fsync(file.fileno())
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
        if lasting and new is None:  # a new folder is flushed as a whole
            flush(path.parent)
    except OSError as error:
        raise _output_error(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            os.unlink(name)  # where it has not become the file


@contextlib.contextmanager
def new_files(path: Path, gone: Iterable[str] = (), *, force: bool) -> Iterator[Path]:
    """Yield an empty temporary folder whose files and folders come to lie beside each other.

    All or none of them, with one rename of the temporary folder: killed before it, nothing has
    changed; killed after it, `toonset.lock.settle` does what is left, for whoever reads or writes
    there next. Only what `toonset.lock.is_of_set` knows can be replaced so.

    Args:
        path: the file that names the others; they lie in its folder.
        gone: names that are to go if they are there.
        force: replace what is there.

    Raises:
        OutputError: something is there and `force` is off, it is in use by another process, or the
            place cannot be written.
    """
    path = Path(os.path.abspath(path))
    held = lock.set_of(path)
    _make_parents(path)
    with hold(held, path):
        temporary = _temporary_folder(held)
        try:
            yield temporary
            names = [entry.name for entry in temporary.iterdir()]
            for name in names:
                there = path.with_name(name)
                if not (is_of_set(temporary / name, held) and is_of_set(there, held)):
                    raise OutputError(f"{there}: cannot be replaced; choose another -o")
                if not force and os.path.lexists(there):
                    raise OutputError(_made_meanwhile(there))
            write_bytes(temporary / GONE, "\n".join(gone).encode())
            _flush_whole(temporary)
            decided = lock.decided_folder(held)
            with _undisturbed():
                os.rename(temporary, decided)
                flush(path.parent)
                lock.move_into_place(decided)
        except OSError as error:
            raise _output_error(path, error) from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


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
        OutputError: `path` exists and `force` is off, it is in use by another process, or the
            place cannot be written.
    """
    path = Path(os.path.abspath(path))
    _make_parents(path)
    with hold(path):
        check_new_folder(path, force=force)
        temporary = _temporary_folder(path)
        try:
            yield temporary
            _swap_in(temporary, path, force=force)
        except OSError as error:
            raise _output_error(path, error) from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


def check_output(
    out: Path, inputs: Iterable[str | Path | None], written: Sequence[str], *, force: bool
) -> None:
    """Refuse, before any work, an output folder that must not be written or replaced.

    --force replaces a whole folder, so it is held to folders that this verb has written before: a
    folder with drawings in it, or the one that the user works in, is never taken away.

    Args:
        out: the folder to write.
        inputs: what the command reads.
        written: patterns of the names that the verb writes into its folder.
        force: replace an existing folder.

    Raises:
        OutputError: the folder exists and `force` is off, or it holds anything but earlier results
            of this verb, or an input, or the current folder, or it cannot be written.
    """
    check_new_folder(out, force=force)
    if not out.is_dir():
        return
    _finish_inside(out)
    names = (*written, *LEFT_BY_DESKTOPS)
    entries = sorted(entry.name for entry in out.iterdir())
    foreign = [
        name
        for name in entries
        if not is_temporary(name) and not any(fnmatch.fnmatchcase(name, p) for p in names)
    ]
    if foreign:
        raise OutputError(
            f"{out}: holds {foreign[0]!r}, which this command does not write, so --force does not "
            "replace it; choose another -o"
        )
    kept = [Path(), *(Path(one) for one in inputs if one is not None and Path(one).exists())]
    for path in kept:
        if (entries or path == Path()) and path.resolve().is_relative_to(out.resolve()):
            what = "the current folder" if path == Path() else str(path)
            raise OutputError(f"{out}: holds {what}, --force would delete it; choose another -o")


def _finish_inside(folder: Path) -> None:
    """Finish or remove what killed processes left in a folder; refuse one that others write to."""
    for name in [entry.name for entry in folder.iterdir()]:
        if found := re.fullmatch(r"\.(.+)\.(lock|new)", name):
            with hold(folder / found[1]):
                pass


def check_new_file(path: Path, *, force: bool = False) -> None:
    """Refuse, before any work, a file that must not be written or replaced.

    Raises:
        OutputError: `path` is a folder, or a file and `force` is off, or its parent is no folder.
    """
    if path.is_dir():
        raise OutputError(f"{path}: is a folder, a file is needed; choose another -o")
    if path.exists() and not force:
        raise OutputError(
            f"{path}: exists already; pass --force to replace it, or choose another -o"
        )
    if path.parent.exists() and not path.parent.is_dir():
        raise OutputError(f"{path}: {path.parent} is a file; choose another -o")
    lock.claim(lock.set_of(path), path)


def check_new_folder(path: Path, *, force: bool = False) -> None:
    """Refuse, before any work, an output folder that `new_folder` would refuse.

    Raises:
        OutputError: `path` is a file, or a folder with something in it and `force` is off, or
            its parent cannot be written.
    """
    path = Path(os.path.abspath(path))
    try:
        existing = next(p for p in (*path.parents, path) if p.exists())
    except OSError as error:  # a name that is too long, a loop of links
        raise _output_error(path, error) from error
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path}: is a file, a folder is needed; choose another -o")
    if path.is_symlink():
        raise OutputError(f"{path}: is a link, a folder is needed; name the folder itself")
    if path.is_dir() and any(path.iterdir()) and not force:
        raise OutputError(
            f"{path}: exists already; pass --force to replace it, or choose another -o"
        )
    if not existing.is_dir():
        raise OutputError(f"{path}: {existing} is a file, not a folder; choose another -o")
    lock.claim(path)
    try:  # by trying: permission bits say nothing to root, nor about read-only disks
        probe = tempfile.mkdtemp(prefix=f".{path.name[:64]}.", suffix=TEMPORARY, dir=existing)
        os.rmdir(probe)
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(
            f"{path}: {existing} is not writable ({reason}); choose another -o"
        ) from error


def check_removable(path: Path, written: str) -> None:
    """Refuse a folder that holds anything but files of one pattern; no folder is fine.

    Raises:
        OutputError: it does, or it is a file or a link.
    """
    if not path.exists() and not path.is_symlink():
        return
    if path.is_symlink() or not path.is_dir():
        raise OutputError(f"{path}: is no folder of this command; move it away")
    for name in sorted(entry.name for entry in path.iterdir()):
        if not fnmatch.fnmatchcase(name, written) and name not in LEFT_BY_DESKTOPS:
            raise OutputError(f"{path}: holds {name!r}, which this command does not write; move it")


def _swap_in(temporary: Path, path: Path, *, force: bool) -> None:
    """Give a new folder its name; an old one comes to lie under the temporary name."""
    _flush_whole(temporary)
    try:
        os.rename(temporary, path)  # not onto a folder with something in it
    except OSError as error:
        if error.errno not in THERE_ALREADY:
            raise
        if not force:
            raise OutputError(_made_meanwhile(path)) from error
        exchange_folders(temporary, path)
    flush(path.parent)


def exchange_folders(new: Path, path: Path) -> None:
    """Put a folder where another is, which comes to lie where the first one was.

    In one step where the system can (Linux): whoever reads `path`, and whoever is killed, sees the
    one or the other. Elsewhere `path` is missing for a moment.

    Raises:
        OutputError: the place cannot be written.
    """
    try:
        if not _exchanged(new, path):
            old = _put_aside(path)
            try:
                os.replace(new, path)
            except OSError:
                os.replace(old, path)
                raise
            os.replace(old, new)
    except OSError as error:
        raise _output_error(path, error) from error


def _exchanged(new: Path, path: Path) -> bool:
    """Swap two names by Linux' renameat2; False if kernel or file system lacks it."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    here = -100  # AT_FDCWD
    exchange = 2  # RENAME_EXCHANGE
    return rename(here, os.fsencode(new), here, os.fsencode(path), exchange) == 0


def _put_aside(path: Path) -> Path:
    """Give a folder a temporary name, and return it."""
    old = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=OLD, dir=path.parent))
    os.replace(path, old)
    return old


def _make_parents(path: Path) -> None:
    """Make the folders above an output: its lock lies in the last of them."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _output_error(path, error) from error


def _temporary_folder(path: Path) -> Path:
    """Make an empty hidden folder beside `path`, named after it."""
    try:
        name = tempfile.mkdtemp(prefix=f".{path.name}.", suffix=TEMPORARY, dir=path.parent)
        os.chmod(name, 0o777 & ~_umask())
    except OSError as error:
        raise _output_error(path, error) from error
    return Path(name)


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Put off signals that end the program until a few renames are done."""
    heard: list[int] = []
    before = {}
    if threading.current_thread() is threading.main_thread():
        for number in ENDINGS:
            if signal.getsignal(number) is not None:  # not from outside of Python
                before[number] = signal.signal(number, lambda n, _: heard.append(n))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for one in heard:
            signal.raise_signal(one)


def _flush_whole(root: Path) -> None:
    for folder, _, _ in os.walk(root, topdown=False):
        flush(Path(folder))


def _made_meanwhile(path: Path) -> str:
    return f"{path}: another program has made it meanwhile; choose another -o"


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _output_error(path: Path, error: OSError) -> OutputError:
    reason = error.strerror or str(error)
    path = Path(*map(lock.named, path.parts))
    return OutputError(f"{path}: cannot be written ({reason}); free space or choose another -o")
