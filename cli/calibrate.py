"""`toonset calibrate`: find the cameras of drawings."""

from __future__ import annotations

import shlex
from dataclasses import replace
from enum import StrEnum
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from toonset.cli.common.cutting import (
    LABELS_HELP,
    BackgroundOption,
    BoxesOption,
    CorrectionsOption,
    DropOption,
    GridOption,
    GroupOption,
    MattingOption,
    OutfitOption,
)
from toonset.cli.common.outfits import (
    about,
    check_outfit_output,
    cut_outfits,
    first_row,
    naming,
    outfit_folders,
    print_results,
)
from toonset.cli.common.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    SeedOption,
    UpOption,
    VerboseFlag,
    counted,
)
from toonset.options import Symmetric

if TYPE_CHECKING:
    from toonset.calib.hints import Hints
    from toonset.calib.result import Calibration
    from toonset.dataset.split_folder.load import Sheet
    from toonset.mesh import Mesh, Up

NO_BODY: Literal["none"] = "none"
UNCERTAIN = 3  # exit code: files are written, but a view is not certain
KNOWN_PANEL = "What you know"


class Lock(StrEnum):
    """What `--lock` may hold fixed."""

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
            help="Posed mannequin: obj, ply, stl, glb, vrm, off; none: no body (default: the "
            "drawings alone, or a plain body where they are not sure).",
            rich_help_panel=KNOWN_PANEL,
        ),
    ] = None,
    up: UpOption = "y",
    labels: Annotated[
        str,
        typer.Option("--views", metavar="LABELS", help=LABELS_HELP, rich_help_panel=KNOWN_PANEL),
    ] = "",
    front: Annotated[
        int | None,
        typer.Option(
            "--front",
            metavar="N",
            min=0,
            help="Number of the view that shows the front, from 0, as the pictures are named.",
            rich_help_panel=KNOWN_PANEL,
        ),
    ] = None,
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
    symmetric: Annotated[
        Symmetric,
        typer.Option(
            "--symmetric",
            help="Left and right are mirror images: on, off, or auto (unless a drawing shows "
            "otherwise). `toonset train` mirrors what nobody drew.",
            rich_help_panel=KNOWN_PANEL,
        ),
    ] = "auto",
    boxes: BoxesOption = None,
    grid: GridOption = "",
    background: BackgroundOption = "",
    drop: DropOption = "",
    group: GroupOption = None,
    outfit: OutfitOption = "",
    matting: MattingOption = None,
    corrections: CorrectionsOption = None,
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Bundle folder.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("bundle"),
    force: ForceFlag = False,
    seed: SeedOption = 0,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
    verbose: VerboseFlag = False,
) -> None:
    """Fit one camera per drawing by aligning its outline with a posed mannequin.

    Writes a bundle: transforms.json, images/, calibration.json, overlay.png and mannequin.obj. Exit
    code 3 when a view is weak, ambiguous or failed; the files are written then too. --outfit all
    writes a bundle for each outfit, A/, B/ and so on.
    """
    from toonset.calib.hints import Hints
    from toonset.calib.verdict.report import calibration_dict
    from toonset.calib.write_bundle import save_bundle
    from toonset.dataset.bundle.bundle import WRITTEN
    from toonset.dataset.split_folder.cutting import Cutting
    from toonset.dataset.split_folder.load import split_sheet
    from toonset.dataset.split_folder.view_labels import front_label
    from toonset.errors import UsageError

    lock = tuple(lock.value for lock in locked or ())
    hints = Hints(labels, landmarks, landmarks_only, init, lock, corrections, symmetric)
    hints.check()
    if front is not None and (labels or landmarks_only):
        raise UsageError("--front does nothing beside --views or --landmarks-only; drop one")
    row = first_row(outfit, drop=drop, corrections=corrections, landmarks=landmarks, init=init)
    Cutting(boxes, grid, background, drop, group, row, matting).check()
    printer = Printer(as_json, quiet, verbose)
    _check_files(sheets, hints, boxes, matting, front=front is not None)
    given = None if str(mesh) == NO_BODY else mesh
    body = _body(mesh, up)
    inputs = [*sheets, given, landmarks, init, boxes, matting, corrections]
    check_outfit_output(out, outfit, inputs, WRITTEN, force=force)
    cut = partial(
        split_sheet,
        sheets,
        boxes=boxes,
        grid=grid,
        background=background,
        drop=drop,
        labels=labels,
        corrections=corrections,
        group=group,
        matting=matting,
    )
    found: dict[str, Calibration] = {}
    for letter, sheet in cut_outfits(sheets, outfit, cut).items():
        with naming(letter):
            if front is not None:
                hints = replace(hints, labels=front_label(front, len(sheet.views)))
            found[letter] = _fitted(sheet, body, hints, seed, about(printer, letter))
    with outfit_folders(out, found, force=force) as folder:
        for letter, one in found.items():
            save_bundle(folder / letter, one, force=force)
    told = dict[str, dict[str, Any]]()
    for letter, one in found.items():
        _say_result(one, out / letter, about(printer, letter))
        told[letter] = {"bundle": out / letter, **calibration_dict(one)}
    print_results(out, told, printer)
    if not all(one.is_certain for one in found.values()):
        raise typer.Exit(UNCERTAIN)


