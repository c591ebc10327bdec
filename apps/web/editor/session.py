"""Keep a person's corrections of a bundle on disk, and refit the bundle in a thread.

Whatever comes in is on disk, in corrections.json, before it is answered. Fitting follows in a
thread of its own: always with the newest corrections, so what comes in meanwhile replaces what
waits. A bundle takes the place of the one before in one step; what is killed on the way leaves the
older one, and the next start fits what the newest corrections say.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import toonset as ts
from toonset.apps.web.editor.refit import (
    CORRECTIONS,
    Changed,
    DrawnSheet,
    Subject,
    file_of,
    find_palette,
    make_bundle,
    note_corrections,
    parts_changed,
    put_in_place,
)
from toonset.apps.web.editor.scene import page_of, scene_of, seen_on, sheet_url
from toonset.dataset.split_folder.corrected import Given
from toonset.errors import SheetError, ToonsetError, one_line
from toonset.write import write_bytes

PAGE = "edit.html"


class StaleError(Exception):
    """Corrections that follow on older ones than there are: another tab was faster."""


class StoppedError(Exception):
    """The session ends while it fits."""


@dataclass
class Session:
    """A bundle, its corrections, and the thread that fits it.

    Attributes:
        subject: what is corrected.
        drawn: its drawings, as the bundle has them.
        fitted: corrections that the bundle follows.
        corrections: the newest, as they are on disk.
        tell: told how far a fit is.
        revision: how many corrections came before, since the start.
        number: grows with everything that a page should know of.
        scene: what the page shows of the bundle.
        scene_number: `number` when it became so.
        error: why the newest corrections could not be fitted; empty if they could.
        seconds: that the last fit took.
        acted: when a person last did something.
        stopped: it has ended, or is about to.
    """

    subject: Subject
    drawn: DrawnSheet
    fitted: dict[str, Any]
    corrections: dict[str, Any]
    tell: Callable[[str], None] = lambda text: None
    revision: int = 0
    number: int = 0
    scene: dict[str, Any] = field(default_factory=dict)
    scene_number: int = 0
    error: str = ""
    seconds: float = 0.0
    acted: float = field(default_factory=time.monotonic)
    stopped: bool = False
    picture: str = field(init=False)
    _tried: dict[str, Any] = field(init=False)
    _seen: dict[str, Any] = field(default_factory=dict)  # on the sheet, as cut without boxes
    _busy: bool = False
    _thread: threading.Thread = field(init=False)
    _news: threading.Condition = field(default_factory=threading.Condition)

    def __post_init__(self) -> None:
        """Show the bundle, and fit it where its corrections are newer."""
        self.picture = sheet_url(self.subject.sheet, self.drawn.sheet)
        self._tried = self.fitted
        self._show()
        self._thread = threading.Thread(target=self._work, name="fit")
        self._thread.start()

    def stop(self) -> None:
        """End; what is being fitted is given up, its corrections are on disk."""
        with self._news:
            self.stopped = True
            self._news.notify_all()
        self._thread.join()

    def save(self, corrections: Any, revision: int) -> int:
        """Keep corrections on disk, have them fitted; return their revision.

        Raises:
            StaleError: they follow on other than the newest ones.
            ToonsetError: they are invalid, the disk is full, or somebody else has written the file.
        """
        data = file_of(corrections)
        Given.parsed(data, CORRECTIONS)
        with self._news:
            if revision != self.revision:
                raise StaleError
            self._check_file()
            write_bytes(self.subject.folder / CORRECTIONS, data)
            self.corrections = corrections
            self.revision += 1
            self.acted = time.monotonic()
            self._tell_all()
            return self.revision

    def _check_file(self) -> None:
        """Refuse to write over what was written into corrections.json by hand meanwhile."""
        file = self.subject.folder / CORRECTIONS
        if not file.exists():
            return
        try:
            same = json.loads(file.read_bytes()) == self.corrections
        except ValueError:
            same = False
        if not same:
            raise SheetError(
                f"{CORRECTIONS} was changed by another program; stop `toonset edit` and start it "
                "again: it reads the file anew"
            )

    def state(self, after: int = -1, scene: int = -1, wait_s: float = 0.0) -> dict[str, Any]:
        """Return what a page should know; wait until there is something newer than `after`.

        Args:
            after: `number` of what it knows.
            scene: the same of its scene, which comes along if it is older.
            wait_s: how long to wait at most.
        """
        with self._news:
            self._news.wait_for(lambda: self.number > after or self.stopped, wait_s)
            known = {
                "number": self.number,
                "revision": self.revision,
                "corrections": self.corrections,
                "busy": self._busy or self._waits(),
                "error": self.error,
                "seconds": round(self.seconds, 2),
                "sceneNumber": self.scene_number,
            }
            return known | ({"scene": self.scene} if self.scene_number > scene else {})

    def _tell_all(self) -> None:
        self.number += 1
        self._news.notify_all()

    def _waits(self) -> bool:
        return self.corrections != self._tried

    def _show(self) -> None:
        """Make the page's scene, and the page as a file of its own."""
        scene = scene_of(self.subject.folder, self.drawn.sheet)
        if not self.fitted.get("boxes"):
            self._seen = seen_on(self.drawn.sheet)
        elif not self._seen:  # who draws boxes wants to see what else there is
            self._seen = seen_on(ts.split_sheet(self.subject.sheet))
        taken = {"group": self.fitted.get("group", 1), "outfit": self.fitted.get("outfit", "")}
        scene |= self._seen | taken
        with self._news:
            self.scene = scene
            self._tell_all()
            self.scene_number = self.number
        shown = scene | {"sheet": scene["sheet"] | {"picture": self.picture}}
        page = page_of(shown, self.fitted, scene["title"])
        write_bytes(self.subject.folder / PAGE, page.encode("utf-8"))

    def _work(self) -> None:
        while True:
            with self._news:
                self._busy = False
                self._news.wait_for(lambda: self._waits() or self.stopped)
                if self.stopped:
                    return
                self._busy = True
                self._tried = self.corrections
            began = time.monotonic()
            error = self._refit()
            with self._news:
                self.error, self.seconds = error, time.monotonic() - began
                self._busy = False
                self._tell_all()

    def _refit(self) -> str:
        """Fit the newest corrections; return why they cannot be fitted, empty if they can."""
        try:
            self._fit(parts_changed(self.fitted, self._tried))
        except StoppedError:
            pass
        except ToonsetError as error:
            return one_line(error)
        except Exception as error:  # our bug: what was done is kept, and can be undone
            return one_line(f"{type(error).__name__}: {error}")
        return ""

    def _fit(self, changed: Changed) -> None:
        wanted, folder = self._tried, self.subject.folder
        if changed.cameras:
            drawn, new = make_bundle(self.subject, wanted, changed, self.drawn, self._progress)
            with self._news:
                put_in_place(new, self.subject, self.corrections)
                self.drawn = drawn
        else:
            if changed.palette:
                find_palette(folder, wanted)
            note_corrections(folder, wanted)
        self.fitted = wanted
        if changed.cameras or changed.palette:
            self._show()

    def _progress(self, step: str, share: float) -> None:
        if self.stopped:
            raise StoppedError
        self.tell(f"{step} {share:.0%}" if share else step)
