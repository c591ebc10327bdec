"""Run the `toonset` program: load a verb when it is called, turn errors into exit codes.

Exit codes: 0 fine; 1 our bug; 2 bad input or usage; 3 done, but a person should look (a view or a
run is not ok, a cut is doubtful, a drawing contradicts the others); 128 + n ended by signal n, as
130 is Ctrl-C.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Annotated, NoReturn

import typer

from toonset import __version__, lock
from toonset.cli.common.flags import command_of
from toonset.cli.common.help import Verb, Verbs, complete_at_first_tab
from toonset.cli.common.output import lead_nowhere, say
from toonset.cli.common.refusals import MORE_SPACE, refusal
from toonset.cli.common.verbs import VERBS, function_of
from toonset.errors import ToonsetError

CATCHES_ALL = "trimesh"  # the one package here that goes on after any exception
NAP_S = 0.02  # until a signal is heard again
BY_SIGNAL = 128  # plus the signal's number, as shells have it
INTERRUPTED, REFUSED = BY_SIGNAL + signal.SIGINT, 2
LEAST_SPACE = 800_000_000  # bytes of addresses; `palette` never ended with 600 MB

app = typer.Typer(
    name="toonset",
    help="Turn a hand-drawn character sheet into cameras, a palette and a turning character.",
    cls=Verbs,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
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


complete_at_first_tab()
for _verb in VERBS:
    app.command(_verb, cls=Verb)(command_of(function_of(_verb)))


def main() -> None:
    """Run the command line and leave with its exit code."""
    run(app, "toonset")


class Ended(SystemExit):
    """The program is ended by a signal: whatever is being written is cleared away first."""

    def __init__(self, number: int) -> None:
        """Take the signal's number."""
        super().__init__(BY_SIGNAL + number)
        self.number = number


def run(program: typer.Typer, name: str) -> None:
    """Run a program of verbs and leave with its exit code; mistakes are one line on stderr."""
    _open_streams()
    _end_by_signals()
    # Waiting threads that spin cost a loaded machine an order of magnitude; must precede torch.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    # NumPy's matrices are small here, and torch has threads of its own; must precede numpy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        _check_current_folder()
        _check_address_space()
        with lock.command(), _unwrapped():
            code = program(prog_name=name, standalone_mode=False)
        sys.stdout.flush()
    except Ended as ended:
        _say(name, f"ended by {signal.Signals(ended.number).name}")
        raise
    except KeyboardInterrupt:  # outside of typer, which catches it within
        code = INTERRUPTED
    except BrokenPipeError:
        lead_nowhere(sys.stdout)
        sys.exit(1)
    except Exception as error:
        line = refusal(error)
        if line is None:
            raise
        if isinstance(error, OSError) and error.filename is None:
            lead_nowhere(sys.stdout)
        _refuse(name, line)
    if code == INTERRUPTED:
        _say(name, "interrupted")
    if code:
        sys.exit(code)


def _open_streams() -> None:
    """Let closed streams lead nowhere, and print any name on streams that have not all letters."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # else the next file that is opened would take its number
    os.close(descriptor)
    sys.stdout = sys.stdout or open(1, "w", closefd=False)
    sys.stderr = sys.stderr or open(2, "w", closefd=False)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _end_by_signals() -> None:
    """Let signals that end a program end it as Ctrl-C does: what is half-written goes.

    They are sent again a little later where what they raise would be lost: while trimesh runs,
    which catches whatever is raised where it loads others, and in finalizers (`__del__`, callbacks
    of weak references), where Python only prints it.
    """
    print_unraisable = sys.unraisablehook

    def send_later(number: int) -> None:
        threading.Timer(NAP_S, _send, [number]).start()

    def unraisable(lost: sys.UnraisableHookArgs) -> None:
        if isinstance(lost.exc_value, Ended):
            send_later(lost.exc_value.number)
        elif isinstance(lost.exc_value, KeyboardInterrupt):
            send_later(signal.SIGINT)
        else:
            print_unraisable(lost)

    def end(number: int, frame: FrameType | None) -> None:
        if _is_within(CATCHES_ALL, frame):
            send_later(number)
        elif number == signal.SIGINT:
            raise KeyboardInterrupt
        else:
            raise Ended(number)

    sys.unraisablehook = unraisable
    for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
        with contextlib.suppress(ValueError):  # not in the main thread
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                signal.signal(number, end)  # under `nohup` SIGHUP stays ignored


def _send(number: int) -> None:
    """Send a signal to the main thread, which it wakes up where the system can do that."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        signal.raise_signal(number)


def _is_within(package: str, frame: FrameType | None) -> bool:
    """Return whether a package's code is what runs, or has called it."""
    while frame is not None and str(frame.f_globals.get("__name__")).split(".")[0] != package:
        frame = frame.f_back
    return frame is not None


@contextlib.contextmanager
def _unwrapped() -> Iterator[None]:
    """Raise what a signal raised where an import wraps it: of C++, in Python 3.11 of a class."""
    try:
        yield
    except Exception as error:
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, Ended | KeyboardInterrupt):
            cause = cause.__cause__
        if cause is None:
            raise
        raise cause from None


def _check_current_folder() -> None:
    try:
        os.getcwd()
    except FileNotFoundError as error:
        raise ToonsetError("the current folder has been deleted; change to another one") from error


def _check_address_space() -> None:
    """Refuse what OpenBLAS ends the process under, or waits for ever, before anything is said."""
    try:
        import resource
    except ImportError:  # Windows
        return
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if 0 <= most < LEAST_SPACE:
        raise ToonsetError(f"{most // 10**6} MB of address space are too few; {MORE_SPACE}")


def _refuse(name: str, text: str) -> NoReturn:
    _say(name, text)
    sys.exit(REFUSED)


def _say(name: str, text: str) -> None:
    over_progress = "\r\x1b[K" if sys.stderr.isatty() else ""
    say(f"{over_progress}{name}: {text}\n")
