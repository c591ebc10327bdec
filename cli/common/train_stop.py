"""Ctrl-C while a field is fitted: the step is finished and what there is can be saved.

Before the first step there is nothing to save, so the signal ends the program as everywhere else; a
second one ends it at any time.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from types import FrameType

from toonset.cli.common.output import Printer

SIGNALS = (signal.SIGINT, signal.SIGTERM)
EXIT_CODE = 128  # plus the signal's number, as shells have it


class Stopper:
    """Whether somebody wants the training to end.

    Attributes:
        signal: that said so, 0 while none has.
    """

    def __init__(self, printer: Printer) -> None:
        """Say through `printer` that a wish was heard."""
        self.signal = 0
        self._printer, self._running = printer, False

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
        kept = {}
        with contextlib.suppress(ValueError):  # not in the main thread: nothing to listen to
            for number in SIGNALS:
                if signal.getsignal(number) is not signal.SIG_IGN:  # a background job's
                    kept[number] = signal.signal(number, self._hear)
        try:
            yield
        finally:
            for number, handler in kept.items():
                signal.signal(number, handler)

    def _hear(self, number: int, _: FrameType | None) -> None:
        if self.signal or not self._running:
            raise KeyboardInterrupt
        self.signal = number
        self._printer.say("stopping after this step; once more to leave at once")
