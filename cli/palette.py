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
)
from toonset.write import check_output

if TYPE_CHECKING:
    from toonset.palette.palette import DroppedColor, Evidence, Palette, PaletteColor

WRITTEN = ("palette.json", "palette.gpl", "palette.ase", "palette.hex", "palette.png")
FOLDERS = ("labels", "tones", "contours")
BUNDLE, OUT = Path("bundle"), Path("palette")
CHOICE_PANEL = "Choice of colours"
HUNDRED = 100.0
MOST_NAMED = 6  # left-out colours; more are counted
PIXELS = 4096  # for which the evidence counts bits
LEAST_BITS = 1.0  # less decides nothing
LEAST_SHARE = 0.0005  # what rounds to 0.1 %


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
    features: Annotated[
        bool | None,
        typer.Option(
            "--features/--no-features",
            help="Keep eyes, mouths, buttons under that share (default: on shaded sheets).",
            rich_help_panel=CHOICE_PANEL,
            show_default=False,
        ),
    ] = None,
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

    Writes palette.json, .gpl, .ase, .hex, .png, labels/, contours/ and, for shaded sheets, tones/
    into the bundle, replacing those of an earlier run; for images and other folders, or with -o,
    into a folder of their own.
    """
    from toonset.dataset.bundle.palette_files import write_labelled
    from toonset.dataset.split_folder.pictures import bundle_of, load_pictures
    from toonset.palette.extract import choose_palette, options_of
    from toonset.palette.pixels.ink_lines import find_contour
    from toonset.write import new_folder

    printer = Printer(as_json, quiet, verbose)
    places = inputs or [BUNDLE]
    bundle = bundle_of(places)
    target = out or bundle or OUT
    if target != bundle:
        check_output(target, places, (*WRITTEN, *FOLDERS), force=force)
    options = options_of(min_share, max_colors, keep, contour=contour, features=features)
    drawn = load_pictures(places)
    for note in drawn.notes:
        printer.say(note)
    contours = [find_contour(picture) for picture in drawn.pictures]
    found = choose_palette(drawn.pictures, contours, options, colors, method)
    with nullcontext(target) if target == bundle else new_folder(target, force=force) as folder:
        write_labelled(folder, found, drawn.names, drawn.pictures, contours, space)
    _report(found, target, printer, in_bundle=target == bundle)


def _report(found: Palette, target: Path, printer: Printer, *, in_bundle: bool) -> None:
    from toonset.palette.formats.json import to_json

    for warning in found.warnings:
        printer.say(warning)
    after = f"; next: toonset train {target}" if in_bundle else ""
    lines = palette_lines(found, verbose=printer.verbose)
    text = "\n".join([*lines, f"{target}: look at palette.png{after}"])
    printer.result({"out": target, **to_json(found)}, text)


def palette_lines(found: Palette, *, verbose: bool) -> list[str]:
    """Return a line per colour, then what is left out; if verbose, the rule and the evidence."""
    lines = [_color_line(color, found) for color in found.colors]
    if not verbose:
        return [*lines, *_left_out(found)]
    lines.append(f"shares are of all the character's pixels; rule: {found.rule}")
    if found.shadow is not None:
        factor = ", ".join(f"{value:.2f}" for value in found.shadow.factor)
        lines.append(f"shadow: colours in light times {factor}; colours are those in light")
    lines += _contour_lines(found)
    if found.dropped:
        lines.append("left out (with the mean OKLab error that this costs, and the largest patch):")
        lines += [_dropped_line(color, found) for color in found.dropped]
    if found.evidence is not None:
        lines.append(_evidence_line(found.evidence))
    return lines


def _color_line(color: PaletteColor, found: Palette) -> str:
    """Return a colour's line, with how much of it lies in shadow, and whether it is a feature."""
    notes = [f"{HUNDRED * dark.share:.1f} % in shadow" for dark in color.tones[1:]]
    notes += ["feature"] if color.rgb in found.features else []
    return _line(color.rgb, color.share, color.name) + (f" ({', '.join(notes)})" if notes else "")


def _left_out(found: Palette) -> list[str]:
    from toonset.palette.names import hex_of

    if not found.dropped:
        return []
    names = [f"{hex_of(color.rgb)} {color.name}" for color in found.dropped[:MOST_NAMED]]
    more = [f"{len(found.dropped) - MOST_NAMED} more"] if len(found.dropped) > MOST_NAMED else []
    first = hex_of(found.dropped[0].rgb)
    return [f"left out by the rule: {', '.join([*names, *more])} (--keep '{first}' keeps one)"]


def _evidence_line(evidence: Evidence) -> str:
    """Return why so many colours: with them the drawing is described most briefly."""
    number = evidence.colors
    others = [_other_number(number + 1, evidence.one_more)]
    if number > 1:
        others.insert(0, _other_number(number - 1, evidence.one_less))
    colors = "1 colour describes" if number == 1 else f"{number} colours describe"
    return f"{colors} the drawing most briefly; {', '.join(others)} (bits per {PIXELS:,} pixels)"


def _other_number(number: int, more_bits: float) -> str:
    if more_bits < LEAST_BITS:
        return f"{number} would do nearly as well, a close call"
    return f"{number} would take {more_bits:.0f} bits more"


def _contour_lines(found: Palette) -> list[str]:
    from toonset.palette.names import hex_of

    ink = found.contour
    if ink is None:
        return []
    kept = ink.rgb in [color.rgb for color in found.colors]
    return [
        f"lines: {hex_of(ink.rgb)}, {HUNDRED * ink.share:.1f} % of the character; without lines "
        f"{HUNDRED * ink.cloth:.1f} % {'' if kept else '(left out) '}has this colour"
    ]


def _dropped_line(color: DroppedColor, found: Palette) -> str:
    line = f"{_line(color.rgb, color.share, color.name)}  {color.cost:.3f}"
    if color.place is not None:
        x, y, width, height = color.place.box
        line += f"  picture {color.place.view} at ({x}, {y}), {width} x {height} px"
    return line + _like(color, found)


def _like(color: DroppedColor, found: Palette) -> str:
    """Return what colour of the palette a left-out one looks like; "" if it does not."""
    import numpy as np

    from toonset.palette.colors import JUST_NOTICEABLE
    from toonset.palette.names import hex_of
    from toonset.palette.pixels.labels import nearest_colors

    if color.cost > JUST_NOTICEABLE:
        return ""
    number = int(nearest_colors(np.array([color.rgb], dtype=np.uint8), found.rgb)[0])
    return f", looks like {hex_of(found.colors[number].rgb)} and is counted as that, too"


def _line(rgb: tuple[int, int, int], share: float, name: str) -> str:
    from toonset.palette.names import hex_of

    percent = f"{HUNDRED * share:5.1f}" if share >= LEAST_SHARE else "< 0.1"
    return f"{hex_of(rgb)}  {percent} %  {name}"
