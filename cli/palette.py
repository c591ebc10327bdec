"""`toonset palette`: a character's colours, and label and contour maps of every picture."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from toonset.cli.common.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    VerboseFlag,
    check_output,
)

if TYPE_CHECKING:
    from toonset.palette.palette import Palette

WRITTEN = ("palette.json", "palette.gpl", "palette.ase", "palette.hex", "palette.png")
FOLDERS = ("labels", "contours")
BUNDLE, OUT = Path("bundle"), Path("palette")
CHOICE_PANEL = "Choice of colours"


def palette(
    inputs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[BUNDLE|FOLDER|IMAGE...]",
            help="A bundle (default: ./bundle), a folder that `split` wrote, folders, images.",
        ),
    ] = None,
    colors: Annotated[
        str | None,
        typer.Option(
            "--colors",
            help="Your own: '#aabbcc,#123,white', or a palette file.",
            rich_help_panel=CHOICE_PANEL,
        ),
    ] = None,
    min_share: Annotated[
        float,
        typer.Option(
            "--min-share",
            help="Least share of the character's pixels.",
            rich_help_panel=CHOICE_PANEL,
        ),
    ] = 0.05,
    max_colors: Annotated[
        int,
        typer.Option(
            "--max-colors", help="At most so many, the largest.", rich_help_panel=CHOICE_PANEL
        ),
    ] = 255,
    keep: Annotated[
        str,
        typer.Option(
            "--keep",
            metavar="COLOURS",
            help="Keep these of the left-out colours: '#aabbcc,...'.",
            rich_help_panel=CHOICE_PANEL,
        ),
    ] = "",
    contour: Annotated[
        bool,
        typer.Option(
            "--contour/--no-contour",
            help="Count drawn lines to their colour; without, only what is painted with it.",
            rich_help_panel=CHOICE_PANEL,
        ),
    ] = True,
    method: Annotated[
        Literal["toonset", "extcolors"],
        typer.Option(
            "--method",
            help="Ours, or the paper's tool for comparison.",
            rich_help_panel=CHOICE_PANEL,
        ),
    ] = "toonset",
    space: Annotated[
        Literal["rgb", "oklab"],
        typer.Option("--space", help="In which labels are the nearest colour."),
    ] = "rgb",
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            help="Folder (default: the bundle; ./palette).",
            rich_help_panel=OUTPUT_PANEL,
        ),
    ] = None,
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
    verbose: VerboseFlag = False,
) -> None:
    """List the colours that make up at least 5 % of the character, and label every pixel.

    Writes palette.json, .gpl, .ase, .hex, .png, labels/ and contours/ into the bundle, replacing
    those of an earlier run; for images and other folders, or with -o, into a folder of their own.
    """
    from toonset.dataset.bundle.palette_files import write_palette
    from toonset.dataset.split_folder.pictures import bundle_of, load_pictures
    from toonset.palette.extract import choose_palette, label_drawing, options_of
    from toonset.palette.pixels.ink_lines import find_contour
    from toonset.write import new_folder

    printer = Printer(as_json, quiet, verbose)
    places = inputs or [BUNDLE]
    bundle = bundle_of(places)
    target = out or bundle or OUT
    if target != bundle:
        check_output(target, places, (*WRITTEN, *FOLDERS), force=force)
    options = options_of(min_share, max_colors, keep, contour=contour)
    drawn = load_pictures(places)
    for note in drawn.notes:
        printer.say(note)
    contours = [find_contour(picture) for picture in drawn.pictures]
    found = choose_palette(drawn.pictures, contours, options, colors, method)
    pairs = zip(drawn.pictures, contours, strict=True)
    labels = [label_drawing(*pair, found, space) for pair in pairs]
    named = [list(zip(drawn.names, maps, strict=True)) for maps in (labels, contours)]
    with nullcontext(target) if target == bundle else new_folder(target, force=force) as folder:
        write_palette(folder, found, *named)
    _report(found, target, printer, in_bundle=target == bundle)


def _report(found: Palette, target: Path, printer: Printer, *, in_bundle: bool) -> None:
    from toonset.cli.common.palette_report import palette_lines
    from toonset.palette.formats.registry import to_json

    for warning in found.warnings:
        printer.say(warning)
    after = f"; next: toonset train {target}" if in_bundle else ""
    lines = palette_lines(found, verbose=printer.verbose)
    text = "\n".join([*lines, f"{target}: look at palette.png{after}"])
    printer.result({"out": target, **to_json(found)}, text)
