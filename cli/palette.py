"""`toonset palette`: a character's colours and a label map per picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.output import OUTPUT_PANEL, ForceFlag, JsonFlag, Printer, QuietFlag, check_output

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import UInt8

    from toonset.palette.palette import Palette

    Picture = UInt8[np.ndarray, "_ _ 4"]

WRITTEN = ("palette.json", "palette.gpl", "labels")
BUNDLE, OUT = Path("bundle"), Path("palette")
HUNDRED = 100.0


def palette(
    inputs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[BUNDLE|IMAGE...]", help="A bundle (default: ./bundle) or images."),
    ] = None,
    colors: Annotated[
        str | None,
        typer.Option("--colors", help="Your own: '#aabbcc,#123', or a .gpl, .hex, .txt, .json."),
    ] = None,
    min_share: Annotated[
        float, typer.Option("--min-share", help="Least share of the character's pixels.")
    ] = 0.05,
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

    Writes palette.json, palette.gpl and labels/ into the bundle, replacing those of an earlier run;
    for images, or with -o, into a folder of their own.
    """
    from toonset.dataset.palette_files import write_palette
    from toonset.files import new_folder
    from toonset.palette.labels import label_image

    printer = Printer(as_json, quiet)
    places = inputs or [BUNDLE]
    bundle = _bundle_of(places)
    target = out or bundle or OUT
    if target != bundle:
        check_output(target, places, WRITTEN, force=force)
    named = _pictures(places, bundle, printer)
    found = _choose([picture for _, picture in named], colors, min_share)
    labels = [(name, label_image(picture, found.rgb)) for name, picture in named]
    if target == bundle:
        write_palette(target, found, labels)
    else:
        with new_folder(target, force=force) as folder:
            write_palette(folder, found, labels)
    _report(found, target, printer)


def _bundle_of(places: list[Path]) -> Path | None:
    """Return the bundle's folder, or None where pictures are given."""
    from toonset.errors import BundleError

    folders = [place for place in places if _is_meant_as_bundle(place)]
    if not folders and places != [BUNDLE]:
        return None
    if len(places) > 1:
        raise BundleError(
            f"{(folders or places)[0]}: a bundle stands alone; name one bundle, or only pictures"
        )
    return places[0].parent if places[0].suffix.lower() == ".json" else places[0]


def _is_meant_as_bundle(place: Path) -> bool:
    missing = not place.suffix and not place.exists()  # the bundle's reader says so
    return missing or place.is_dir() or place.suffix.lower() == ".json"


def _pictures(
    places: list[Path], bundle: Path | None, printer: Printer
) -> list[tuple[str, Picture]]:
    """Return label file name and foreground of every picture."""
    from toonset.dataset.picture import load_rgba
    from toonset.dataset.transforms import picture_paths
    from toonset.errors import BundleError

    paths = places if bundle is None else list(picture_paths(places[0]))
    names = [f"{path.stem if bundle else format(i, '03d')}.png" for i, path in enumerate(paths)]
    if len(set(names)) < len(names):
        raise BundleError(f"{places[0]}: two pictures have the same file name; rename one")
    return [
        (name, _foreground(load_rgba(path), path, printer))
        for name, path in zip(names, paths, strict=True)
    ]


def _foreground(picture: Picture, path: Path, printer: Printer) -> Picture:
    """Return the picture with its plain background made transparent, if it is opaque."""
    import numpy as np

    from toonset.dataset.sheet import split_sheet
    from toonset.errors import SheetError

    if (picture[..., 3] < 255).any():
        return picture
    try:
        sheet = split_sheet(picture)
    except SheetError as error:
        printer.say(f"{path.name}: every pixel counts as the character's ({error})")
        return picture
    whole = np.zeros_like(picture)
    for view in sheet.views:
        x, y, width, height = view.box
        window = whole[y : y + height, x : x + width]
        window[view.rgba[..., 3] > 0] = view.rgba[view.rgba[..., 3] > 0]
    return whole


def _choose(pictures: list[Picture], colors: str | None, min_share: float) -> Palette:
    from toonset.palette.choice import PaletteOptions
    from toonset.palette.extract import extract_palette, pick_palette
    from toonset.palette.files import parse_colors

    if colors is not None:
        return pick_palette(pictures, parse_colors(colors))
    return extract_palette(pictures, PaletteOptions(min_share=min_share))


def _report(found: Palette, target: Path, printer: Printer) -> None:
    from toonset.palette.files import to_json
    from toonset.palette.names import hex_of

    for warning in found.warnings:
        printer.say(warning)
    lines = [
        f"{hex_of(color.rgb)}  {HUNDRED * color.share:5.1f} %  {color.name}"
        for color in found.colors
    ]
    if found.dropped:
        lines.append("left out (with the mean OKLab error that this costs their pixels):")
        lines += [
            f"{hex_of(color.rgb)}  {HUNDRED * color.share:5.1f} %  {color.name}  {color.cost:.3f}"
            for color in found.dropped
        ]
    lines.append(str(target))
    printer.result({"out": target, **to_json(found)}, "\n".join(lines))
