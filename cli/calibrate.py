"""`toonset calibrate`: find the cameras of drawings."""

from __future__ import annotations

import shlex
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toonset.calib.options import KNOWN_PANEL, Hints
from toonset.cli.common.body import body_of, is_no_body
from toonset.cli.common.outfits import (
    about,
    check_outfit_output,
    cut_outfits,
    first_row,
    naming,
    outfit_folders,
    print_results,
)
from toonset.cli.common.output import OUTPUT_PANEL, DetailPrinter, ForceFlag, Printer, UpOption
from toonset.dataset.split_folder.options import SheetOptions
from toonset.errors import counted
from toonset.options import Body

if TYPE_CHECKING:
    from toonset.calib.result import Calibration
    from toonset.dataset.split_folder.load import Sheet
    from toonset.mesh import Mesh

UNCERTAIN = 3  # exit code: files are written, but a view is not certain


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
    hints: Hints = Hints(),
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
    cut: SheetOptions = SheetOptions(),
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Bundle folder.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("bundle"),
    force: ForceFlag = False,
    *,
    printer: DetailPrinter,
) -> None:
    """Fit one camera per drawing by aligning its outline with a posed mannequin.

    Writes a bundle: transforms.json, images/, calibration.json, overlay.png and mannequin.obj. Exit
    code 3 when a view is weak, ambiguous or failed; the files are written then too. --outfit all
    writes a bundle for each outfit, A/, B/ and so on.
    """
    from toonset.calib.hints import check_hints
    from toonset.calib.verdict.report import calibration_dict
    from toonset.calib.write_bundle import save_bundle
    from toonset.dataset.bundle.bundle import WRITTEN
    from toonset.dataset.split_folder.load import split_sheet
    from toonset.dataset.split_folder.view_labels import front_label
    from toonset.errors import UsageError

    check_hints(hints)
    if front is not None and (hints.labels or hints.landmarks_only):
        raise UsageError("--front does nothing beside --views or --landmarks-only; drop one")
    of_one_row = {"corrections": hints.corrections, "landmarks": hints.landmarks}
    row = first_row(cut.outfit, drop=cut.drop, **of_one_row, init=hints.init)
    replace(cut, outfit=row).check()
    _check_files(sheets, hints, cut, front=front is not None)
    body = body_of(mesh, up)
    given = None if is_no_body(mesh) else mesh
    inputs = [
        *sheets,
        given,
        hints.landmarks,
        hints.init,
        hints.corrections,
        cut.boxes,
        cut.matting,
    ]
    check_outfit_output(out, cut.outfit, inputs, WRITTEN, force=force)
    split = partial(split_sheet, sheets, corrections=hints.corrections)
    found: dict[str, Calibration] = {}
    for letter, sheet in cut_outfits(sheets, cut, split).items():
        with naming(letter):
            if front is not None:
                hints = replace(hints, labels=front_label(front, len(sheet.views)))
            found[letter] = _fitted(sheet, body, hints, about(printer, letter))
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


def _check_files(sheets: list[Path], hints: Hints, cut: SheetOptions, *, front: bool) -> None:
    """Refuse files that are missing, or that say what an option says, too."""
    from toonset.dataset.bundle.transforms_read import transforms_file
    from toonset.dataset.split_folder.corrected import Given
    from toonset.errors import LandmarkError, PictureError, SheetError
    from toonset.read import check_there

    check_there(sheets, "picture", PictureError)
    check_there([hints.landmarks], "landmark", LandmarkError)
    check_there([cut.boxes], "boxes", SheetError)
    check_there([cut.matting], "matting network", PictureError)
    if hints.corrections is not None:
        Given.of(hints.corrections).check_beside(front=front)
    if hints.init is not None:
        transforms_file(Path(hints.init))


def _fitted(sheet: Sheet, body: Mesh | Body, hints: Hints, printer: Printer) -> Calibration:
    from toonset.calib.calibrate import calibrate as find

    @cache
    def say_inputs() -> None:  # once, when nothing of them is refused any more
        _say_inputs(sheet, body, printer)

    def progress(step: str, done: float) -> None:
        say_inputs()
        printer.progress(f"{step} {done:.0%}" if done else step)

    found = find(sheet.views, body, hints, progress=progress)
    say_inputs()
    return found


def _say_inputs(sheet: Sheet, given: Mesh | Body, printer: Printer) -> None:
    from toonset.dataset.mannequin.options import MannequinOptions

    remarks = () if isinstance(given, Body) else given.remarks
    for note in (*sheet.skipped, *sheet.warnings, *remarks):
        printer.say(note)
    if sheet.outfits and "outfit" not in sheet.options:
        printer.say(
            f"rows A to {sheet.outfits[-1]} show the same directions and are taken for one body; "
            "if clothes differ, take one row with --outfit A, or each with --outfit all"
        )
    looks = MannequinOptions()
    body = "no mannequin"
    if given is Body.DEFAULT:
        body = (
            "no --mesh: the drawings alone or, where they are not sure, the default mannequin, "
            f"{looks.heads_tall:g} heads tall, {looks.pose} pose (`toonset mannequin` makes others)"
        )
    elif not isinstance(given, Body):
        body = f"mannequin of {len(given.faces)} faces"
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
