"""From a sheet to its views: find the background, the figures, their order; cut each one out.

The cost grows with the number of pixels, plus a little per figure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.dataset.background import Background, find_background, flattened, is_transparent
from toonset.dataset.cutout import cut_out, edge_softness_px
from toonset.dataset.figures import Blobs, Grouping, find_blobs, group_blobs
from toonset.dataset.holes import BorderLook, open_holes, outline_look
from toonset.dataset.line_width import contour_width_px
from toonset.errors import SheetError
from toonset.view import View

LEAST_FIGURE_PX = 8  # pixels: a lower or narrower figure shows nothing
SURE_ENOUGH = 0.9  # of the border in one colour: less is worth a warning
WIDE = 1.8  # times the median width: two figures that touch

Box = tuple[int, int, int, int]


@dataclass(frozen=True)
class SheetOptions:
    """How a sheet is split.

    Attributes:
        margin_px: empty pixels around every figure.
        least_figure: share of the largest figure's area from which a patch is a figure of its
            own; a side view is rarely below a third of a front view.
        least_hole: share of the figure's area from which an enclosed patch in the background's
            colour is a hole.
        most_figures: more are refused; a sheet of letters or a pattern is no character sheet.
        background_rgb: the background's colour, where a person knows it.
        boxes: (x, y, width, height) of the figures where a person gives them; one view each, in
            this order.
        grid: columns and rows of equal cells, one view per cell that is not empty.
    """

    margin_px: int = 4
    least_figure: float = 0.2
    least_hole: float = 0.001
    most_figures: int = 64
    background_rgb: tuple[int, int, int] | None = None
    boxes: tuple[Box, ...] = ()
    grid: tuple[int, int] | None = None


@dataclass(frozen=True)
class LeftOut:
    """Something on the sheet that is no view.

    Attributes:
        box: (x, y, width, height) in the sheet.
        kind: "text", "frame", "swatch", "study" (a head, a prop, a small extra drawing), "mark"
            (an arrow, a rule) or "speck".
    """

    box: Box
    kind: str


@dataclass(frozen=True, eq=False)
class Sheet:
    """The drawings of a sheet.

    Attributes:
        views: in reading order, rows from the top, each from left to right.
        background: the sheet's colour; None where it is transparent.
        sure: share of the sheet's border that is background, 0 to 1.
        warnings: what was dropped or doubtful, for people.
        left_out: what was seen but is no view.
    """

    views: tuple[View, ...]
    background: tuple[int, int, int] | None
    sure: float
    warnings: tuple[str, ...]
    left_out: tuple[LeftOut, ...] = ()


def split_sheet(
    rgba: UInt8[np.ndarray, "height width 4"], options: SheetOptions | None = None
) -> Sheet:
    """Return the views of a sheet.

    Args:
        rgba: the picture; a single figure is fine.
        options: see `SheetOptions`.

    Raises:
        SheetError: blank, no plain background, nothing on it large enough, far too many figures.
    """
    options = options or SheetOptions()
    if not is_transparent(rgba):
        rgba = flattened(rgba)
    ground = find_background(rgba)
    blobs = find_blobs(~ground.outside)
    _check_blobs(blobs, ground)
    grouping = group_blobs(blobs, options.least_figure)
    if grouping.count > options.most_figures:
        raise SheetError(
            f"found {grouping.count} figures, at most {options.most_figures} are read; crop the "
            "sheet to one character"
        )
    crops = [_crop(blobs, grouping, number, options.margin_px) for number in range(grouping.count)]
    views, holes = _views(rgba, ground, crops, options)
    warnings = _warnings(ground, grouping, views, holes)
    return Sheet(tuple(views), ground.rgb, ground.sure, warnings)


Crop = tuple[Box, Bool[np.ndarray, "_ _"]]


def _check_blobs(blobs: Blobs, ground: Background) -> None:
    color = "transparent" if ground.rgb is None else "#{:02x}{:02x}{:02x}".format(*ground.rgb)
    if not len(blobs.areas):
        raise SheetError(f"the sheet is blank (all {color}); a drawn figure is needed")
    width, height = blobs.boxes[blobs.areas.argmax(), 2:]
    if min(width, height) < LEAST_FIGURE_PX:
        raise SheetError(
            f"no figure on the {color} background: the largest patch is {width} x {height} px, "
            f"{LEAST_FIGURE_PX} x {LEAST_FIGURE_PX} is needed; use a larger picture"
        )


def _crop(blobs: Blobs, grouping: Grouping, number: int, margin: int) -> Crop:
    """Return the box of a figure with its margin, and its pixels within."""
    members = np.flatnonzero(grouping.figure_of_blob == number)
    boxes = blobs.boxes[members]
    height, width = blobs.labels.shape
    left, top = np.maximum(boxes[:, :2].min(axis=0) - margin, 0)
    right, bottom = (boxes[:, :2] + boxes[:, 2:]).max(axis=0) + margin
    right, bottom = min(right, width), min(bottom, height)
    is_member = np.zeros(len(blobs.areas) + 1, dtype=bool)
    is_member[members + 1] = True
    mask: Int[np.ndarray, "h w"] = is_member[blobs.labels[top:bottom, left:right]]
    return (int(left), int(top), int(right - left), int(bottom - top)), mask


def _window(picture: np.ndarray, box: Box) -> np.ndarray:
    x, y, width, height = box
    return picture[y : y + height, x : x + width]


def _softness(rgba: np.ndarray, ground: Background, crops: list[Crop]) -> int:
    """Return the edge softness of the sheet: the median of its figures'."""
    assert ground.rgb is not None  # a transparent sheet has its own alpha
    each = [
        edge_softness_px(_window(rgba, box)[..., :3], mask, ground.rgb, ground.tolerance)
        for box, mask in crops
    ]
    return int(np.median(each))


