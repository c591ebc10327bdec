"""Match corrections to a sheet's views by their boxes.

A view is found again by its box, whatever its number has become: of all pairs the one that overlaps
most comes first, each box and each view once, and less than half is not a match.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from toonset.dataset.split_folder.boxes import check_boxes
from toonset.dataset.split_folder.corrections import (
    Corrections,
    SheetName,
    ViewCorrection,
    parse_corrections,
    read_corrections,
)
from toonset.dataset.split_folder.pictures import Picture, Place
from toonset.dataset.split_folder.views import Split, without
from toonset.errors import SheetError, UsageError
from toonset.palette.corrections import Stroke
from toonset.view import Box, InputFile, View, visible_box

LEAST_OVERLAP = 0.5  # intersection over union


@dataclass(frozen=True)
class Given:
    """A file of corrections with its content.

    Attributes:
        path: of the file.
        content: what it says.
    """

    path: Path
    content: Corrections

    @classmethod
    def of(cls, path: str | Path) -> Given:
        """Return the file's corrections; see `read_corrections` for what is refused."""
        return cls(Path(path), read_corrections(path))

    @classmethod
    def parsed(cls, data: bytes, where: str) -> Given:
        """Return the corrections of a file's content; see `parse_corrections`."""
        return cls(Path(where), parse_corrections(data, where))

    def check_beside(self, **options: object) -> None:
        """Refuse options that say what the corrections say.

        Args:
            options: by their name on the command line, as given; empty: not given.

        Raises:
            UsageError: both say where figures are, what is left out, or what views show.
        """
        key = self.content.figures_key
        said = {
            **dict.fromkeys(("boxes", "grid", "group", "outfit"), (key, key)),
            "background": ("background", self.content.background),
            "drop": ("views.exclude", any(view.exclude for view in self.content.views)),
            "views": ("views.label", any(view.label for view in self.content.views)),
            "front": ("views.label", any(view.label for view in self.content.views)),
            "landmarks": ("views.landmarks", any(view.landmarks for view in self.content.views)),
            "keep": ("palette.keep", self.content.palette.keep),
            "init": ("views.camera", any(view.camera or view.lock for view in self.content.views)),
        }
        for name, value in options.items():
            key, own = said[name]
            if own and value:
                raise UsageError(f"{self.path}: {key} and --{name} say the same thing; drop one")

    def number_of_sheet(self, sheets: Sequence[InputFile]) -> int:
        """Return which of several sheets is corrected.

        Raises:
            SheetError: it is none of them, or the file does not say.
        """
        if len(sheets) == 1:
            return 0
        wanted = self.content.sheet or SheetName()
        for same in (
            [i for i, one in enumerate(sheets) if one.sha256 == wanted.sha256],
            [i for i, one in enumerate(sheets) if one.name == wanted.name],
        ):
            if len(same) == 1:
                return same[0]
        raise SheetError(
            f"{self.path}: sheet: {wanted.name[:60]!r} is none of the {len(sheets)} sheets, or "
            "several; name the one that was corrected"
        )

    def applied(self, split: Split) -> tuple[Split, tuple[str, ...]]:
        """Return the views labelled and those that are excluded left out, and notes for people.

        Raises:
            SheetError: another sheet, a box beside it, or no view is left.
        """
        sheets = [InputFile("sheet", source.name, source.sha256) for source in split.sources]
        number = self.number_of_sheet(sheets)
        notes = self._check_sheet(split, number)
        own = [i for i, of in enumerate(split.source_of) if of == number]
        wanted = self.content.views
        pairs = self.matched([split.views[i] for i in own], wanted)
        views = list(split.views)
        for at, entry in pairs.items():
            if wanted[entry].label:
                views[own[at]] = replace(views[own[at]], label=wanted[entry].label)
        lost = [i for i in range(len(wanted)) if i not in pairs.values()]
        notes += [
            f"{self.path.name}: views.{i}, box {list(wanted[i].box)}, is no figure of this split: "
            "ignored"
            for i in lost
        ]
        dropped = frozenset(own[at] for at, entry in pairs.items() if wanted[entry].exclude)
        if len(dropped) == len(views):
            raise SheetError(f"{self.path}: views.exclude leaves no view; keep at least one")
        return without(replace(split, views=tuple(views)), dropped), tuple(notes)

    def of_views(self, views: Sequence[View]) -> tuple[ViewCorrection | None, ...]:
        """Return each view's correction; None without one.

        Args:
            views: of one or more sheets, without those that are excluded.
        """
        sheets = list(dict.fromkeys(view.sheet for view in views if view.sheet is not None))
        sheet = sheets[self.number_of_sheet(sheets)] if sheets else None
        own = [i for i, view in enumerate(views) if view.sheet == sheet]
        wanted = [view for view in self.content.views if not view.exclude]
        found: list[ViewCorrection | None] = [None] * len(views)
        for at, entry in self.matched([views[i] for i in own], wanted).items():
            found[own[at]] = wanted[entry]
        return tuple(found)

    def strokes_on(
        self, pictures: Sequence[Picture], places: Sequence[Place | None]
    ) -> tuple[list[list[tuple[int, Stroke]]], tuple[str, ...]]:
        """Return every picture's strokes, with their numbers and in its pixels; and notes.

        Args:
            pictures: of one or more sheets, sRGB with straight alpha.
            places: where they lie there.
        """
        strokes = self.content.palette.strokes
        found: list[list[tuple[int, Stroke]]] = [[] for _ in pictures]
        sheets = list(dict.fromkeys(place.sheet for place in places if place))
        boxes = list(dict.fromkeys(stroke.box for stroke in strokes))
        picture_of: dict[Box, tuple[int, Box]] = {}
        if strokes and sheets:
            sheet = sheets[self.number_of_sheet(sheets)]
            own = [(i, at.box) for i, at in enumerate(places) if at and at.sheet == sheet]
            figures = [(box, visible_box(pictures[i], box)) for i, box in own]
            whole = {box: [one for one in own if _around(box, [one[1]])] for box in boxes}
            picture_of = {box: on[0] for box, on in whole.items() if len(on) == 1}
            picture_of |= {boxes[j]: own[i] for i, j in match_boxes(figures, boxes).items()}
        for number, stroke in enumerate(strokes):
            if stroke.box in picture_of:
                i, (x, y, _, _) = picture_of[stroke.box]
                points = tuple((u - x, v - y) for u, v in stroke.points)
                found[i].append((number, replace(stroke, points=points)))
        lost = f"{self.path.name}: palette.strokes, box {{}}, is no figure of this split: ignored"
        return found, tuple(lost.format(list(box)) for box in boxes if box not in picture_of)

    def matched(self, views: Sequence[View], wanted: Sequence[ViewCorrection]) -> dict[int, int]:
        """Return which entry of `wanted` speaks of which view, by their numbers."""
        figures = [
            (view.figure_box, view.box, *_around(view.figure_box, self.content.boxes))
            for view in views
        ]
        return match_boxes(figures, [entry.box for entry in wanted])

    def _check_sheet(self, split: Split, number: int) -> list[str]:
        """Refuse another sheet; return a note of one that has changed."""
        source, wanted = split.sources[number], self.content.sheet or SheetName()
        check_boxes(
            [view.box for view in self.content.views], source.size_wh, f"{self.path}: views"
        )
        if wanted.sha256 in ("", source.sha256):
            return []
        if wanted.size not in (None, source.size_wh):
            raise SheetError(
                f"{self.path}: sheet: is of {wanted.name[:60]!r}, {wanted.size[0]} x "
                f"{wanted.size[1]} px, not of {source.name}, {source.size_wh[0]} x "
                f"{source.size_wh[1]} px; give the sheet that was corrected"
            )
        return [f"{self.path.name}: {source.name} has changed since it was corrected"]


