"""The process that runs a sheet: what it prints goes to a log, and its memory is watched."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import re
import resource
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

from toonset.apps.batch.stages import STAGES
from toonset.errors import printable

BEGINS, BEGUN = "--- ", re.compile(rb"(?m)^--- ([a-z]+)$")  # lines that say which stage is run
OVER_MEMORY = "batch: took more than"  # begins the line that says so
FATAL = "Fatal Python error"  # begins what faulthandler says of a crash, the last call first
GUARD_S = 0.1  # between looks at the memory in use
LINES, CHARACTERS = 12, 2000  # of a log that are kept
READ = 1 << 16  # bytes of its end that are looked at: a crash names all modules


@contextlib.contextmanager
def logged(file: Path, memory_mb: int) -> Iterator[None]:
    """Let all that is printed go to a file, and end the process when it takes too much memory."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(1), os.dup(2)]
    log = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
    streams = sys.stdout, sys.stderr
    done = threading.Event()
    guard = threading.Thread(target=_guard, args=(memory_mb, done), daemon=True)
    try:
        for number in (1, 2):
            os.dup2(log, number)
        sys.stdout, sys.stderr = (open(n, "w", closefd=False, errors="replace") for n in (1, 2))
        faulthandler.disable()  # libraries may have put handlers of their own over it
        faulthandler.enable(2, all_threads=False)
        if memory_mb:
            guard.start()
        yield
    finally:
        done.set()
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = streams
        for number, descriptor in zip((1, 2), kept, strict=True):
            os.dup2(descriptor, number)
            os.close(descriptor)
        os.close(log)


def _guard(memory_mb: int, done: threading.Event) -> None:
    """End the process when it takes more memory than it may."""
    while not done.wait(GUARD_S):
        if _memory_mb() > memory_mb:
            os.write(2, f"\n{OVER_MEMORY} {memory_mb} MB of memory\n".encode())
            os._exit(1)


def _memory_mb() -> float:
    """Return the memory in use: on Linux now, elsewhere the most so far."""
    try:
        pages = int(Path("/proc/self/statm").read_bytes().split()[1])
    except OSError:
        return peak_mb()
    return pages * resource.getpagesize() / 2**20


def forget_peak() -> None:
    """Let the process' peak of memory start anew, where the system can."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_bytes(b"5")


def peak_mb() -> float:
    """Return the most memory of the process, since `forget_peak` where the system can."""
    try:
        status = Path("/proc/self/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) / 1024
    except (OSError, IndexError):
        unit = 2**20 if sys.platform == "darwin" else 2**10
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def last_lines(log: Path) -> str:
    """Return the end of what a sheet's worker has printed."""
    try:
        text = log.read_bytes()[-READ:].decode("utf-8", "replace")
    except OSError:
        return ""
    lines = [printable(line) for line in text.splitlines() if line.strip()]
    fatal = next((i for i, line in enumerate(lines) if line.startswith(FATAL)), None)
    kept = lines[-LINES:] if fatal is None else lines[max(fatal - 2, 0) :][:LINES]
    return "\n".join(kept)[:CHARACTERS]


def over_memory(log: str) -> str:
    """Return the line by which a worker ended itself for the memory it took, or ""."""
    found = (line for line in log.splitlines() if line.startswith(OVER_MEMORY))
    said = next(found, "").removeprefix("batch: ")
    return f"{said}; raise --memory-limit, then --retry-failed" if said else ""


def last_stage(log: Path) -> str:
    """Return the stage that was run last, as a log says; "" of none."""
    try:
        found = [name.decode() for name in BEGUN.findall(log.read_bytes())]
    except OSError:
        return ""
    return next((name for name in reversed(found) if name in STAGES), "")
