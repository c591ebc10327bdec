"""Count the calls of the operating system that touch outputs, and let one fail or be the last."""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

Hook = Callable[[int], None]

ERRORS = {"EIO": errno.EIO, "ENOSPC": errno.ENOSPC, "EACCES": errno.EACCES}
FAILURES = tuple(f"{name}{way}" for name in ERRORS for way in (" once", " from there"))
PATCHED = ("open", "fsync", "rename", "replace", "link", "unlink", "rmdir", "mkdir", "chmod")


class Calls:
    """Calls of the operating system that touch files below a folder; each asks `hook` first."""

    def __init__(self, root: Path, hook: Hook) -> None:
        """Count from now on in this process."""
        self.root, self.hook, self.count = str(root), hook, 0
        for name in PATCHED:
            setattr(os, name, self._counted(getattr(os, name)))
        real = os.fdopen
        os.fdopen = lambda fd, mode="r", *rest: (  # type: ignore[assignment]
            _Written(self, fd) if mode == "wb" else real(fd, mode, *rest)
        )
        from toonset import write

        exchanged = write._exchanged
        write._exchanged = lambda new, path: self._exchange(exchanged, new, path)

    def reached(self) -> None:
        """Count a call."""
        self.count += 1
        self.hook(self.count)

    def _exchange(self, real: Callable[[Path, Path], bool], new: Path, path: Path) -> bool:
        try:
            self.reached()
        except OSError:
            return False  # as a file system says that cannot
        return real(new, path)

    def _counted(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            if any(map(self._is_ours, (*arguments[:2], named.get("dir_fd")))):
                self.reached()
            return real(*arguments, **named)

        return call

    def _is_ours(self, argument: Any) -> bool:
        if isinstance(argument, int) and not isinstance(argument, bool) and argument > 2:
            try:
                argument = os.readlink(f"/proc/self/fd/{argument}")
            except OSError:
                return False
        return isinstance(argument, str | Path) and str(argument).startswith(self.root)


class _Written:
    """A new file: half of what is to be written is there when a call fails."""

    def __init__(self, calls: Calls, descriptor: int) -> None:
        self._calls, self._file = calls, open(descriptor, "wb", buffering=0)
        self.flush, self.fileno = self._file.flush, self._file.fileno

    def __enter__(self) -> _Written:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, data: bytes) -> None:
        """Write half, count, write the rest."""
        self._file.write(data[: len(data) // 2])
        self._calls.reached()
        self._file.write(data[len(data) // 2 :])


def fault(kind: str, at: int) -> Hook:
    """Return what happens at the call of a number, or from it on."""

    def hook(number: int) -> None:
        if number < at or (number > at and not kind.endswith("from there")):
            return
        if kind == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        code = ERRORS[kind.split()[0]]
        raise OSError(code, os.strerror(code), "a file")

    return hook