def match_boxes(found: Sequence[Sequence[Box]], wanted: Sequence[Box]) -> dict[int, int]:
    """Return pairs (number in `found` -> number in `wanted`), the greatest overlap first.

    Args:
        found: (x, y, width, height) of every figure, perhaps several ways to draw its box.
        wanted: boxes to find among them.
    """
    overlaps = [
        (max(overlap(box, one) for box in boxes), i, j)
        for i, boxes in enumerate(found)
        for j, one in enumerate(wanted)
    ]
    pairs: dict[int, int] = {}
    for share, i, j in sorted(overlaps, key=lambda one: -one[0]):
        if share >= LEAST_OVERLAP and i not in pairs and j not in pairs.values():
            pairs[i] = j
    return pairs


def overlap(a: Box, b: Box) -> float:
    """Return intersection over union of two boxes."""
    wide = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    high = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    shared = max(wide, 0) * max(high, 0)
    return shared / (a[2] * a[3] + b[2] * b[3] - shared)


def _around(figure: Box, boxes: Sequence[Box]) -> list[Box]:
    """Return the boxes drawn by hand that hold a figure."""
    x, y, width, height = figure
    return [
        box
        for box in boxes
        if box[0] <= x
        and box[1] <= y
        and x + width <= box[0] + box[2]
        and y + height <= box[1] + box[3]
    ]
