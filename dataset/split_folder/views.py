"""Join the views of one or more sheets, with where each was cut from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Annotated

from pydantic import Field

from toonset.dataset.split.beside_views import FigureGroup, LeftOut, Length, Swatch
from toonset.dataset.split.sheet import Segmentation
from toonset.palette.palette import Hex
from toonset.view import View

DROPPED = "dropped"  # what was left out by hand


@dataclass(frozen=True)
class Source:
    """A picture that views were cut from, as split.json has it, too.

    Attributes:
        name: its file name.
        sha256: of the file.
        size_wh: pixels.
        background: its colour; None where it is transparent.
        warnings: what was doubtful in it, for people.
        left_out: what was seen in it but is not a view.
        remarks: what was done besides, for people.
        swatches: of the palette that it prints, in reading order.
        groups: of equal figures, the likeliest turnaround first.
    """

    name: str
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    size_wh: tuple[Length, Length]
    background: Hex | None = None
    warnings: tuple[str, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    remarks: tuple[str, ...] = ()
    swatches: tuple[Swatch, ...] = ()
    groups: tuple[FigureGroup, ...] = ()


@dataclass(frozen=True, eq=False)
class Split:
    """The views of one or more sheets.

    Attributes:
        sources: the sheets.
        views: in order, named 000.png, 001.png, ...
        source_of: per view, the position of its sheet in `sources`.
    """

    sources: tuple[Source, ...]
    views: tuple[View, ...]
    source_of: tuple[int, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """Return per view what it shows ("front", "90"); "" where no label or caption says."""
        return tuple(view.shows for view in self.views)


def split_of_sheet(name: str, data: bytes, size_wh: tuple[int, int], sheet: Segmentation) -> Split:
    """Return one sheet's views as a split.

    Args:
        name: the sheet's file name.
        data: the file.
        size_wh: the picture's size.
        sheet: what was found in it.
    """
    digest = sha256(data).hexdigest()
    source = Source(
        *(name, digest, size_wh, sheet.background, sheet.warnings, sheet.left_out),
        *(sheet.remarks, sheet.swatches, sheet.groups),
    )
    return Split((source,), sheet.views, (0,) * len(sheet.views))


def join_splits(parts: Sequence[Split]) -> Split:
    """Return several splits as one, views numbered through."""
    sources: list[Source] = []
    views: list[View] = []
    source_of: list[int] = []
    for part in parts:
        source_of += [index + len(sources) for index in part.source_of]
        sources += part.sources
        views += part.views
    return Split(tuple(sources), numbered(views), tuple(source_of))


def without(split: Split, dropped: frozenset[int]) -> Split:
    """Return the split without some views, the others numbered anew.

    A dropped view stays on record as something that was left out of its sheet.
    """
    sources = list(split.sources)
    for number in sorted(dropped):
        index = split.source_of[number]
        left = LeftOut(split.views[number].figure_box, DROPPED)
        sources[index] = replace(sources[index], left_out=(*sources[index].left_out, left))
    kept = [number for number in range(len(split.views)) if number not in dropped]
    return Split(
        tuple(sources),
        numbered([split.views[number] for number in kept]),
        tuple(split.source_of[number] for number in kept),
    )


def numbered(views: Sequence[View]) -> tuple[View, ...]:
    """Return the views named 000.png, 001.png, ..."""
    return tuple(replace(view, name=f"{number:03d}.png") for number, view in enumerate(views))
