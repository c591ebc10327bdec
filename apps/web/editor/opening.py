"""Open a session on the sheet or bundle that a person names."""

from __future__ import annotations

import os
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import toonset as ts
from toonset.apps.web.editor.refit import (
    BY_HAND,
    CORRECTIONS,
    NOTHING,
    Changed,
    DrawnSheet,
    Subject,
    clear_workshop,
    cut_sheet,
    find_palette,
    make_bundle,
    put_in_place,
)
from toonset.apps.web.editor.scene import PALETTE
from toonset.apps.web.editor.session import PAGE, Session
from toonset.dataset.bundle_files import (
    CALIBRATION,
    WRITTEN,
    CalibrationFile,
    InputFile,
    calibration_of,
    member,
)
from toonset.dataset.split_folder.corrected import Given
from toonset.dataset.split_folder.load import Sheet
from toonset.errors import BundleError, SheetError, ToonsetError
from toonset.lock import hold
from toonset.mesh import Up
from toonset.palette.names import hex_of
from toonset.read import check_there, parse_json, read_whole
from toonset.view import SHEET
from toonset.write import check_output

ALL = Changed(cut=True, cameras=True, palette=True)
MESH = "mesh"  # role of a bundle's input
BESIDE_MESH = ("points of the mesh", "landmarks", "init")
MANNEQUIN_MADE = "mannequin"  # option: what a body made by code looks like
CUT_BY = (
    "grid",
    "background",
    "drop",
    "group",
    "outfit",
)  # options of `calibrate` that a bundle records

MeshOption = Path | ts.Body | None  # None: what the bundle was made with


def folder_of(place: Path, out: Path) -> Path:
    """Return the bundle that is meant: the place itself, or what a sheet becomes.

    Raises:
        ToonsetError: there is nothing, or several pictures, or it cannot be replaced.
    """
    check_there([place], "sheet or bundle", SheetError)
    folder = place if place.is_dir() else out
    if place.is_dir() and not (place / CALIBRATION).is_file():
        raise BundleError(f"{place}: is no bundle; name one, or the sheet, a single picture")
    if folder.is_symlink():
        raise BundleError(f"{folder}: is a link; name the bundle itself, which is replaced")
    if Path.cwd().is_relative_to(folder.resolve()):
        raise BundleError(f"{folder}: holds the current folder; change to the one it lies in")
    return folder


def open_session(
    place: Path, folder: Path, mesh: MeshOption, tell: Callable[[str], None], up: Up = "y"
) -> Session:
    """Return the session; a sheet, or corrections that no bundle follows yet, are fitted first.

    Raises:
        ToonsetError: the bundle's sheet is not to be found, or the sheet cannot be calibrated.
    """

    def progress(step: str, share: float) -> None:
        tell(f"{step} {share:.0%}" if share else step)

    if not (folder / CALIBRATION).is_file():
        check_output(folder, [place], WRITTEN, force=False)
        subject = Subject(place, _given(mesh, up, tell) or ts.Body.DEFAULT, folder)
        drawn, new = make_bundle(subject, NOTHING, ALL, None, progress)
        folder.parent.mkdir(parents=True, exist_ok=True)
        if folder.is_dir():
            folder.rmdir()  # it is empty
        os.replace(new, folder)
        clear_workshop(subject)
        return Session(subject, drawn, NOTHING, NOTHING, tell)
    found = calibration_of(folder)
    subject = _subject(place, folder, found, _given(mesh, up, tell))
    clear_workshop(subject)
    for name in (CORRECTIONS, CALIBRATION, PAGE):
        with hold(folder / name):  # what a write left that was killed goes
            pass
    try:
        return _reopen(subject, found, place, tell, progress)
    finally:
        clear_workshop(subject)


def _reopen(
    subject: Subject,
    found: CalibrationFile,
    place: Path,
    tell: Callable[[str], None],
    progress: Callable[[str, float], None],
) -> Session:
    """Return the session of a bundle, fitted anew where corrections ask for it."""
    data = _corrections_file(subject.folder, found, place)
    if data is None and _has_body(found, subject):
        sheet, corrections = _as_it_was_cut(subject, found)
        return _session(subject, sheet, corrections, tell)
    corrections = NOTHING if data is None else parse_json(data, CORRECTIONS, SheetError)
    if data is not None and _recorded(found, BY_HAND, data) and _has_body(found, subject):
        sheet, _ = cut_sheet(subject.sheet, corrections, subject.workshop)
        return _session(subject, sheet, corrections, tell)
    fitted = corrections
    try:
        drawn, new = make_bundle(subject, fitted, ALL, None, progress)
    except ToonsetError:
        if corrections == NOTHING:
            raise
        fitted = NOTHING  # the page says what is wrong with them
        drawn, new = make_bundle(subject, fitted, ALL, None, progress)
    put_in_place(new, subject, corrections)
    return Session(subject, drawn, fitted, corrections, tell)


def _session(
    subject: Subject, sheet: Sheet, corrections: dict[str, Any], tell: Callable[[str], None]
) -> Session:
    """Return the session of a bundle that follows its corrections; its palette is found now."""
    if not (subject.folder / PALETTE).is_file():
        find_palette(subject.folder, corrections)
    return Session(subject, DrawnSheet.of(sheet), corrections, corrections, tell)


