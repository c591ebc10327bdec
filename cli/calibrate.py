"""`toonset calibrate`: drawings to cameras."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toonset.cli.output import ForceFlag, JsonFlag, Printer, QuietFlag, SeedOption, check_output

if TYPE_CHECKING:
    from toonset.calib.result import Calibration
    from toonset.mesh import Mesh
    from toonset.view import View

WRITTEN = (
    *("transforms.json", "images", "calibration.json", "overlay.png"),
    *("palette.json", "palette.gpl", "labels", "run"),
)
LEAST_HEIGHT = 0.01  # of the width; flatter, nothing can be told from its outline
UNCERTAIN = 3  # exit code: files are written, but a view is not certain


def calibrate(
    sheets: Annotated[
        list[Path],
        typer.Argument(metavar="SHEET", help="A character sheet, or one file per view."),
    ],
    mesh: Annotated[Path, typer.Option("--mesh", help="Posed mannequin: obj, ply, stl, glb, off.")],
    labels: Annotated[
        str,
        typer.Option(
            "--views",
            help="What each view shows, in sheet order: front,3q,side,back ... or yaws in degrees.",
        ),
    ] = "",
    out: Annotated[Path, typer.Option("-o", "--out", help="Bundle folder.")] = Path("bundle"),
    force: ForceFlag = False,
    seed: SeedOption = 0,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Fit one camera per drawing by aligning its outline with a posed mannequin.

    Writes a bundle: transforms.json, images/, calibration.json and overlay.png. Exit code 3 when a
    view is weak or ambiguous; the files are written then too.
    """
    from toonset.calib.calibrate import CalibrationOptions
    from toonset.calib.calibrate import calibrate as fit
    from toonset.calib.known import Known
    from toonset.calib.labels import parse_labels
    from toonset.calib.overlay import draw_overlay
    from toonset.calib.report import calibration_dict, model_line, view_line
    from toonset.dataset.bundle import write_bundle
    from toonset.dataset.mesh_file import load_mesh

    printer = Printer(as_json, quiet)
    check_output(out, [*sheets, mesh], WRITTEN, force=force)
    mannequin = load_mesh(mesh)
    _check_upright(mannequin)
    views = _load_views(sheets, printer)
    count = "1 view" if len(views) == 1 else f"{len(views)} views"
    printer.say(f"{count}, mannequin of {len(mannequin.faces)} faces")
    known = Known(labels=parse_labels(labels, len(views)) if labels else ())
    options = CalibrationOptions()
    found = fit(
        views,
        mannequin,
        options,
        lambda step, done: printer.progress(f"{step} {done:.0%}" if done else step),
        known,
    )
    report = calibration_dict(found) | _provenance([*sheets, mesh], options, seed)
    overlay = draw_overlay(views, mannequin, found)
    cameras = [view.camera for view in found.views]
    write_bundle(out, views, cameras, mannequin, report, overlay, force=force)
    printer.say(model_line(found))
    for view in found.views:
        printer.say(view_line(view))
    printer.say(f"sheet: {found.verdict}" + (f" ({found.reason})" if found.reason else ""))
    printer.say(f"look at {out / 'overlay.png'}")
    printer.result({"bundle": out, **report}, str(out))
    if _uncertain(found):
        raise typer.Exit(UNCERTAIN)


def _check_upright(mesh: Mesh) -> None:
    from toonset.errors import MeshError

    widths = mesh.bounds[1] - mesh.bounds[0]
    if widths[1] < LEAST_HEIGHT * max(widths):
        raise MeshError(
            f"{mesh.name}: {widths[1]:.3g} high (+Y is up) but {max(widths):.3g} wide; turn the "
            "mannequin upright and export it again"
        )


def _load_views(paths: list[Path], printer: Printer) -> list[View]:
    from dataclasses import replace

    from toonset.dataset.picture import load_rgba
    from toonset.dataset.sheet import split_sheet
    from toonset.errors import SheetError

    views: list[View] = []
    for path in paths:
        picture = load_rgba(path)
        try:
            sheet = split_sheet(picture)
        except SheetError as error:
            raise SheetError(f"{path}: {error}") from error
        for warning in sheet.warnings:
            printer.say(f"{path.name}: {warning}")
        views.extend(sheet.views)
    return [replace(view, name=f"{i:03d}.png") for i, view in enumerate(views)]


def _provenance(inputs: list[Path], options: Any, seed: int) -> dict[str, Any]:
    from dataclasses import asdict
    from hashlib import sha256
    from importlib.metadata import version

    packages = ("toonset", "numpy", "scipy", "opencv-contrib-python-headless")
    return {
        "options": asdict(options),
        "seed": seed,
        "versions": {name: version(name) for name in packages},
        "inputs": [  # views may come from files of the same name in several folders
            {"name": path.name, "sha256": sha256(path.read_bytes()).hexdigest()} for path in inputs
        ],
    }


def _uncertain(found: Calibration) -> bool:
    return found.verdict != "ok" or any(view.verdict != "ok" for view in found.views)
