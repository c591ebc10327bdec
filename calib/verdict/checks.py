"""Check a sheet's views against each other: each check proposes doubts, or nothing.

`./run bench calib` runs the sheets with each of them left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from toonset.calib.evidence.coherence_state import SheetState
from toonset.calib.result import SEVERITY, ViewCalibration
from toonset.calib.verdict.judge import outlines_apart
from toonset.calib.verdict.one_character import other_character
from toonset.calib.verdict.repeated import repeated_drawings
from toonset.calib.verdict.undrawn_parts import undrawn_part
from toonset.dataset.split_folder.view_labels import Label
from toonset.errors import UsageError
from toonset.mesh import Mesh
from toonset.view import View

Views = tuple[ViewCalibration, ...]
ELSEWHERE = np.radians(10.0)  # between cameras that see another side


@dataclass(frozen=True, eq=False)
class JudgedSheet:
    """Views that were judged one by one, and what is known of their sheet.

    Attributes:
        views: with their cameras and verdicts.
        drawings: theirs.
        state: what the drawings say about each other.
        labels: which yaws a person named, per view; () for none.
        off_places: (views,) radians that views are turned off even steps; None where the
            mannequin's outlines are to be believed.
        pulled: (views,) radians that views turn where nothing is locked; None: nothing is.
        faces_contradict: probability that faces are not where the cameras have the front.
        bent: the mannequin was another body, its proportions were fitted.
        mesh: the mannequin as it was fitted; None without a body.
    """

    views: Views
    drawings: Sequence[View]
    state: SheetState
    labels: Sequence[Label] = ()
    off_places: Float[np.ndarray, " views"] | None = None
    pulled: Float[np.ndarray, " views"] | None = None
    faces_contradict: float = 0.0
    bent: bool = False
    mesh: Mesh | None = None


def check_even_steps(sheet: JudgedSheet) -> Views | None:
    """Doubt views far off their place in the even turn: another body's outline can ask for that."""
    if sheet.off_places is None:
        return None
    away = np.degrees(np.abs(sheet.off_places - np.median(sheet.off_places)))
    most = sheet.state.thresholds.far_from_place_deg
    reason = "turned {:.0f} degrees off even steps, and the mannequin is another body"
    return _weakened(sheet.views, (reason.format(turn) if turn > most else "" for turn in away))


def check_elevations(sheet: JudgedSheet) -> Views | None:
    """Doubt views that look down far more or less than the sheet does, and sheets that look up.

    It may be drawn so; more often it is a mirrored drawing that fits in its twin: the mirror image
    of a sheet from above is, front and back swapped, one from below.
    """
    limits = sheet.state.thresholds
    elevations = np.degrees([view.camera.angles[1] for view in sheet.views])
    level = float(np.median(elevations))
    if level < -limits.looking_up_deg:
        reason = f"the sheet looks up by {-level:.0f} degrees: is it mirrored, or front and back "
        return _weakened(sheet.views, [f"{reason}swapped?"] * len(sheet.views))
    reason = f"the sheet looks down by {abs(level):.0f} degrees: mirrored?"
    far = np.abs(elevations - level) > limits.far_from_level_deg
    return _weakened(sheet.views, (reason if doubt else "" for doubt in far))


def check_parts(sheet: JudgedSheet) -> Views | None:
    """Doubt all views where a part of the mannequin is in no drawing: cameras bend to hide it."""
    if sheet.mesh is None:
        return None
    part = undrawn_part(sheet.mesh, [view.camera for view in sheet.views], sheet.drawings)
    reason = f"no drawing shows the mannequin's {part}: leave it out of the mesh"
    return _weakened(sheet.views, [reason] * len(sheet.views)) if part else None


def check_labels(sheet: JudgedSheet) -> Views | None:
    """Doubt views that ended far from what their label says."""
    most = np.radians(sheet.state.thresholds.far_from_label_deg)
    which = "degrees from its label: which of them is right?"
    off = off_labels(sheet.views, sheet.labels)
    return _weakened(
        sheet.views, (f"{np.degrees(own):.0f} {which}" if own > most else "" for own in off)
    )


def off_labels(views: Views, labels: Sequence[Label]) -> Float[np.ndarray, " views"]:
    """Return by how much views are turned off the nearest yaw of their label, radians; else 0."""
    labels = labels or ((),) * len(views)
    return np.array(
        [
            min((_turn(view.camera.angles[0], yaw) for yaw in label), default=0.0)
            for view, label in zip(views, labels, strict=True)
        ]
    )


def check_locks(sheet: JudgedSheet) -> Views | None:
    """Doubt views that their outlines would turn far from what is locked.

    A wrong lock can hide in another number (elevation in scale) and its sigma is zero, so that the
    outlines alone look well met. Where most views are pulled, all are.
    """
    if sheet.pulled is None:
        return None
    pulled, most = np.degrees(sheet.pulled), sheet.state.thresholds.most_pull_deg
    least = most if np.median(pulled) < most else 0.0
    reason = "without the lock the outlines turn this view by {:.0f} degrees: is what is locked "
    return _weakened(
        sheet.views, (f"{reason.format(turn)}right?" if turn > least else "" for turn in pulled)
    )