def _given(mesh: MeshOption, up: Up, tell: Callable[[str], None]) -> ts.Mesh | ts.Body | None:
    """Return the body that is asked for, and tell what was done to it."""
    if not isinstance(mesh, Path):
        return mesh
    body = ts.load_mesh(mesh, up=up)
    for remark in body.remarks:
        tell(remark)
    return body


def _subject(
    place: Path, folder: Path, found: CalibrationFile, given: ts.Mesh | ts.Body | None
) -> Subject:
    """Return what a bundle was made of, or is to be made with another body."""
    sheets = [one for one in found.inputs if one.role not in (MESH, BY_HAND, *BESIDE_MESH)]
    if len(sheets) != 1 or sheets[0].role != SHEET:
        raise BundleError(
            f"{folder}: was made of {len(sheets)} files; name the one sheet, with another -o"
        )
    sheet = _found(sheets[0], folder, place)
    if sheet is None:
        raise BundleError(
            f"{folder}: was made of {sheets[0].name}, which is not beside it; run `toonset edit "
            f"{sheets[0].name} -o {folder}` with that file's place"
        )
    if given is not None:
        return Subject(sheet, given, folder)
    record = next((one for one in found.inputs if one.role == MESH), None)
    if record is None:
        return Subject(
            sheet, ts.Body.DEFAULT if MANNEQUIN_MADE in found.options else ts.Body.NONE, folder
        )
    file = _found(record, folder, place)
    if file is None:
        raise BundleError(
            f"{folder}: was made with {record.name}, which is not beside it; give it: --mesh FILE"
        )
    return Subject(sheet, ts.load_mesh(file, up=_up(found)), folder)


def _found(record: InputFile, folder: Path, place: Path) -> Path | None:
    """Return a file that a bundle was made of: the one named, or one near it with its content."""
    if record.role == SHEET and place.is_file():
        if _sha256(place) != record.sha256:
            raise BundleError(
                f"{folder}: was made of another sheet, {record.name}; choose another -o"
            )
        return place
    near = dict.fromkeys([folder.resolve().parent, Path.cwd(), place.resolve().parent])
    for here in (*near, *(child for one in near for child in sorted(one.glob("*/")))):
        file = here / record.name
        if file.is_file() and _sha256(file) == record.sha256:
            return file
    return None


def _has_body(found: CalibrationFile, subject: Subject) -> bool:
    """Return whether a bundle was made with this body."""
    record = next((one for one in found.inputs if one.role == MESH), None)
    if isinstance(subject.body, ts.Mesh):
        same = record is not None and record.sha256 == subject.body.sha256
        return same and subject.body.up == _up(found)
    made = MANNEQUIN_MADE in found.options
    return record is None and (subject.body is ts.Body.DEFAULT or not made)


def _up(found: CalibrationFile) -> Up:
    return "z" if found.options.get("up") == "z" else "y"


def _recorded(found: CalibrationFile, role: str, data: bytes) -> bool:
    digest = sha256(data).hexdigest()
    return any(one.role == role and one.sha256 == digest for one in found.inputs)


def _corrections_file(folder: Path, found: CalibrationFile, place: Path) -> bytes | None:
    """Return the bundle's corrections, else those that `calibrate --corrections` was given."""
    file = member(folder, CORRECTIONS)
    if file is None:
        record = next((one for one in found.inputs if one.role == BY_HAND), None)
        if record is None:
            return None
        given = _found(record, folder, place)
        if given is None:
            raise BundleError(
                f"{folder}: was made with {record.name}, which is not beside it; put it there"
            )
        file = given
    data = read_whole(file, "corrections", SheetError)
    Given.parsed(data, str(file))
    return data


def _as_it_was_cut(subject: Subject, found: CalibrationFile) -> tuple[Sheet, dict[str, Any]]:
    """Return the drawings of a bundle without corrections, and its options as corrections."""
    options = {name: found.options[name] for name in CUT_BY if found.options.get(name)}
    sheet = ts.split_sheet(subject.sheet, ts.SheetOptions(**options))
    if len(sheet.views) != len(found.views) or found.options.get("boxes"):
        raise BundleError(
            f"{subject.folder}: its sheet was cut by a file of boxes; run `toonset edit "
            f"{subject.sheet}` with another -o, and draw them"
        )
    words = (found.options.get("views") or "").split(",")
    labels = [word.strip() for word in words] if any(words) else []
    corrections = dict(NOTHING)
    boxes = [list(view.figure_box) for view in sheet.views]
    if "background" in options:
        corrections["background"] = hex_of(sheet.split.sources[0].background or (255, 255, 255))
    if options.keys() & {"grid", "drop"}:
        corrections["boxes"] = boxes
    else:
        corrections |= {key: options[key] for key in ("group", "outfit") if key in options}
    said = [
        {"box": box, "label": label}
        for box, label in zip(boxes, labels, strict=False)
        if label and label != "?"
    ]
    return sheet, corrections | ({"views": said} if said else {})


def _sha256(path: Path) -> str:
    return sha256(path.read_bytes()).hexdigest()
