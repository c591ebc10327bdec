"""Define the options of a palette: how its colours are chosen. Imports nothing heavy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from toonset.errors import PaletteError, UsageError
from toonset.options import Option, described

MAX_COLORS = 255  # a label is one byte, and 255 means unlabelled
CHOICE_PANEL = "Choice of colours"


@described
@dataclass(frozen=True)
class PaletteOptions:
    """How the colours of a palette are chosen."""

    colors: Annotated[
        str | None, Option("Your own: '#aabbcc,#123,white', or a palette file.", panel=CHOICE_PANEL)
    ] = None
    swatches: Annotated[
        bool | None,
        Option(
            "The palette that the sheet prints, as it is (default: where it fits the paint).",
            flag="--swatches/--no-swatches",
            panel=CHOICE_PANEL,
        ),
    ] = None
    min_share: Annotated[
        float, Option("Least share of the character's pixels.", panel=CHOICE_PANEL)
    ] = 0.05
    max_colors: Annotated[int, Option("At most so many, the largest.", panel=CHOICE_PANEL)] = (
        MAX_COLORS
    )
    keep: Annotated[
        str,
        Option(
            "Keep these of the left-out colours: '#aabbcc,...'.",
            metavar="COLOURS",
            panel=CHOICE_PANEL,
        ),
    ] = ""
    contour: Annotated[
        bool,
        Option(
            "Count drawn lines to their colour; without, only what is painted with it.",
            flag="--contour/--no-contour",
            panel=CHOICE_PANEL,
        ),
    ] = True
    features: Annotated[
        bool | None,
        Option(
            "Keep eyes, mouths, buttons under that share (default: keep).",
            flag="--features/--no-features",
            panel=CHOICE_PANEL,
        ),
    ] = None

    def __post_init__(self) -> None:
        """Refuse shares and numbers without a meaning, and what contradicts itself.

        Raises:
            PaletteError: out of range.
            UsageError: `colors` is the whole palette, and others speak of colours, too.
        """
        if not 0 <= self.min_share <= 1:
            raise PaletteError(
                f"--min-share: {self.min_share:g} is no share; give 0 to 1, as 0.05 for 5 %"
            )
        if not 1 <= self.max_colors <= MAX_COLORS:
            raise PaletteError(
                f"--max-colors: {self.max_colors} colours; give 1 to {MAX_COLORS}, as many as a "
                "label can name"
            )
        if self.swatches is not None and self.colors is not None:
            raise UsageError("--colors is the whole palette; leave --swatches away")
        if self.keep and self.colors is not None:
            raise UsageError("--colors is the whole palette; leave --keep away")
