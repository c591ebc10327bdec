"""What a sheet has beside its views: patches left out, printed colours, groups of equal figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from toonset.dataset.split.figures.blobs import as_box
from toonset.dataset.split.figures.text_and_swatches import words
from toonset.dataset.split.segment import SheetLayout
from toonset.palette.palette import Hex

Length = Annotated[int, Field(strict=True, ge=1, le=10**6)]  # pixels, as split.json may have them
Place = Annotated[int, Field(strict=True, ge=0, le=10**6)]
InSheet = tuple[Place, Place, Length, Length]

LISTED = 0.02  # of the merit of the likeliest turnaround: groups with less are props
NAMES = {
    "text": "text beside the figures was",
    "swatch": "patches of plain colour were",
    "mark": "strokes beside the figures were",
    "study": "smaller drawings were",
    "speck": "small patches that belong to no figure were",
}


@dataclass(frozen=True)
class LeftOut:
    """A patch of the sheet that is not a view.

    Attributes:
        box: (x, y, width, height) in the sheet.
        kind: "text", "frame", "swatch", "study" (a head, a prop, a small extra drawing), "mark"
            (an arrow, a rule) or "speck".
    """

    box: InSheet
    kind: Annotated[str, Field(max_length=40)]


@dataclass(frozen=True)
class Swatch:
    """A colour of the palette that a sheet prints.

    Attributes:
        box: (x, y, width, height) in the sheet.
        color: 8-bit sRGB.
    """

    box: InSheet
    color: Hex


@dataclass(frozen=True)
class FigureGroup:
    """Equal figures of a sheet: a turnaround, or a row of busts, poses or props.

    Attributes:
        rows: (x, y, width, height) in the sheet of the figures of every row, from the top.
        why: what speaks for it, for people.
        likely: what speaks for it as a turnaround, beside the likeliest group: 0 to 1.
        outfits: its rows show the same directions, so in other clothes.
        taken: its figures are the views.
    """

    rows: tuple[tuple[InSheet, ...], ...]
    why: Annotated[str, Field(max_length=200)]
    likely: Annotated[float, Field(ge=0, le=1)]
    outfits: bool = False
    taken: bool = False


def left_out_of(found: SheetLayout) -> tuple[LeftOut, ...]:
    """Return the patches that are not views, words as one each."""
    boxes = [(box, "frame") for box in found.lines]
    kinds = np.array(found.grouping.kinds, dtype=object)
    for kind in NAMES:
        own = found.blobs.boxes[kinds == kind]
        boxes += [(as_box(box), kind) for box in (words(own) if kind == "text" else own)]
    cell = found.cell_px
    return tuple(
        LeftOut((x * cell, y * cell, width * cell, height * cell), kind)
        for (x, y, width, height), kind in boxes
    )


def swatches_of(found: SheetLayout) -> tuple[Swatch, ...]:
    """Return the colours of the palette that the sheet prints."""
    printed, cell = found.grouping.printed, found.cell_px
    return tuple(
        Swatch((x * cell, y * cell, width * cell, height * cell), (red, green, blue))
        for (x, y, width, height), (red, green, blue) in zip(
            printed.boxes.tolist(), printed.rgb.tolist(), strict=True
        )
    )


def groups_of(found: SheetLayout) -> tuple[FigureGroup, ...]:
    """Return the groups of figures without props and single drawings, in order."""
    cell, most = found.cell_px, max((group.merit for group in found.groups), default=1.0)
    worth = [len(one.members) > 1 and one.merit >= LISTED * most for one in found.groups]
    shown = max(1, found.taken.group + 1, sum(worth[1:]) + 1)

    def in_sheet(box: np.ndarray) -> InSheet:
        x, y, width, height = (int(value) * cell for value in box)
        return x, y, width, height

    listed = []
    for number, group in enumerate(found.groups[:shown]):
        figures, rows = len(group.members), len(group.rows)
        why = f"{figures} figure{'s' * (figures > 1)}" + (f" in {rows} rows" if rows > 1 else "")
        why += f", {group.height * cell:.0f} px high"
        if len(found.groups) > 1 and figures > 1:
            why += f", outlines {100 * group.likeness**0.5:.0f} % alike"
        boxes = tuple(tuple(map(in_sheet, found.blobs.boxes[row])) for row in group.rows)
        listed.append(
            FigureGroup(boxes, why, group.merit / most, group.outfits, number == found.taken.group)
        )
    return tuple(listed)
