"""Correct a sheet's first segmentation step by step: each proposes a better one, or nothing.

`./run bench split` runs the sheets with each of them left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.dataset.split.background import difference
from toonset.dataset.split.figures.blobs import (
    Blobs,
    add_blocks,
    as_box,
    find_blobs,
    remove_strangers,
)
from toonset.dataset.split.figures.construction_lines import find_construction_lines
from toonset.dataset.split.figures.frames import PAINTED, find_frames, find_strokes
from toonset.dataset.split.figures.ground_strokes import find_ground_strokes
from toonset.dataset.split.figures.grouping import HAND, SPECK
from toonset.dataset.split.figures.open_outlines import LINE, Gap, close_outlines
from toonset.dataset.split.figures.rows import (
    LEAST_ROW,
    Group,
    Taken,
    find_groups,
    likeness,
    outline,
)
from toonset.dataset.split.figures.shadows import find_shadows
from toonset.dataset.split.touching.cut import Cut, part_touching
from toonset.raster import connected_to, dilate, parts, wider_than
from toonset.view import Box

MOST_LOST = 0.2  # of a figure that a shadow alone encloses
LEAST_LOST = 0.01  # of the same, where the shadow is mostly lines
MOST_BROAD = 0.5  # of a shadow that is mostly lines
GREY = 24  # levels between a colour's channels: ink and its soft edges have less
COLORED = 0.3  # of a figure: it is painted
SAME_POSE = 0.65  # IoU of its outline with the most like other one


@dataclass(frozen=True, eq=False)
class SheetState:
    """Segmentation of a sheet so far, in cells.

    Attributes:
        rgba: the sheet.
        ground: its background's colours; None: it is transparent.
        tolerance: noise of the background, levels.
        painted: cells that are not background.
        ring: cells at the border, where background is paper.
        ruled: cells of ruled lines and drawn frames.
        lines: their boxes.
        shadow: cells of cast shadows.
        paper: cells that the border reaches through background.
        blobs: patches of figures and other things.
        taken: which group of figures is wanted.
        bodies: numbers of the patches that are bodies of views; None: those of that group.
        cuts: where touching figures were cut apart.
        filled: cells of background within outlines that are open.
        gaps: where those are open.
    """

    rgba: UInt8[np.ndarray, "rows columns 4"]
    ground: UInt8[np.ndarray, "rows columns 3"] | None
    tolerance: int
    painted: Bool[np.ndarray, "rows columns"]
    ring: Bool[np.ndarray, "rows columns"]
    ruled: Bool[np.ndarray, "rows columns"]
    lines: tuple[Box, ...]
    shadow: Bool[np.ndarray, "rows columns"]
    paper: Bool[np.ndarray, "rows columns"]
    blobs: Blobs
    taken: Taken
    bodies: Int[np.ndarray, " bodies"] | None = None
    cuts: tuple[Cut, ...] = ()
    filled: Bool[np.ndarray, "rows columns"] | None = None
    gaps: tuple[Gap, ...] = ()

    @classmethod
    def first(
        cls,
        rgba: UInt8[np.ndarray, "rows columns 4"],
        ground: UInt8[np.ndarray, "rows columns 3"] | None,
        tolerance: int,
        painted: Bool[np.ndarray, "rows columns"],
        ring: Bool[np.ndarray, "rows columns"],
        ruled: Bool[np.ndarray, "rows columns"],
        lines: tuple[Box, ...],
        taken: Taken,
    ) -> SheetState:
        """Return what is known before anything is corrected."""
        nothing = np.zeros_like(painted)
        known = rgba, ground, tolerance, painted, ring, ruled, lines
        return cls(*known, nothing, nothing, find_blobs(nothing), taken).with_paper()

    @property
    def free(self) -> Bool[np.ndarray, "rows columns"]:
        """Return the cells that are paper if the outside reaches them."""
        free = ~self.painted | self.ruled | self.shadow
        return free if self.filled is None else free & ~self.filled

    @property
    def contrast(self) -> UInt8[np.ndarray, "rows columns"]:
        """Return the levels between every cell and the background; on transparency, its alpha."""
        if self.ground is None:
            return self.rgba[..., 3]
        return difference(self.rgba[..., :3], self.ground)

    def without_lines(self, lines: Bool[np.ndarray, "rows columns"]) -> SheetState:
        """Return the sheet with more lines taken for paper."""
        boxes = tuple(as_box(box) for box in find_blobs(lines).boxes)
        return replace(self, ruled=self.ruled | lines, lines=self.lines + boxes).with_paper()

    def with_paper(self) -> SheetState:
        """Return the sheet with its paper and patches found again."""
        paper = connected_to(self.ring, self.free)
        return replace(self, paper=paper, blobs=find_blobs(~paper))

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Return the groups of equal figures, the likeliest turnaround first."""
        return find_groups(self.blobs)

    @cached_property
    def main_blobs(self) -> Int[np.ndarray, " bodies"]:
        """Return the numbers of the patches that are bodies of views."""
        return self.taken.of(self.groups) if self.bodies is None else self.bodies


