"""`toonset split`: cut a sheet into views that a person can see and correct."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toonset.cli.common.outfits import (
    about,
    check_outfit_output,
    cut_outfits,
    first_row,
    outfit_folders,
    print_results,
)
from toonset.cli.common.output import OUTPUT_PANEL, ForceFlag, Printer
from toonset.dataset.split_folder.options import SheetOptions

if TYPE_CHECKING:
    from toonset.dataset.split_folder.load import Sheet
    from toonset.dataset.split_folder.views import Source

WRITTEN = ("images", "split.json", "overlay.png")
DOUBTFUL = 3  # exit code: files are written, but a person should look


def split(
    sheets: Annotated[
        list[Path],
        typer.Argument(
            metavar="SHEET", help="Character sheets, files of one view each, or folders of them."
        ),
    ],
    cut: SheetOptions = SheetOptions(),
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("views"),
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Cut the figures out of a sheet, and show what was found.

    Writes images/, split.json and overlay.png, the sheet with numbered boxes: look at it, correct
    with the options below or in images/ itself (delete, rename, repaint), and give the folder to
    `toonset calibrate`. Exit code 3 when something is doubtful; the files are written then too.
    --outfit all writes a folder for each outfit, A/, B/ and so on.
    """
    from toonset.dataset.split_folder.load import split_sheet
    from toonset.dataset.split_folder.overlay import draw_sheet
    from toonset.dataset.split_folder.write import split_dict, write_split
    from toonset.errors import PictureError, SheetError
    from toonset.read import check_there

    replace(cut, outfit=first_row(cut.outfit, drop=cut.drop)).check()
    check_there(sheets, "picture", PictureError)
    check_there([cut.boxes], "boxes", SheetError)
    check_there([cut.matting], "matting network", PictureError)
    inputs = [*sheets, cut.boxes, cut.matting]
    check_outfit_output(out, cut.outfit, inputs, WRITTEN, force=force)
    found = cut_outfits(sheets, cut, partial(split_sheet, sheets))
    with outfit_folders(out, found, force=force) as folder:
        for letter, sheet in found.items():
            overlay = draw_sheet(sheet)
            write_split(folder / letter, sheet.split, overlay, sheet.options, force=force)
    told = dict[str, dict[str, Any]]()
    for letter, sheet in found.items():
        _say(sheet, out / letter, about(printer, letter))
        told[letter] = {"folder": out / letter, **split_dict(sheet.split, sheet.options)}
    print_results(out, told, printer)
    if any(sheet.warnings for sheet in found.values()):
        raise typer.Exit(DOUBTFUL)


def _say(sheet: Sheet, out: Path, printer: Printer) -> None:
    from toonset.palette.names import hex_of

    for note in sheet.skipped:
        printer.say(note)
    named = sheet.split
    for index, source in enumerate(named.sources):
        printer.say(_source_line(source))
        for view, of, label in zip(named.views, named.source_of, named.labels, strict=True):
            if of == index:
                x, y, width, height = view.figure_box
                line = f"line {view.line_width_px:4.1f} px" if view.line_width_px else "no line"
                text = f"{view.name}  at {x:5d},{y:5d}  {width:5d} x {height:4d} px  {line}"
                printer.say(f"  {text}  {label}".rstrip())
        kinds = Counter(left.kind for left in source.left_out)
        if kinds:
            listed = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
            printer.say(f"  left out: {listed}")
        if len(source.groups) > 1:
            for number, one in enumerate(source.groups, start=1):
                how = "taken" if one.taken else f"--group {number}"
                printer.say(f"  group {number}: {one.why} ({how})")
        for remark in source.remarks:
            printer.say(f"  {remark}")
        if source.swatches:
            colors = ", ".join(hex_of(one.color) for one in source.swatches)
            printer.say(f"  it prints a palette, which `toonset palette` uses: {colors}")
    for warning in sheet.warnings:
        printer.doubt(f"look: {warning}")
    if "drop" in sheet.options:
        printer.say("views are numbered anew; --drop counts as in the overlay without it")
    printer.say(f"look at {out / 'overlay.png'}")


def _source_line(source: Source) -> str:
    from toonset.palette.names import hex_of

    width, height = source.size_wh
    ground = "transparent"
    if source.background is not None:
        ground = f"background {hex_of(source.background)}"
    return f"{source.name}: {width} x {height} px, {ground}"
