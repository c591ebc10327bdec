"""`toonset calibrate`: drawings to cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toonset.cli.common.calibrate_inputs import Body, Hints, load_body, load_known, load_sheets
from toonset.cli.common.cutting import (
    LABELS_HELP,
    BackgroundOption,
    BoxesOption,
    Cutting,
    DropOption,
    GridOption,
)
from toonset.cli.common.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    SeedOption,
    check_output,
)
from toonset.cli.common.provenance import provenance

if TYPE_CHECKING:
    from toonset.calib.corrections.false_holes import FilledHole
    from toonset.calib.hints import Known
    from toonset.calib.landmarks.landmarks import LandmarkFit
    from toonset.calib.result import Calibration
    from toonset.mesh import Mesh
    from toonset.view import View

WRITTEN = (
    *("transforms.json", "images", "calibration.json", "overlay.png", "mannequin.obj"),
    *("palette.*", "labels", "contours", "run", "run.unfinished"),  # what later verbs put beside
)
UNCERTAIN = 3  # exit code: files are written, but a view is not certain
KNOWN_PANEL = "What you know"


class Lock(StrEnum):
    """What may stay as it is given."""

    yaw = "yaw"
    elevation = "elevation"
    scale = "scale"
    fov = "fov"


def calibrate(
    sheets: Annotated[
        list[Path],
        typer.Argument(
            metavar="SHEET",
            help="A character sheet, one file per view, a folder of them, or what `toonset split` "
            "wrote.",
        ),
    ],
    mesh: Annotated[
        Path | None,
        typer.Option(
            "--mesh",
            metavar="FILE",
            help="Posed mannequin: obj, ply, stl, glb, off (default: a plain body).",
            rich_help_panel=KNOWN_PANEL,
        ),
    ] = None,
    labels: Annotated[
        str,
        typer.Option(
            "--views",
            metavar="LABELS",
            help=LABELS_HELP,
            rich_help_panel=KNOWN_PANEL,
        ),
    ] = "",
    landmarks: Annotated[
        Path | None,
        typer.Option(
            "--landmarks",
            metavar="FILE",
            help="Which pixels show which points of the mannequin: JSON or CSV.",
            rich_help_panel=KNOWN_PANEL,
        ),
    ] = None,
    landmarks_only: Annotated[
        bool,
        typer.Option(
            "--landmarks-only",
            help="Cameras from --landmarks alone: the outline is not the mannequin's.",
            rich_help_panel=KNOWN_PANEL,
        ),
    ] = False,
    init: Annotated[
        Path | None,
        typer.Option(
            "--init",
            metavar="PATH",
            help="A bundle or transforms.json of these views: start from its cameras.",
            rich_help_panel=KNOWN_PANEL,
        ),
    ] = None,
    locked: Annotated[
        list[Lock] | None,
        typer.Option(
            "--lock",
            metavar="WHAT",
            help="Keep yaw, elevation, scale or fov as --init has it (or yaw as --views has it); "
            "repeatable.",
            rich_help_panel=KNOWN_PANEL,
        ),
    ] = None,
    boxes: BoxesOption = None,
    grid: GridOption = "",
    background: BackgroundOption = "",
    drop: DropOption = "",
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Bundle folder.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("bundle"),
    force: ForceFlag = False,
    seed: SeedOption = 0,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Fit one camera per drawing by aligning its outline with a posed mannequin.

    Writes a bundle: transforms.json, images/, calibration.json, overlay.png and mannequin.obj. Exit
    code 3 when a view is weak, ambiguous or failed; the files are written then too.
    """
    kept = tuple(lock.value for lock in locked or ())
    cutting = Cutting(boxes, drop, background, grid)
    hints = Hints(labels, landmarks, landmarks_only, init, kept, cutting)
    hints.check_usage()
    printer = Printer(as_json, quiet)
    check_output(out, [*sheets, mesh, landmarks, init, boxes], WRITTEN, force=force)
    from toonset.calib.corrections.cropped import at_cuts
    from toonset.calib.corrections.false_holes import without_false_holes

    body = load_body(mesh)
    given = load_sheets(sheets, hints, printer)
    views, hints = given.views, replace(hints, labels=given.labels)
    known = load_known(hints, views, body)
    marks = _landmark_fits(known, body.mesh)
    _say_inputs(views, body, marks, printer)
    found = _fit(views, body.mesh, known, printer, landmarks_only=landmarks_only)
    views, found = at_cuts(views, found)
    views, filled = without_false_holes(views, found.views, given.papers, found.mannequin)
    for change in (*found.cuts, *filled):
        printer.say(str(change))
    report = _report(found, marks, filled) | provenance(given.files, body, hints, seed)
    _write(out, views, body.mesh, found, report, force=force)
    _say_result(found, out, printer)
    printer.result({"bundle": out, **report}, str(out))
    if not _is_certain(found):
        raise typer.Exit(UNCERTAIN)


