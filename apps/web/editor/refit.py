"""Rebuild a bundle from its sheet and corrections, as the command line would."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from hashlib import sha256
from pathlib import Path
from typing import Any

import toonset as ts
from toonset.calib.without_body.cues import Cues
from toonset.dataset.bundle_files import CALIBRATION, WRITTEN
from toonset.dataset.label_drawings import label_bundle
from toonset.dataset.split_folder.corrected import Given
from toonset.dataset.split_folder.load import Sheet
from toonset.json_file import read_json
from toonset.lock import FOLDERS, hold, set_of
from toonset.view import SHEET, InputFile, Origin
from toonset.write import exchange_folders, write_bytes, write_json

CORRECTIONS = "corrections.json"
NOTHING: dict[str, Any] = {"version": 1}
BY_HAND = "corrections"  # the file's role among a bundle's inputs
RUN = "run"  # a trained field: it stays, whatever becomes of the cameras
CUT, CAMERAS, PALETTE = ("background", "boxes", "group", "outfit"), "views", "palette"


@dataclass(frozen=True, eq=False)
class Subject:
    """A bundle to be corrected.

    Attributes:
        sheet: the picture.
        body: the mannequin, as `calibrate` takes it.
        folder: the bundle.
    """

    sheet: Path
    body: ts.Mesh | ts.Body
    folder: Path

    @property
    def workshop(self) -> Path:
        """Return where the next bundle is made, beside this one: a later start clears it up."""
        return self.folder.parent / f".{self.folder.name}.edit"


@dataclass(frozen=True)
class Changed:
    """Parts of a bundle to be computed again.

    Attributes:
        cut: the drawings, and all that follows.
        cameras: of the same drawings.
        palette: of the drawings.
    """

    cut: bool
    cameras: bool
    palette: bool


@dataclass(frozen=True, eq=False)
class DrawnSheet:
    """A sheet's drawings, and what was found in them: both stay until they are cut anew.

    Attributes:
        sheet: the drawings as they were cut.
        cues: what they show, whatever a person calls them.
    """

    sheet: Sheet
    cues: Cues

    @classmethod
    def of(cls, sheet: Sheet) -> DrawnSheet:
        """Return drawings that nobody has looked at yet."""
        return cls(sheet, Cues(sheet.views))


def parts_changed(before: dict[str, Any], after: dict[str, Any]) -> Changed:
    """Return what corrections change that others did not."""

    def cut(said: dict[str, Any]) -> list[Any]:
        left = [view["box"] for view in said.get(CAMERAS, ()) if view.get("exclude")]
        return [*(said.get(key) for key in CUT), left]

    is_cut = cut(before) != cut(after)
    seen = is_cut or before.get(CAMERAS) != after.get(CAMERAS)
    return Changed(is_cut, seen, is_cut or before.get(PALETTE) != after.get(PALETTE))


def file_of(corrections: dict[str, Any]) -> bytes:
    """Return corrections.json."""
    return (json.dumps(corrections, indent=1) + "\n").encode()


def cut_sheet(
    sheet: Path, corrections: dict[str, Any], workshop: Path
) -> tuple[Sheet, Path | None]:
    """Return the corrected drawings and their corrections file; None without corrections."""
    if corrections == NOTHING:
        return ts.split_sheet(sheet), None
    file = workshop / CORRECTIONS
    write_bytes(file, file_of(corrections))
    return ts.split_sheet(sheet, corrections=file), file


def _labelled(sheet: Sheet, file: Path) -> tuple[ts.View, ...]:
    """Return drawings as they are cut, labelled as a file of corrections says."""
    files = (*(one for one in sheet.files if one.role != BY_HAND), InputFile.of(BY_HAND, file))
    origin = Origin(files, sheet.options)
    return tuple(
        replace(view, label="" if said is None else said.label, origin=origin)
        for view, said in zip(sheet.views, Given.of(file).of_views(sheet.views), strict=True)
    )


def make_bundle(
    subject: Subject,
    corrections: dict[str, Any],
    changed: Changed,
    before: DrawnSheet | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> tuple[DrawnSheet, Path]:
    """Return the drawings, and a new bundle of them in the workshop.

    What is not made again goes along: corrections and page, and the palette of drawings that are
    still the same.

    Args:
        subject: what is corrected.
        corrections: what a person said.
        changed: what that changes.
        before: the drawings, where they are cut already; None: cut them.
        progress: told which step is how far.

    Raises:
        ToonsetError: the corrections do not fit the sheet, or nothing can be found in it.
    """
    new, old = subject.workshop / subject.folder.name, subject.folder
    clear_workshop(subject)
    if before is None or before.sheet.options or changed.cut:
        sheet, file = cut_sheet(subject.sheet, corrections, subject.workshop)
        drawn = DrawnSheet.of(sheet)
    else:
        file = subject.workshop / CORRECTIONS
        write_bytes(file, file_of(corrections))
        drawn = before
    views = drawn.sheet.views if file is None else _labelled(drawn.sheet, file)
    hints = ts.Hints(corrections=file)
    found = ts.calibrate(views, subject.body, hints, progress=progress, cues=drawn.cues)
    ts.write_bundle(new, found)
    if old.is_dir():
        _take_along(old, new)
    if changed.palette:
        find_palette(new, corrections)
    return drawn, new


def put_in_place(new: Path, subject: Subject, corrections: dict[str, Any]) -> None:
    """Let a new bundle take the old one's place, with the newest corrections.

    Raises:
        OutputError: a palette or a run is being written into the old one.
    """
    folder = subject.folder
    write_bytes(new / CORRECTIONS, file_of(corrections))
    with hold(folder / RUN), hold(set_of(folder / PALETTE)):
        exchange_folders(new, folder)
        clear_workshop(subject)


def clear_workshop(subject: Subject) -> None:
    """Take the workshop away, but for what an old bundle holds of others: it goes into the new one.

    Once more at every start: a process that is killed between the two leaves it there.
    """
    old, new = subject.workshop / subject.folder.name, subject.folder
    if (old / CALIBRATION).is_file() and (new / CALIBRATION).is_file():
        for entry in old.iterdir():
            own = any(fnmatchcase(entry.name, one) for one in WRITTEN if one != RUN)
            if not own and not entry.name.startswith(".") and not os.path.lexists(new / entry.name):
                os.replace(entry, new / entry.name)
    shutil.rmtree(subject.workshop, ignore_errors=True)


def find_palette(folder: Path, corrections: dict[str, Any]) -> None:
    """Find the palette of a bundle's drawings, as corrected, and write it with its maps.

    Raises:
        ToonsetError: the corrections speak of colours that the drawings do not have.
    """
    label_bundle(folder, Given.parsed(file_of(corrections), CORRECTIONS))


def note_corrections(folder: Path, corrections: dict[str, Any]) -> None:
    """Record corrections in a bundle whose cameras they leave as they are.

    Its calibration.json is then what `calibrate --corrections` writes.
    """
    content = read_json(folder / CALIBRATION)
    others = [one for one in content["inputs"] if one["role"] != BY_HAND]
    after = 1 + max(i for i, one in enumerate(others) if one["role"] == SHEET)
    digest = sha256(file_of(corrections)).hexdigest()
    record = {"name": CORRECTIONS, "sha256": digest, "role": BY_HAND}
    content["inputs"] = [*others[:after], record, *others[after:]]
    write_json(folder / CALIBRATION, content)


def _take_along(old: Path, new: Path) -> None:
    for entry in old.iterdir():
        target = new / entry.name
        if entry.name == CALIBRATION or target.exists():
            continue
        if entry.is_dir() and entry.name in FOLDERS:
            shutil.copytree(entry, target)
        elif entry.is_file() and not entry.name.startswith("."):
            shutil.copy2(entry, target)