def check_sheet(sheet: JudgedSheet) -> Views | None:
    """Doubt all views where the sheet as a whole is doubtful.

    A wrong body can match a side view's outline well, at a wrong angle; a mirrored one matches all
    views, front and back swapped. A failed view has drawn the others along: they were fitted
    together.
    """
    reason = _sheet_doubt(sheet)
    return _weakened(sheet.views, [reason] * len(sheet.views)) if reason else None


def _sheet_doubt(sheet: JudgedSheet) -> str:
    views, state = sheet.views, sheet.state
    limits = state.thresholds
    typical = float(np.median([view.coverage for view in views]))
    doubtful = sum(view.verdict != "ok" for view in views)
    if typical < limits.weak_coverage and not state.drawings_confirm:
        return (
            f"in the sheet's typical view {outlines_apart(typical)}: the mannequin's shape differs "
            f"from the drawings'; {state.unconfirmed}"
        )
    if sheet.bent and not state.drawings_confirm:
        return f"the mannequin is another body, fitted to the drawings; {state.unconfirmed}"
    if any(view.verdict == "failed" for view in views):
        return "a view of this sheet failed, and all were fitted together"
    if 2 * doubtful > len(views):
        return f"{doubtful} of the sheet's {len(views)} views are uncertain"
    if sheet.faces_contradict > limits.most_faces_contradict:
        return (
            f"what looks like faces is not where these cameras have the front (p = "
            f"{sheet.faces_contradict:.2f}): is the sheet, the mannequin or a label the wrong way "
            "round?"
        )
    return ""


def check_repeats(sheet: JudgedSheet) -> Views | None:
    """Fail one drawing that was given cameras on two sides; doubt all views then.

    At least one of these cameras is wrong, and every other's place in the turn may be. Nor is a
    sheet ok whose views are all one drawing: copies confirm nothing.
    """
    yaws = [view.camera.angles[0] for view in sheet.views]
    same = repeated_drawings(sheet.drawings)
    apart = [(i, j) for i, j in same if _turn(yaws[i], yaws[j]) > ELSEWHERE]
    if apart:
        first, second = apart[0]
        reason = f"views {first} and {second} are the same drawing: remove one of them (--drop)"
    elif 0 < len(yaws) - 1 == sum(i == 0 for i, _ in same):
        reason = f"all {len(yaws)} views are the same drawing: nothing confirms its camera"
    else:
        return None
    failed = {i for pair in apart for i in pair}
    return tuple(
        replace(
            view,
            verdict="failed" if i in failed else max("weak", view.verdict, key=SEVERITY.index),
            reason=reason,
        )
        for i, view in enumerate(sheet.views)
    )


def check_one_character(sheet: JudgedSheet) -> Views | None:
    """Doubt all views where the drawings show two characters."""
    others = other_character(sheet.drawings)
    if not others:
        return None
    rest = [i for i in range(len(sheet.drawings)) if i not in others]
    doubt = (
        f"views {_listed(others)} have other colours than views {_listed(rest)}: if they show "
        "another character, calibrate each by itself"
    )
    return tuple(
        replace(view, verdict="weak", reason=doubt)
        if view.verdict == "ok"
        else replace(view, reason=f"{view.reason}; {doubt}")
        for view in sheet.views
    )


OF_DRAWINGS: Mapping[str, Callable[[JudgedSheet], Views | None]] = {
    "repeated drawings": check_repeats,
    "one character": check_one_character,
}
CHECKS: Mapping[str, Callable[[JudgedSheet], Views | None]] = {
    "even steps": check_even_steps,
    "elevations": check_elevations,
    "parts": check_parts,
    "labels": check_labels,
    "locks": check_locks,
    "sheet": check_sheet,
    **OF_DRAWINGS,
}


def check_names(without: Iterable[str]) -> None:
    """Refuse names of checks that do not exist.

    Raises:
        UsageError: there is no such check.
    """
    for name in without:
        if name not in CHECKS:
            known = ", ".join(CHECKS)
            raise UsageError(f"calibrate: there is no check {name!r}; choose from {known}")


def apply_checks(
    sheet: JudgedSheet,
    checks: Mapping[str, Callable[[JudgedSheet], Views | None]] = CHECKS,
    without: Iterable[str] = (),
) -> Views:
    """Return the views after all checks, one after the other, but those named `without`."""
    for name, check in checks.items():
        found = None if name in without else check(sheet)
        sheet = sheet if found is None else replace(sheet, views=found)
    return sheet.views


def _weakened(views: Views, reasons: Iterable[str]) -> Views:
    """Return the views; those that were ok and have a reason are weak."""
    return tuple(
        replace(view, verdict="weak", reason=reason) if view.verdict == "ok" and reason else view
        for view, reason in zip(views, reasons, strict=True)
    )


def _turn(yaw: float, other: float) -> float:
    """Return by how much two yaws differ, 0 to pi."""
    return abs((yaw - other + np.pi) % (2 * np.pi) - np.pi)


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers))
