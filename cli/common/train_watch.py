"""Print a training's progress; on Ctrl-C finish the step and write the run.

Before the first step there is nothing to write, so the signal ends the program as everywhere else;
a second one ends it at any time.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import FrameType
from typing import TYPE_CHECKING, Any

from toonset.cli.common.output import Printer

if TYPE_CHECKING:
    from toonset.nerf.train.progress import Status


SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
EXIT_CODE = 128  # plus the signal's number, as shells have it
LIVE_S = 0.1  # between changes of the live line
LOG_S = 10.0  # between lines of a log at most
LOG_SHARE, LOG_LEAST_S = 0.1, 2.0  # and after a tenth of the training, if that takes a while


class Stopper:
    """Whether somebody wants the training to end.

    Attributes:
        signal: that said so, 0 while none has.
    """

    def __init__(self, printer: Printer) -> None:
        """Say through `printer` that a wish was heard."""
        self.signal = 0
        self._printer, self._running = printer, False
        self._kept: dict[int, Any] = {}  # handlers of before

    @property
    def exit_code(self) -> int:
        """Return the program's exit code."""
        return EXIT_CODE + self.signal

    def __call__(self) -> bool:
        """Return whether to stop; whoever asks is running, and will ask again."""
        self._running = True
        return self.signal != 0

    @contextlib.contextmanager
    def listening(self) -> Iterator[None]:
        """Listen within the block."""
        kept = self._kept
        with contextlib.suppress(ValueError):  # not in the main thread: nothing to listen to
            for number in SIGNALS:
                if signal.getsignal(number) is not signal.SIG_IGN:  # a background job's
                    kept[number] = signal.signal(number, self._hear)
        try:
            yield
        finally:
            for number, handler in kept.items():
                signal.signal(number, handler)

    def _hear(self, number: int, frame: FrameType | None) -> None:
        if self.signal or not self._running:
            before = self._kept[number]
            if not callable(before):
                raise KeyboardInterrupt
            before(number, frame)  # ends the program
        self.signal = number
        self._printer.say(
            "stopping after this step, to write the run as it stands; once more to leave at once"
        )


@dataclass
class RateLimit:
    """When a line is due.

    Attributes:
        live: on a terminal, where a line replaces the last.
        clock: seconds.
    """

    live: bool
    clock: Callable[[], float] = time.monotonic
    _said: tuple[float, float] | None = None

    def due(self, share: float) -> bool:
        """Return whether to say something now that `share` of the training is over."""
        now = self.clock()
        if self._said is not None:
            waited, gained = now - self._said[0], share - self._said[1]
            often = waited >= LOG_LEAST_S and gained >= LOG_SHARE
            if waited < (LIVE_S if self.live else LOG_S) and (self.live or not often):
                return False
        self._said = now, share
        return True


class TrainPrinter:
    """Says where a training stands."""

    def __init__(self, printer: Printer) -> None:
        """Speak through the command's printer."""
        self._printer, self._pace = printer, RateLimit(sys.stderr.isatty())

    def tell(self, status: Status) -> None:
        """Say where a training stands, if that is due."""
        from toonset.nerf.train.progress import line_of

        if not self._pace.due(status.steps / status.of):
            return
        if self._pace.live:
            self._printer.progress(line_of(status))
        else:
            self._printer.say(line_of(status))
