"""The `toonset` program: verbs, errors to exit codes, nothing heavy imported before a verb runs.

Exit codes: 0 fine; 1 our bug; 2 bad input or usage; 3 done, but a view is weak or ambiguous;
130 interrupted.
"""

from __future__ import annotations

import errno
import importlib
import os
import sys
from typing import Annotated, NoReturn

import typer

from toonset import __version__
from toonset.errors import ToonsetError

VERBS = (
    "calibrate",
    "palette",
    "train",
    "render",
    "evaluate",
    "export",
    "mannequin",
    "synth",
    "bench",
)

INTERRUPTED = 130
PLACES_AT_FAULT = (  # what the system says of a place that the user has named, wherever it is used
    *(errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG, errno.ELOOP),
    *(errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.ESTALE),
)

app = typer.Typer(
    name="toonset",
    help="Turn a hand-drawn character sheet into cameras, a palette and a turning character.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",  # a paragraph flows to the width of the terminal
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"toonset {__version__}")
        raise typer.Exit


@app.callback()
def toonset(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Turn a hand-drawn character sheet into cameras, a palette and a turning character."""


for _verb in VERBS:
    app.command(_verb)(getattr(importlib.import_module(f"toonset.cli.{_verb}"), _verb))


def main() -> None:
    """Run the command line and leave with its exit code."""
    # Waiting threads that spin cost a loaded machine an order of magnitude; must precede torch.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    # NumPy's matrices are small here, and torch has threads of its own; must precede numpy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        app()
    except ToonsetError as error:
        _refuse(one_line(error))
    except SystemExit as leaving:
        if leaving.code == INTERRUPTED:  # typer has caught Ctrl-C
            _say("interrupted")
        raise
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        if error.errno not in PLACES_AT_FAULT or not isinstance(error.filename, str):
            raise
        place, reason = one_line(error.filename), error.strerror
        _refuse(f"{place}: {reason}; free or choose another place")
    except MemoryError as error:
        _refuse(f"out of memory ({one_line(error)}); use smaller input")


def _refuse(text: str) -> NoReturn:
    _say(text)
    sys.exit(2)


def _say(text: str) -> None:
    over_progress = "\r\x1b[K" if sys.stderr.isatty() else ""
    print(f"{over_progress}toonset: {text}", file=sys.stderr)


def one_line(error: object) -> str:
    """Return the message on one line, without control characters (file names are foreign text)."""
    text = " ".join(str(error).split())
    return "".join(c if c.isprintable() else "?" for c in text)
