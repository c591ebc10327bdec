"""Run verbs in forked children: their exit code, their stderr in a file."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

FINE = (0, 3)


@dataclass(frozen=True)
class Ended:
    """How a child ended: exit code, negative by a signal; its stderr; how long it took."""

    code: int
    err: str
    seconds: float = 0.0


def in_child(line: str) -> None:
    """Run a verb that must not fail."""
    if (child := os.fork()) == 0:
        with leaving(Path("err")):
            call_main(shlex.split(line))
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code in FINE, (line, code, Path("err").read_text())


@contextlib.contextmanager
def leaving(err: Path) -> Iterator[None]:
    """Run a block as a child's whole life, its stderr in a file."""
    errors_into(err)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    code: object = 0
    try:
        yield
    except SystemExit as ended:
        code = ended.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    finally:
        with contextlib.suppress(OSError):
            sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 1)


def errors_into(file: Path) -> None:
    """Let this process write its stderr into a new file."""
    os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)


def call_main(arguments: Sequence[str]) -> None:
    """Run a verb in this process; it leaves by SystemExit."""
    from toonset.__main__ import main

    sys.argv = ["toonset", *arguments]
    main()