def _check_files(
    sheets: list[Path], hints: Hints, boxes: Path | None, matting: Path | None, *, front: bool
) -> None:
    """Refuse files that are missing, or that say what an option says, too."""
    from toonset.dataset.bundle.transforms_read import transforms_file
    from toonset.dataset.split_folder.corrected import Given
    from toonset.errors import LandmarkError, PictureError, SheetError
    from toonset.read import check_there

    landmarks = None if hints.landmarks is None else Path(hints.landmarks)
    check_there(sheets, "picture", PictureError)
    check_there([landmarks], "landmark", LandmarkError)
    check_there([boxes], "boxes", SheetError)
    check_there([matting], "matting network", PictureError)
    if hints.corrections is not None:
        Given.of(hints.corrections).check_beside(front=front)
    if hints.init is not None:
        transforms_file(Path(hints.init))


def _body(mesh: Path | None, up: Up) -> Mesh | Literal["none"] | None:
    """Return the mannequin that --mesh names."""
    from toonset.dataset.mesh.load import load_mesh

    if mesh is None:
        return None
    return NO_BODY if str(mesh) == NO_BODY else load_mesh(mesh, up=up)


def _fitted(
    sheet: Sheet, body: Mesh | Literal["none"] | None, hints: Hints, seed: int, printer: Printer
) -> Calibration:
    from toonset.calib.calibrate import calibrate as find

    @cache
    def say_inputs() -> None:  # once, when nothing of them is refused any more
        _say_inputs(sheet, body, printer)

    def progress(step: str, done: float) -> None:
        say_inputs()
        printer.progress(f"{step} {done:.0%}" if done else step)

    found = find(sheet.views, body, hints, seed=seed, progress=progress)
    say_inputs()
    return found


def _say_inputs(sheet: Sheet, mesh: Mesh | Literal["none"] | None, printer: Printer) -> None:
    from toonset.dataset.mannequin.options import MannequinOptions

    remarks = mesh.remarks if mesh is not None and not isinstance(mesh, str) else ()
    for note in (*sheet.skipped, *sheet.warnings, *remarks):
        printer.say(note)
    if sheet.outfits and "outfit" not in sheet.options:
        printer.say(
            f"rows A to {sheet.outfits[-1]} show the same directions and are taken for one body; "
            "if clothes differ, take one row with --outfit A, or each with --outfit all"
        )
    looks = MannequinOptions()
    body = "no mannequin"
    if mesh is None:
        body = (
            "no --mesh: the drawings alone or, where they are not sure, the default mannequin, "
            f"{looks.heads_tall:g} heads tall, {looks.pose} pose (`toonset mannequin` makes others)"
        )
    elif not isinstance(mesh, str):
        body = f"mannequin of {len(mesh.faces)} faces"
    count = len(sheet.views)
    printer.say(f"{counted(count, 'view')}, {body}")


def _say_result(found: Calibration, out: Path, printer: Printer) -> None:
    from toonset.calib.verdict.report import (
        evidence_line,
        lying_line,
        model_line,
        undrawn_line,
        view_line,
    )

    for fit in found.landmarks:
        if fit.misplaced:
            names = ", ".join(fit.misplaced)
            printer.say(f"{fit.view}: landmarks that do not fit the others: {names}; check them")
    for change in (*found.cuts, *found.filled_holes):
        printer.say(str(change))
    if captions := found.origin["options"].get("captions"):
        printer.say(f"captions were read: {captions}; --views says otherwise")
    printer.say(model_line(found))
    printer.detail(evidence_line(found))
    for view in found.views:
        printer.say(view_line(view))
    if undrawn := undrawn_line(found):
        printer.say(undrawn)
    if lying := lying_line(found):
        printer.doubt(lying)
    verdict = f"sheet: {found.verdict}" + (f" ({found.reason})" if found.reason else "")
    (printer.say if found.is_certain else printer.doubt)(verdict)
    after = f"next: {shlex.join(['toonset', 'palette', str(out)])}"
    if found.verdict == "failed":
        after = "then give --views, --mesh or --landmarks: these cameras are of no use to a field"
    printer.say(f"look at {out / 'overlay.png'}; {after}")