def remove_frames(state: SheetState) -> SheetState | None:
    """Propose the sheet without lines drawn round its figures, and without pieces of such lines."""
    corrected = state
    for find in (find_frames, find_strokes):
        lines = find(corrected.blobs, corrected.painted & ~corrected.ruled)
        if lines.any():
            corrected = corrected.without_lines(lines)
    return None if corrected is state else corrected


def fill_open_outlines(state: SheetState) -> SheetState | None:
    """Propose figures whose outlines have gaps, with their insides.

    Where figures are painted, sketches beside them stay as they are, and what lies between two of
    them belongs to neither.
    """
    walls, painted = state.painted & ~state.ruled, _are_painted(state)
    if painted:
        walls &= ~_specks(state)
    filled, gaps = close_outlines(walls, state.paper, state.ring)
    if gaps and painted:
        own = np.zeros_like(filled)
        for number in state.main_blobs:
            own[state.blobs.window(int(number))] = True
        own &= ~dilate(_between(state, filled), 1)
        filled, gaps = filled & own, tuple(gap for gap in gaps if own[gap.y, gap.x])
    if not gaps:
        return None
    return replace(state, filled=filled, gaps=gaps).with_paper()


def _specks(state: SheetState) -> Bool[np.ndarray, "rows columns"]:
    """Return the patches that are no piece of an outline: grain of the paper, spatter."""
    height = float(np.median(state.blobs.boxes[state.main_blobs, 3]))
    return np.append(False, state.blobs.areas <= (SPECK * height) ** 2)[state.blobs.labels]


def _between(
    state: SheetState, filled: Bool[np.ndarray, "rows columns"]
) -> Bool[np.ndarray, "rows columns"]:
    """Return the filled patches that touch two figures, or one and a drawing of its own."""
    patches = parts(filled)
    touched = np.zeros(int(patches.max(initial=0)) + 1, dtype=int)
    least = HAND * np.median(state.blobs.areas[state.main_blobs])
    for number in np.flatnonzero(state.blobs.areas > least):
        drawing = dilate(state.blobs.labels == number + 1, 1)
        touched[np.unique(patches[drawing])] += 1
    touched[0] = 0
    return np.asarray(touched[patches] > 1)


def _are_painted(state: SheetState) -> bool:
    """Return whether the figures are mostly paint broader than lines."""
    shares = []
    for number in state.main_blobs:
        mask = state.blobs.mask(int(number))
        paint = state.painted[state.blobs.window(int(number))] & mask
        broad = wider_than(paint, max(1, round(LINE * len(mask))))
        shares.append(np.count_nonzero(broad) / np.count_nonzero(mask))
    return bool(shares) and float(np.median(shares)) >= PAINTED


def remove_shadows(state: SheetState) -> SheetState | None:
    """Propose figures without the shadows that they cast, and without sketched ground."""
    if not len(state.main_blobs):  # specks alone cast none
        return None
    seen = state.rgba, state.ground, state.tolerance
    shadow = find_shadows(state.blobs, state.main_blobs, *seen)
    painted = state.painted & ~state.ruled & ~shadow
    shadow |= find_ground_strokes(state.blobs, state.main_blobs, painted, state.contrast)
    shadow = shadow & ~_outlines(state, shadow)  # a pencil's grey
    return replace(state, shadow=shadow).with_paper() if shadow.any() else None