def _views(
    rgba: np.ndarray, ground: Background, crops: list[Crop], options: SheetOptions
) -> tuple[list[View], int]:
    """Return the views and the number of opened holes."""
    holes = 0
    if ground.rgb is None:
        cuts = [np.where(mask[..., None], _window(rgba, box), np.uint8(0)) for box, mask in crops]
    else:
        softness = _softness(rgba, ground, crops)
        look = BorderLook(0, 0, 0, 0)
        for box, mask in crops:
            enclosed = _window(ground.enclosed, box) & mask
            look += outline_look(_window(rgba, box)[..., :3], mask, enclosed, ground.rgb)
        cuts = []
        for box, mask in crops:
            rgb, enclosed = _window(rgba, box)[..., :3], _window(ground.enclosed, box) & mask
            solid, opened = open_holes(rgb, mask, enclosed, ground.rgb, look, options.least_hole)
            cuts.append(cut_out(rgb, solid, ground.rgb, ground.tolerance, softness))
            holes += opened
    boxes = [box for box, _ in crops]
    return [
        _view(cut, box, f"{i:03d}.png")
        for i, (cut, box) in enumerate(zip(cuts, boxes, strict=True))
    ], holes


def _view(cut: UInt8[np.ndarray, "height width 4"], box: Box, name: str) -> View:
    if not (cut[..., 3] >= 128).any():
        raise SheetError(f"view {name}: its figure is nearly transparent; an opaque one is needed")
    return View(cut, box, contour_width_px(cut), name)


def _warnings(
    ground: Background, grouping: Grouping, views: list[View], holes: int
) -> tuple[str, ...]:
    found = []
    if ground.rgb is not None and ground.sure < SURE_ENOUGH:
        found.append(f"only {ground.sure:.0%} of the sheet's border is background")
    if grouping.captions:
        found.append(f"text beside the figures was left out ({grouping.captions} patches)")
    if grouping.strays:
        found.append(f"{grouping.strays} small patches that belong to no figure were left out")
    if holes:
        found.append(f"{holes} enclosed patches in the background's colour became holes")
    median = float(np.median([view.box[2] for view in views]))
    for view in views:
        if len(views) >= 3 and view.box[2] > WIDE * median:
            found.append(f"view {view.name} is unusually wide: do two figures touch?")
    return tuple(found)
