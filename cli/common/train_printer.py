"""What `toonset train` says while it works: a live line, or now and then a line in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toonset.cli.common.output import Printer

if TYPE_CHECKING:
    from toonset.nerf.train.progress import Status

LIVE_S = 0.1  # between changes of the live line
LOG_S = 10.0  # between lines of a log at most
LOG_SHARE, LOG_LEAST_S = 0.1, 2.0  # and after a tenth of the training, if that takes a while


@dataclass
class Pace:
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


class Voice:
    """Says where a training stands."""

    def __init__(self, printer: Printer) -> None:
        """Speak through the command's printer."""
        self._printer, self._pace = printer, Pace(sys.stderr.isatty())

    def tell(self, status: Status) -> None:
        """Say where a training stands, if that is due."""
        from toonset.nerf.train.progress import line_of

        if not self._pace.due(status.steps / status.of):
            return
        if self._pace.live:
            self._printer.progress(line_of(status))
        else:
            self._printer.say(line_of(status))
