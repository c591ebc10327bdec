"""Define the options of a sheet: how it is cut, as a person types it. Imports nothing heavy."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from toonset.errors import PaletteError, SheetError, UsageError
from toonset.options import Option, described

if TYPE_CHECKING:
    from toonset.dataset.split.figures.rows import Taken

FIGURES_PANEL = "Where the figures are"  # of the help
LABELS = Option(
    "What each view shows, in sheet order: front,3q,side,back ..., yaws in degrees, ? if unknown.",
    flag="--views",
    metavar="LABELS",
    panel=FIGURES_PANEL,
)
CORRECTIONS = Option(
    "What a person corrected: the corrections.json of `toonset edit`, or by hand.",
    metavar="FILE",
    panel=FIGURES_PANEL,
)
MOST_CELLS = 1000  # a sheet of letters or a tile map is not a character sheet


@described
@dataclass(frozen=True)
class SheetOptions:
    """How sheets are cut into views, and what the views show."""

    boxes: Annotated[
        str | Path | None,
        Option(
            "Boxes of the figures in sheet pixels: JSON, CSV x,y,width,height, or a split.json.",
            metavar="FILE",
            panel=FIGURES_PANEL,
        ),
    ] = None
    grid: Annotated[
        str,
        Option(
            "Equal cells, columns x rows, one figure in each: 8x1. 8x is a strip of 8.",
            metavar="CxR",
            panel=FIGURES_PANEL,
        ),
    ] = ""
    background: Annotated[
        str,
        Option(
            "The paper's colour: '#rrggbb', white or black.", metavar="COLOUR", panel=FIGURES_PANEL
        ),
    ] = ""
    drop: Annotated[
        str,
        Option(
            "Leave these out, as numbered in overlay.png without --drop: 3,5 or 3-5.",
            metavar="NUMBERS",
            panel=FIGURES_PANEL,
        ),
    ] = ""
    group: Annotated[
        int | None,
        Option(
            "Another group of equal figures, as listed: 2 is the second likeliest turnaround.",
            metavar="N",
            panel=FIGURES_PANEL,
        ),
    ] = None
    outfit: Annotated[
        str,
        Option(
            "One row of the group, where rows show other clothes: A is the uppermost; all: a "
            "folder for each row.",
            metavar="LETTER",
            panel=FIGURES_PANEL,
        ),
    ] = ""
    matting: Annotated[
        str | Path | None,
        Option(
            "A network that takes figures off backdrops: u2net.onnx or another one of rembg's.",
            metavar="FILE",
            panel=FIGURES_PANEL,
        ),
    ] = None
    labels: Annotated[str, LABELS] = ""

    def check(self) -> None:
        """Refuse what contradicts itself or cannot be understood, before any file is read.

        Raises:
            UsageError: both boxes and a grid.
            SheetError: a word that is not a number, colour or grid.
        """
        if self.boxes is not None and self.grid:
            raise UsageError("--boxes and --grid both say where the figures are; drop one")
        by_hand = "--boxes" if self.boxes is not None else "--grid" if self.grid else ""
        for name, value in (("--group", self.group), ("--outfit", self.outfit)):
            if value and by_hand:
                raise UsageError(f"{by_hand} and {name} both say which figures count; drop one")
        if self.matting is not None and self.background:
            raise UsageError("--matting and --background both say what is no figure; drop one")
        _ = self.dropped, self.background_rgb, self.cells, self.taken

    @property
    def dropped(self) -> frozenset[int]:
        """Return the numbers of the views to leave out."""
        words = [word for word in re.split(r"[,;\s]+", self.drop) if word]
        return frozenset(number for word in words for number in _drop_range(word))

    @property
    def background_rgb(self) -> tuple[int, int, int] | None:
        """Return the colour of the paper; None to find it."""
        from toonset.palette.formats.hex import rgb_of_typed

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
        """Return columns and rows of the grid; None without."""
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
    def taken(self) -> Taken:
        """Return which group of figures is wanted."""
        from toonset.dataset.split.figures.rows import Taken

        if self.group is not None and self.group < 1:
            raise SheetError(f"--group: {self.group} is no group; give 1 or more")
        letter = self.outfit.strip().upper()
        if letter and not re.fullmatch("[A-Z]", letter):
            raise SheetError(
                f"--outfit: {self.outfit!r} is no row; write a letter, as in --outfit A"
            )
        row = ord(letter) - ord("A") if letter else None
        return Taken(0 if self.group is None else self.group - 1, row)

    @property
    def given(self) -> tuple[str, ...]:
        """Return the names of the options that say how a sheet is cut."""
        named = {
            "--boxes": self.boxes,
            "--background": self.background,
            "--grid": self.grid,
            "--group": self.group,
            "--outfit": self.outfit,
            "--matting": self.matting,
        }
        return tuple(name for name, value in named.items() if value)

    @property
    def names_figures(self) -> bool:
        """Return whether a person said which figures are wanted."""
        return bool(self.boxes or self.grid or self.group or self.outfit)

    def as_options(self) -> dict[str, Any]:
        """Return what is kept of it beside the results; only what was given."""
        named = {
            "boxes": Path(self.boxes).name if self.boxes else "",
            "drop": self.drop,
            "background": self.background,
            "grid": self.grid,
            "group": self.group or "",
            "outfit": self.outfit.strip().upper(),
            "matting": Path(self.matting).name if self.matting else "",
        }
        return {name: value for name, value in named.items() if value}


def _drop_range(word: str) -> range:
    """Return the numbers of "3", "003.png" or "3-5"."""
    match = re.fullmatch(r"([0-9]{1,4})(?:\.png)?(?:-([0-9]{1,4}))?", word)
    if not match:
        raise SheetError(f"--drop: {word!r} is no number of a view; write them as in 3,5 or 3-5")
    first, last = int(match[1]), int(match[2] or match[1])
    if last < first:
        raise SheetError(f"--drop: {word!r} ends before it starts; write {last}-{first}")
    return range(first, last + 1)
