"""`toonset split`: a sheet to its views, shown so that a person can see and correct the cut."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toonset.cli.common.cutting import (
    CORRECTIONS_PANEL,
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
    check_output,
)
from toonset.cli.common.sheet_inputs import Drawings, check_label_count, load_drawings

if TYPE_CHECKING:
    from toonset.dataset.split_folder.panel import Panel
    from toonset.dataset.split_folder.views import Source, Split

WRITTEN = ("images", "split.json", "overlay.png")
DOUBTFUL = 3  # exit code: files are written, but a person should look


def split(
    sheets: Annotated[
        list[Path],
        typer.Argument(
            metavar="SHEET",
            help="Character sheets, files of one view each, or folders of them.",
        ),
    ],
    boxes: BoxesOption = None,
    grid: GridOption = "",
    background: BackgroundOption = "",
    drop: DropOption = "",
    labels: Annotated[
        str,
        typer.Option(
            "--views", metavar="LABELS", help=LABELS_HELP, rich_help_panel=CORRECTIONS_PANEL
        ),
    ] = "",
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder.", rich_help_panel=OUTPUT_PANEL)
    ] = Path("views"),
    force: ForceFlag = False,
    as_json: JsonFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Cut the figures out of a sheet, and show what was found.

    Writes images/, split.json and overlay.png, the sheet with numbered boxes: look at it, correct
    with the options below or in images/ itself (delete, rename, repaint), and give the folder to
    `toonset calibrate`. Exit code 3 when something is doubtful; the files are written then too.
    """
    cutting = Cutting(boxes, drop, background, grid)
    cutting.check_usage()
    printer = Printer(as_json, quiet)
    check_output(out, [*sheets, boxes], WRITTEN, force=force)
    drawings = load_drawings(sheets, cutting, printer)
    named = _labelled(drawings, labels)
    doubts = drawings.doubts
    _write(out, named, drawings, cutting, doubts, force=force)
    _say(named, cutting, doubts, out, printer)
    if doubts:
        raise typer.Exit(DOUBTFUL)


def _labelled(drawings: Drawings, text: str) -> Split:
    """Return the views with the labels of --views, else with those that they have.

    Raises:
        SheetError: not one label per view, or a word that is no direction.
    """
    from dataclasses import replace

    from toonset.calib.view_labels import parse_labels

    if not text:
        return drawings.split
    check_label_count(text, drawings)
    parse_labels(text, len(drawings.split.views))
    words = [word.strip() for word in text.split(",")]
    return replace(drawings.split, labels=tuple("" if word == "?" else word for word in words))


def _write(
    out: Path,
    named: Split,
    drawings: Drawings,
    cutting: Cutting,
    doubts: tuple[str, ...],
    *,
    force: bool,
) -> None:
    from toonset.dataset.split_folder.overlay import draw_split
    from toonset.dataset.split_folder.write import write_split

    overlay = draw_split(_panels(named, drawings), doubts)
    write_split(out, named, overlay, cutting.as_options(), force=force)


def _panels(named: Split, drawings: Drawings) -> list[Panel]:
    """Return the sheets for the overlay; a view whose sheet is not at hand stands alone."""
    from dataclasses import replace

    from toonset.dataset.split_folder.panel import Panel

    panels = []
    for index, (source, picture) in enumerate(zip(named.sources, drawings.pictures, strict=True)):
        mine = [i for i, of in enumerate(named.source_of) if of == index]
        views, labels = [named.views[i] for i in mine], [named.labels[i] for i in mine]
        if picture is not None:
            ground = source.background
            panels.append(
                Panel(source.name, picture, ground, tuple(views), tuple(labels), source.left_out)
            )
            continue
        for view, label in zip(views, labels, strict=True):
            alone = replace(view, box=(0, 0, *view.box[2:]))
            panels.append(Panel(source.name, view.rgba, None, (alone,), (label,)))
    return panels


def _say(
    named: Split, cutting: Cutting, doubts: tuple[str, ...], out: Path, printer: Printer
) -> None:
    from toonset.dataset.split_folder.write import split_dict

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
        for remark in source.remarks:
            printer.say(f"  {remark}")
    for doubt in doubts:
        printer.doubt(f"look: {doubt}")
    if cutting.drop:
        printer.say("views are numbered anew; --drop counts as in the overlay without it")
    printer.say(f"look at {out / 'overlay.png'}")
    printer.result({"folder": out, **split_dict(named, cutting.as_options())}, str(out))


def _source_line(source: Source) -> str:
    from toonset.palette.names import hex_of

    width, height = source.size_wh
    ground = "transparent"
    if source.background is not None:
        ground = f"background {hex_of(source.background)}"
    return f"{source.name}: {width} x {height} px, {ground}"
