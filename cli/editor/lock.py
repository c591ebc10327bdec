"""Lock a bundle for one server, by a file beside it that names process and port."""

from __future__ import annotations

import contextlib
import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from toonset.errors import BundleError

ANSWER_S = 0.5  # a port of this machine answers at once


@contextmanager
def locked(folder: Path, port: int) -> Iterator[None]:
    """Keep others from editing a bundle meanwhile.

    A lock whose process has ended, or whose port does not answer, was left behind: it is taken.

    Raises:
        BundleError: it is being edited.
    """
    file = folder.absolute().parent / f".{folder.absolute().name}.edit.lock"
    owner = _owner(file)
    if owner is None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.unlink(missing_ok=True)
        with contextlib.suppress(FileExistsError), file.open("x") as new:
            json.dump({"pid": os.getpid(), "port": port}, new)
        owner = _pid(file)  # another's, who was faster
    if owner != os.getpid():
        raise BundleError(
            f"{folder}: is being edited by process {owner}; use its page, or stop it with Ctrl-C"
        )
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            if _pid(file) == os.getpid():
                file.unlink()


def _pid(file: Path) -> int | None:
    """Return the process id in the lock; None if the lock is missing or unreadable."""
    try:
        return int(json.loads(file.read_bytes())["pid"])
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _owner(file: Path) -> int | None:
    """Return the process that edits; None if it has ended."""
    pid = _pid(file)
    if pid is None:
        return None
    try:
        os.kill(pid, 0)
    except PermissionError:
        pass  # somebody else's
    except (OSError, OverflowError):
        return None
    try:
        port = int(json.loads(file.read_bytes())["port"])
        socket.create_connection(("127.0.0.1", port), ANSWER_S).close()
    except (OSError, ValueError, TypeError, KeyError, OverflowError):
        return None
    return pid
