"""`toonset palette` and `recolor`: find colours and labels; change the drawings' colours."""

from __future__ import annotations

import os
import shlex
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from toonset import lock
from toonset.cli.common.output import OUTPUT_PANEL, DetailPrinter, ForceFlag, Printer
from toonset.dataset.split_folder.options import CORRECTIONS
from toonset.errors import counted
from toonset.lock import FOLDERS
from toonset.palette.options import CHOICE_PANEL, PaletteOptions
from toonset.write import check_output

if TYPE_CHECKING:
    from toonset.dataset.bundle.painted import Painted
    from toonset.palette.palette import Palette

WRITTEN = ("palette.json", "palette.gpl", "palette.ase", "palette.hex", "palette.png")
BUNDLE, OUT, RECOLORED = Path("bundle"), Path("palette"), Path("recolored")


def palette(
    inputs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[BUNDLE|FOLDER|IMAGE...]",
            help="A bundle (default: ./bundle), a folder that `split` wrote, folders, images.",
        ),
    ] = None,
    options: PaletteOptions = PaletteOptions(),
    corrections: Annotated[
        Path | None,
        typer.Option(
            "--corrections", metavar="FILE", help=CORRECTIONS.help, rich_help_panel=CHOICE_PANEL
        ),
    ] = None,
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
    *,
    printer: DetailPrinter,
) -> None:
    """List the colours that make up at least 5 % of the character, and label every pixel.

    Writes palette.json, .gpl, .ase, .hex, .png, labels/, coverage/, contours/ and, for shaded
    sheets, tones/ into the bundle, replacing those of an earlier run; for images and other
    folders, or with -o, into a folder of their own.
    """
    from toonset.dataset.bundle.palette_files import check_map_folders, write_labelled
    from toonset.dataset.label_drawings import label_drawings
    from toonset.dataset.split_folder.corrected import Given
    from toonset.dataset.split_folder.pictures import bundle_of, check_pictures, load_pictures
    from toonset.palette.choice import rule_of
    from toonset.palette.pixels.ink_lines import find_contours
    from toonset.write import new_folder

    places = inputs or [BUNDLE]
    given = None if corrections is None else Given.of(corrections)
    if given is not None:
        given.check_beside(keep=options.keep)
    check_pictures(places)
    bundle = bundle_of(places)
    target = out or bundle or OUT
    if target != bundle:
        read = places if corrections is None else [*places, corrections]
        check_output(target, read, (*WRITTEN, *FOLDERS), force=force)
    else:
        lock.claim(lock.set_of(target / WRITTEN[0]), target)
        check_map_folders(target)
    rule_of(options)  # colours that cannot be understood are refused before pictures are read
    drawn = load_pictures(places)
    for note in drawn.notes:
        printer.say(note)
    contours = find_contours(drawn.pictures)
    found, maps, notes = label_drawings(drawn, contours, options, given, space)
    for note in notes:
        printer.say(note)
    with nullcontext(target) if target == bundle else new_folder(target, force=force) as folder:
        write_labelled(folder, found, drawn.names, drawn.pictures, contours, space, maps)
    _report(found, target, printer, in_bundle=target == bundle)


def _report(found: Palette, target: Path, printer: Printer, *, in_bundle: bool) -> None:
    from toonset.cli.common.palette_text import palette_lines
    from toonset.palette.formats.json import to_json

    for warning in found.warnings:
        printer.say(warning)
    after = f"; next: {shlex.join(['toonset', 'train', str(target)])}" if in_bundle else ""
    lines = palette_lines(found, verbose=printer.verbose)
    text = "\n".join([*lines, f"{target}: look at palette.png{after}"])
    printer.result({"out": target, **to_json(found)}, text)


def recolor(
    changes: Annotated[
        list[str],
        typer.Option("--recolor", help="OLD=NEW, '#aa0000=#00aa00' or 'teal=#00aa00'; repeatable."),
    ],
    inputs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[BUNDLE|FOLDER|IMAGE...]",
            help="A bundle (default: ./bundle) with its palette, or what `palette` takes.",
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option("-o", "--out", help="Folder for the pictures.", rich_help_panel=OUTPUT_PANEL),
    ] = RECOLORED,
    force: ForceFlag = False,
    *,
    printer: Printer,
) -> None:
    """Write the drawings with some palette colours replaced, one PNG each.

    A colour's shadow tone and soft edges go with it; drawn lines, and small features that no colour
    of the palette stands for, stay as they are. Of a bundle, its palette.json, labels/ and tones/
    count; of other pictures the palette is found first.
    """
    from toonset.dataset.images.picture import encode_png
    from toonset.dataset.split_folder.pictures import check_pictures
    from toonset.palette.recolor import change_colors, recolor_drawing
    from toonset.write import new_folder, write_bytes

    places = inputs or [BUNDLE]
    check_pictures(places)
    read = [Path(os.path.abspath(place)) for place in places]
    folders = [place if place.is_dir() else place.parent for place in read]
    pictures = [folder / name for folder in folders for name in ("images", *FOLDERS)]
    check_output(out, [*places, *pictures], ("*.png",), force=force)
    found, drawings = _painted(places, printer)
    colors = change_colors(found.rgb, changes, [color.name for color in found.colors])
    with new_folder(out, force=force) as folder:
        for one in drawings:
            new = recolor_drawing(one.picture, one.paint, one.contour, found, colors)
            write_bytes(folder / one.name, encode_png(new))
    names = [one.name for one in drawings]
    printer.result({"out": out, "files": names}, f"{out}: {counted(len(names), 'picture')}")


def _painted(places: list[Path], printer: Printer) -> tuple[Palette, list[Painted]]:
    """Return palette and drawings: a bundle's own, or found here."""
    from toonset.dataset.bundle.painted import Painted, read_painted
    from toonset.dataset.split_folder.pictures import bundle_of, load_pictures
    from toonset.palette.choice import choose_palette
    from toonset.palette.extract import paint_maps
    from toonset.palette.pixels.ink_lines import find_contours

    bundle = bundle_of(places)
    if bundle is not None:
        return read_painted(places[0])
    drawn = load_pictures(places)
    for note in drawn.notes:
        printer.say(note)
    contours = find_contours(drawn.pictures)
    found = choose_palette(drawn.pictures, contours, swatches=drawn.swatches)
    maps = paint_maps(drawn.pictures, contours, found)
    parts = zip(drawn.names, drawn.pictures, maps, contours, strict=True)
    return found, [Painted(*part) for part in parts]