def _is_certain(found: Calibration) -> bool:
    return all(verdict == "ok" for verdict in (found.verdict, *(v.verdict for v in found.views)))


def _landmark_fits(known: Known, mesh: Mesh) -> list[LandmarkFit]:
    """Return what the landmarks say of the views that have any."""
    if not known.landmarks:
        return []
    from toonset.calib.landmarks.landmarks import landmark_starts
    from toonset.calib.outline.occluding_contour import prepare_surface

    return [fit for fit in landmark_starts(known.landmarks, prepare_surface(mesh)) if fit]


def _say_inputs(
    views: Sequence[View], body: Body, marks: Sequence[LandmarkFit], printer: Printer
) -> None:
    count = "1 view" if len(views) == 1 else f"{len(views)} views"
    printer.say(f"{count}, {body}")
    for fit in marks:
        if fit.misplaced:
            names = ", ".join(fit.misplaced)
            printer.say(f"{fit.view}: landmarks that do not fit the others: {names}; check them")


def _fit(
    views: Sequence[View], mesh: Mesh, known: Known, printer: Printer, *, landmarks_only: bool
) -> Calibration:
    if landmarks_only:
        from toonset.calib.from_landmarks import calibrate_by_landmarks

        return calibrate_by_landmarks(views, mesh, known.landmarks)
    from toonset.calib.calibrate import calibrate as fit
    from toonset.calib.options import CalibrationOptions

    def progress(step: str, done: float) -> None:
        printer.progress(f"{step} {done:.0%}" if done else step)

    return fit(views, mesh, CalibrationOptions(), progress, known)


def _report(
    found: Calibration, marks: Sequence[LandmarkFit], filled: Sequence[FilledHole]
) -> dict[str, Any]:
    from toonset.calib.verdict.report import calibration_dict

    report = calibration_dict(found)
    report["filled_holes"] = [asdict(hole) for hole in filled]
    if marks:
        report["landmarks"] = [
            {
                "view": fit.view,
                "rms_px": fit.rms_px,
                "misplaced": list(fit.misplaced),
                "perspective_bic_gain": fit.bic_gain,
            }
            for fit in marks
        ]
    return report


def _write(
    out: Path,
    views: Sequence[View],
    mesh: Mesh,
    found: Calibration,
    report: dict[str, Any],
    *,
    force: bool,
) -> None:
    from toonset.calib.verdict.overlay import draw_overlay
    from toonset.dataset.bundle.bundle import write_bundle

    fitted = replace(mesh, vertices=found.mannequin)
    cameras = [view.camera for view in found.views]
    overlay = draw_overlay(views, mesh, found)
    write_bundle(out, views, cameras, fitted, report, overlay, force=force)


def _say_result(found: Calibration, out: Path, printer: Printer) -> None:
    from toonset.calib.verdict.report import model_line, view_line

    printer.say(model_line(found))
    for view in found.views:
        printer.say(view_line(view))
    sheet = f"sheet: {found.verdict}" + (f" ({found.reason})" if found.reason else "")
    (printer.say if _is_certain(found) else printer.doubt)(sheet)
    printer.say(f"look at {out / 'overlay.png'}")
