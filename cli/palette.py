"""`toonset palette`: a character's colours, and label and contour maps of every picture."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.common.output import (
    OUTPUT_PANEL,
    ForceFlag,
    JsonFlag,
    Printer,
    QuietFlag,
    check_output,
)

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import UInt8

    from toonset.cli.common.palette_inputs import Drawn
    from toonset.palette.paints.select import PaletteOptions
    from toonset.palette.palette import Palette

    Map = UInt8[np.ndarray, "_ _"]

WRITTEN = ("palette.json", "palette.gpl", "palette.ase", "palette.hex", "palette.png")
FOLDERS = ("labels", "contours")
BUNDLE, OUT = Path("bundle"), Path("palette")
LINE = 128  # of 255: covered by half, a pixel is a drawn line's
CHOICE_PANEL = "Choice of colours"


class Method(StrEnum):
    """Who finds the colours."""

    toonset = "toonset"
    extcolors = "extcolors"


class ColorSpace(StrEnum):
    """In which the nearest colour of a pixel is meant."""

    rgb = "rgb"
    oklab = "oklab"


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
        Method,
        typer.Option(
            "--method",
            help="Ours, or the paper's tool for comparison.",
            rich_help_panel=CHOICE_PANEL,
        ),
    ] = Method.toonset,
    space: Annotated[
        ColorSpace, typer.Option("--space", help="In which labels are the nearest colour.")
    ] = ColorSpace.rgb,
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
) -> None:
    """List the colours that make up at least 5 % of the character, and label every pixel.

    Writes palette.json, .gpl, .ase, .hex, .png, labels/ and contours/ into the bundle, replacing
    those of an earlier run; for images and other folders, or with -o, into a folder of their own.
    """
    from toonset.cli.common.palette_inputs import bundle_of, load_drawn
    from toonset.write import new_folder

    printer = Printer(as_json, quiet)
    places = inputs or [BUNDLE]
    bundle = bundle_of(places)
    target = out or bundle or OUT
    if target != bundle:
        check_output(target, places, (*WRITTEN, *FOLDERS), force=force)
    options = _options(min_share, max_colors, keep, contour)
    drawn = load_drawn(places, printer)
    contours = _contours(drawn)
    found = _choose(drawn, contours, colors, options, method)
    labels = _labels(drawn, contours, found, space)
    if target == bundle:
        _write(target, drawn, found, labels, contours)
    else:
        with new_folder(target, force=force) as folder:
            _write(folder, drawn, found, labels, contours)
    _report(found, target, printer)


def _options(min_share: float, max_colors: int, keep: str, contour: bool) -> PaletteOptions:
    from toonset.palette.paints.select import PaletteOptions

    kept = _typed("--keep", keep).tolist() if keep else []
    return PaletteOptions(min_share, max_colors, tuple((r, g, b) for r, g, b in kept), contour)


def _typed(option: str, text: str) -> UInt8[np.ndarray, "colors 3"]:
    """Return the colours of an option, which messages name."""
    from toonset.errors import PaletteError
    from toonset.palette.formats.registry import parse_colors

    try:
        return parse_colors(text)
    except PaletteError as error:
        raise PaletteError(f"{option}: {error}") from error


def _contours(drawn: Drawn) -> list[Map]:
    from toonset.palette.pixels.ink_lines import find_contour

    return [find_contour(picture) for picture in drawn.pictures]


def _choose(
    drawn: Drawn, contours: list[Map], colors: str | None, options: PaletteOptions, method: Method
) -> Palette:
    from toonset.palette.paints.extcolors import extcolors_palette
    from toonset.palette.paints.extract import extract_palette, pick_palette
    from toonset.palette.paints.places import with_places

    if colors is not None and (options.keep or method is not Method.toonset):
        raise typer.BadParameter("--colors is the whole palette; leave --keep and --method away")
    if options.keep and method is not Method.toonset:
        raise typer.BadParameter("--keep belongs to --method toonset")
    lines = [contour >= LINE for contour in contours]
    if colors is not None:
        return pick_palette(drawn.pictures, _typed("--colors", colors), lines)
    if method is Method.extcolors:
        return with_places(extcolors_palette(drawn.pictures, options), drawn.pictures)
    return with_places(extract_palette(drawn.pictures, options, lines), drawn.pictures)


def _labels(drawn: Drawn, contours: list[Map], found: Palette, space: ColorSpace) -> list[Map]:
    """Return the label maps; lines whose colour is not in the palette are unlabelled."""
    from toonset.palette.pixels.labels import UNLABELLED, label_image

    labels = [label_image(p, found.rgb, space=space.value) for p in drawn.pictures]
    ink = found.contour
    if ink is not None and ink.rgb not in [color.rgb for color in found.colors]:
        for values, contour in zip(labels, contours, strict=True):
            values[contour >= LINE] = UNLABELLED
    return labels


def _write(
    folder: Path, drawn: Drawn, found: Palette, labels: list[Map], contours: list[Map]
) -> None:
    from toonset.dataset.bundle.palette_files import write_palette

    named = list(zip(drawn.names, labels, strict=True))
    write_palette(folder, found, named, list(zip(drawn.names, contours, strict=True)))


def _report(found: Palette, target: Path, printer: Printer) -> None:
    from toonset.cli.common.palette_report import palette_lines
    from toonset.palette.formats.registry import to_json

    for warning in found.warnings:
        printer.say(warning)
    text = "\n".join([*palette_lines(found), str(target)])
    printer.result({"out": target, **to_json(found)}, text)
