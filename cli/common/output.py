"""Print results to stdout, progress and reasons to stderr."""

from __future__ import annotations

import json
import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TextIO

import typer

from toonset.errors import printable
from toonset.options import Option, described

OUTPUT_PANEL = "Output"  # of the help
SeedOption = Annotated[
    int, typer.Option("--seed", help="Seed of everything random.", min=0, max=2**63 - 1)
]
UpOption = Annotated[
    Literal["y", "z"],
    typer.Option("--up", help="z: the mesh has +Z up, front -Y, as Blender and slicers have it."),
]
ForceFlag = Annotated[
    bool, typer.Option("--force", help="Replace an existing output.", rich_help_panel=OUTPUT_PANEL)
]

SECONDS_BETWEEN_LOG_LINES = 5.0
ERASE_LINE = "\r\x1b[K"


@described
@dataclass
class Printer:
    """Printer of a command: `say` for people, `doubt` why exit 3, `result` once at the end."""

    as_json: Annotated[
        bool, Option("Print one JSON object on stdout.", flag="--json", panel=OUTPUT_PANEL)
    ] = False
    quiet: Annotated[
        bool, Option("Print results and reasons only.", flag="--quiet -q", panel=OUTPUT_PANEL)
    ] = False
    verbose: bool = False
    subject: str = ""  # begins every line for people
    _last: float = field(default=0.0)

    def say(self, text: str) -> None:
        """Print a line for people on stderr, unless quiet."""
        if not self.quiet:
            self.doubt(text)

    def detail(self, text: str) -> None:
        """Print evidence on stderr, if it is asked for."""
        if self.verbose:
            self.say(text)

    def doubt(self, text: str) -> None:
        """Print on stderr what to look at, quiet or not: why the exit code is 3, or a run weak."""
        self._clear()
        say(f"{_shown(self.subject + text)}\n")

    def progress(self, text: str) -> None:
        """Show where the work stands: one live line on a terminal, a line every 5 s in a log."""
        if self.quiet:
            return
        text = self.subject + text
        if sys.stderr.isatty():
            self._clear()
            say(_shown(text))
        elif time.monotonic() - self._last > SECONDS_BETWEEN_LOG_LINES:
            say(f"{_shown(text)}\n")
            self._last = time.monotonic()

    def result(self, values: dict[str, Any], text: str) -> None:
        """Print the result: `values` as JSON with --json, else `text`."""
        self._clear()
        if self.as_json:
            print(as_json(values))
        elif text:
            print(_shown(text))

    def _clear(self) -> None:
        if not self.quiet and sys.stderr.isatty():
            say(ERASE_LINE)


@described
@dataclass
class DetailPrinter(Printer):
    """Printer of a command that has evidence to show."""

    verbose: Annotated[
        bool, Option("Print the evidence, too.", flag="--verbose -v", panel=OUTPUT_PANEL)
    ] = False


@dataclass
class Keeper(DetailPrinter):
    """Printer that keeps the result for its caller, as JSON has it."""

    kept: dict[str, Any] = field(default_factory=dict)

    def result(self, values: dict[str, Any], text: str) -> None:
        """Keep the result."""
        self.kept = json.loads(as_json(values))


def as_json(values: dict[str, Any]) -> str:
    """Return a result in one line, as `--json` prints it."""
    return json.dumps(values, default=_plain)


def lead_nowhere(stream: TextIO) -> None:
    """Let what is printed, and what could not be printed yet, go nowhere: its end would fail."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def say(text: str) -> None:
    """Print to stderr, if it can be; the work goes on without a log on a full disk."""
    try:
        print(text, end="", file=sys.stderr, flush=True)
    except OSError:
        lead_nowhere(sys.stderr)


def _shown(text: str) -> str:
    """Return lines that a terminal shows as they are: they may hold names of files."""
    return "\n".join(map(printable, text.split("\n")))


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")
