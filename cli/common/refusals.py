"""Say in one line what a user has to put right; a bug of ours has no such line."""

from __future__ import annotations

import errno
from typing import Any

import typer

from toonset.errors import ToonsetError, one_line

UsageError: type[Exception] = typer.BadParameter.__mro__[1]  # typer gives it no public name
RENAMED = {  # switches of before
    "--as-bent": "--no-unwarp",
    "--as-carved": "--no-fairing",
    "--as-placed": "--no-register",
    "--one-sided": "--symmetric off",
    "--no-symmetry": "--symmetric off",
}
PLACES_AT_FAULT = (  # what the system says of a place that the user has named, wherever it is used
    *(errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG, errno.ELOOP),
    *(errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.ESTALE),
)

UNMAPPED = "failed to map segment"  # what the system says of a library that finds no space
MORE_SPACE = "raise the limit: ulimit -v"


def refusal(error: Exception) -> str | None:
    """Return the line; None of a bug."""
    if isinstance(error, ToonsetError):
        return one_line(error)
    if isinstance(error, UsageError):
        return one_line(_usage(error))
    if isinstance(error, OSError) and error.errno in PLACES_AT_FAULT:
        if not isinstance(error.filename, str | None):
            return None
        place = one_line(error.filename or "standard output")
        return f"{place}: {error.strerror}; free or choose another place"
    if isinstance(error, ImportError) and UNMAPPED in str(error):
        return f"out of address space ({one_line(error)}); {MORE_SPACE}"
    if isinstance(error, MemoryError):
        return f"out of memory ({one_line(error)}); use smaller input"
    return None


def _usage(error: Any) -> str:
    """Return what is wrong with the command line, and where its help is."""
    said = error.format_message().replace("Value error, ", "").rstrip(". ")
    if (now := RENAMED.get(getattr(error, "option_name", ""))) is not None:
        said = f"No such option: {error.option_name}; did you mean {now}?"
    return f"{said}; see `{error.ctx.command_path} -h`" if error.ctx is not None else said
