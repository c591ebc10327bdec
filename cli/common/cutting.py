"""What a person says about how a sheet is cut: options that `split` and `calibrate` share."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

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
LABELS_HELP = (
    "What each view shows, in sheet order: front,3q,side,back ..., yaws in degrees, ? if unknown."
)

MOST_CELLS = 1000  # a sheet of letters or a tile map is no character sheet


@dataclass(frozen=True)
class Cutting:
    """How sheets are cut, as typed.

    Attributes:
        boxes: file of --boxes.
        drop: numbers of --drop.
        background: colour of --background.
        grid: columns and rows of --grid.
    """

    boxes: Path | None = None
    drop: str = ""
    background: str = ""
    grid: str = ""

    def check_usage(self) -> None:
        """Refuse what contradicts itself or cannot be understood, before any file is read.

        Raises:
            BadParameter: both --boxes and --grid.
            SheetError: a word that is no number, colour or grid.
        """
        if self.boxes is not None and self.grid:
            raise typer.BadParameter("--boxes and --grid both say where the figures are; drop one")
        _ = self.dropped, self.background_rgb, self.cells

    @property
    def dropped(self) -> frozenset[int]:
        """Return the numbers of --drop."""
        return frozenset(n for word in _words(self.drop) for n in _drop_range(word))

    @property
    def background_rgb(self) -> tuple[int, int, int] | None:
        """Return the colour of --background; None to find it."""
        from toonset.errors import PaletteError, SheetError
        from toonset.palette.formats.typed import rgb_of_typed

        word = self.background.strip().lower()
        if not word:
            return None
        try:
            return rgb_of_typed(word, "--background")
        except PaletteError as error:
            raise SheetError(
                f"--background: {self.background!r} is no colour; write '#rrggbb', white or black"
            ) from error

    @property
    def cells(self) -> tuple[int, int] | None:
        """Return the columns and rows of --grid."""
        from toonset.errors import SheetError

        word = self.grid.strip().lower()
        if not word:
            return None
        match = re.fullmatch(r"([0-9]{1,4})(?:x([0-9]{1,4})?)?", word)
        columns, rows = (int(match[1]), int(match[2] or 1)) if match else (0, 0)
        if not 1 <= columns * rows <= MOST_CELLS:
            raise SheetError(
                f"--grid: {self.grid!r} is no grid of 1 to {MOST_CELLS} cells; write columns x "
                "rows, as in 8x1"
            )
        return columns, rows

    @property
    def given(self) -> tuple[str, ...]:
        """Return the names of the options that say how a sheet is cut."""
        named = {"--boxes": self.boxes, "--background": self.background, "--grid": self.grid}
        return tuple(name for name, value in named.items() if value)

    def as_options(self) -> dict[str, Any]:
        """Return what is kept of it beside the results; only what was given."""
        named = {
            "boxes": self.boxes.name if self.boxes else "",
            "drop": self.drop,
            "background": self.background,
            "grid": self.grid,
        }
        return {name: value for name, value in named.items() if value}


def _words(text: str) -> list[str]:
    return [word for word in re.split(r"[,;\s]+", text) if word]


def _drop_range(word: str) -> range:
    """Return the numbers of "3", "003.png" or "3-5"."""
    from toonset.errors import SheetError

    match = re.fullmatch(r"([0-9]{1,4})(?:\.png)?(?:-([0-9]{1,4}))?", word)
    if not match:
        raise SheetError(f"--drop: {word!r} is no number of a view; write them as in 3,5 or 3-5")
    first, last = int(match[1]), int(match[2] or match[1])
    if last < first:
        raise SheetError(f"--drop: {word!r} ends before it starts; write {last}-{first}")
    return range(first, last + 1)
