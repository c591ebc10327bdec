"""Declare the options of `split` and `calibrate` that say how a sheet is cut."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

CORRECTIONS_PANEL = "Where the figures are"  # of the help
BoxesOption = Annotated[
    Path | None,
    typer.Option(
        "--boxes",
        metavar="FILE",
        help="Boxes of the figures in sheet pixels: JSON, CSV x,y,width,height, or a split.json.",
        rich_help_panel=CORRECTIONS_PANEL,
    ),
]
DropOption = Annotated[
    str,
    typer.Option(
        "--drop",
        metavar="NUMBERS",
        help="Leave these out, as numbered in overlay.png without --drop: 3,5 or 3-5.",
        rich_help_panel=CORRECTIONS_PANEL,
    ),
]
BackgroundOption = Annotated[
    str,
    typer.Option(
        "--background",
        metavar="COLOUR",
        help="The paper's colour: '#rrggbb', white or black.",
        rich_help_panel=CORRECTIONS_PANEL,
    ),
]
GridOption = Annotated[
    str,
    typer.Option(
        "--grid",
        metavar="CxR",
        help="Equal cells, columns x rows, one figure in each: 8x1. 8x is a strip of 8.",
        rich_help_panel=CORRECTIONS_PANEL,
    ),
]
GroupOption = Annotated[
    int | None,
    typer.Option(
        "--group",
        metavar="N",
        help="Another group of equal figures, as listed: 2 is the second likeliest turnaround.",
        rich_help_panel=CORRECTIONS_PANEL,
    ),
]
OutfitOption = Annotated[
    str,
    typer.Option(
        "--outfit",
        metavar="LETTER",
        help="One row of the group, where rows show other clothes: A is the uppermost; all: a "
        "folder for each row.",
        rich_help_panel=CORRECTIONS_PANEL,
    ),
]
MattingOption = Annotated[
    Path | None,
    typer.Option(
        "--matting",
        metavar="FILE",
        help="A network that takes figures off backdrops: u2net.onnx or another one of rembg's.",
        rich_help_panel=CORRECTIONS_PANEL,
    ),
]
CorrectionsOption = Annotated[
    Path | None,
    typer.Option(
        "--corrections",
        metavar="FILE",
        help="What a person corrected: the corrections.json of `toonset edit`, or by hand.",
        rich_help_panel=CORRECTIONS_PANEL,
    ),
]
LABELS_HELP = (
    "What each view shows, in sheet order: front,3q,side,back ..., yaws in degrees, ? if unknown."
)