def _outlines(
    state: SheetState, shadow: Bool[np.ndarray, "rows columns"]
) -> Bool[np.ndarray, "rows columns"]:
    """Return the shadows without which much of their figure is paper: they are its outline."""
    labels, areas = state.blobs.labels, state.blobs.areas
    paper = connected_to(state.ring, replace(state, shadow=shadow).free)
    lost = np.bincount(labels[paper & ~shadow], minlength=len(areas) + 1)[1:]
    height = float(np.median(state.blobs.boxes[state.main_blobs, 3]))
    thick = wider_than(shadow, max(1, round(LINE * height)))
    shaded, broad = (np.bincount(labels[m], minlength=len(areas) + 1)[1:] for m in (shadow, thick))
    thin = broad < MOST_BROAD * shaded
    return shadow & np.append(False, lost > np.where(thin, LEAST_LOST, MOST_LOST) * areas)[labels]


def remove_construction_lines(state: SheetState) -> SheetState | None:
    """Propose line drawings without the ends of construction lines that stick out of them."""
    if not len(state.main_blobs) or _are_painted(state):
        return None
    lines = find_construction_lines(state.blobs, state.main_blobs)
    return state.without_lines(lines) if lines.any() else None


def cut_touching_figures(state: SheetState) -> SheetState | None:
    """Propose touching figures apart."""
    painted = state.painted & ~state.ruled & ~state.shadow
    blobs, cuts = part_touching(state.blobs, state.main_blobs, painted, state.rgba[..., :3])
    return replace(state, blobs=blobs, cuts=tuple(cuts)) if cuts else None


def add_blocky_figures(state: SheetState) -> SheetState | None:
    """Propose rectangles as views that stand with the others in the same colours."""
    main_blobs = add_blocks(state.blobs, state.main_blobs, state.painted, state.rgba[..., :3])
    return replace(state, bodies=main_blobs) if len(main_blobs) > len(state.main_blobs) else None


def drop_strangers(state: SheetState) -> SheetState | None:
    """Propose fewer views: no smaller figures in other colours, no illustration.

    The first are swords as high as their bearers; an illustration is painted, in another pose,
    beside a turnaround in lines.
    """
    main_blobs = remove_strangers(state.blobs, state.main_blobs, state.painted, state.rgba[..., :3])
    main_blobs = main_blobs[~_painted_alone(state, main_blobs)]
    return replace(state, bodies=main_blobs) if len(main_blobs) < len(state.main_blobs) else None


def _painted_alone(
    state: SheetState, numbers: Int[np.ndarray, " bodies"]
) -> Bool[np.ndarray, " bodies"]:
    """Find the one figure that is painted among line drawings, in a pose that none of them has.

    If one of them has the same pose, it is a view of the turnaround that is coloured.
    """
    nothing = np.zeros(len(numbers), dtype=bool)
    if len(numbers) <= LEAST_ROW:  # a painted front beside two views in lines is a view
        return nothing
    masks = [state.blobs.mask(int(number)) for number in numbers]
    windows = [state.rgba[state.blobs.window(int(number))][..., :3] for number in numbers]
    colored = np.array(
        [(np.ptp(rgb[m], axis=1) > GREY).mean() for rgb, m in zip(windows, masks, strict=True)]
    )
    painted = colored > COLORED
    if painted.sum() != 1 or colored[~painted].max() > COLORED / 2:
        return nothing
    alike = likeness([outline(mask) for mask in masks])
    return painted & (alike < SAME_POSE)


CORRECTIONS: Mapping[str, Callable[[SheetState], SheetState | None]] = {
    "frames": remove_frames,
    "open outlines": fill_open_outlines,
    "shadows": remove_shadows,
    "construction lines": remove_construction_lines,
    "touching figures": cut_touching_figures,
    "blocky figures": add_blocky_figures,
    "strangers": drop_strangers,
}
