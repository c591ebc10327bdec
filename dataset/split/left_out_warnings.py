"""Warn of what was left out, though it may be a view or the turnaround itself."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int, UInt8

from toonset.dataset.split.figures.blobs import find_blobs, shared_colors
from toonset.dataset.split.figures.parts_in_doubt import ALIKE
from toonset.dataset.split.figures.rows import LOWEST, OFF_ROW
from toonset.dataset.split.segment import SheetLayout
from toonset.dataset.split.view_warnings import beside_row, is_level
from toonset.raster import dilate
from toonset.view import View

NEARLY_A_VIEW = 0.5  # of the views' height: something left out that may be a small one
PROPORTIONS = 1.2  # times the widest view's, or less than its inverse of the narrowest's: no view
AS_LIKELY = 0.6  # of the merit of the group that was taken: another may be the turnaround
UPRIGHT = 1.4  # times its width: a standing figure is higher, a head is not
SMALL = 0.25  # of a single view's height: small whole figures beside it may be the turnaround
STROKES = ("mark", "speck", "text")  # as which pieces of a pencil drawing are left out
BROKEN = 0.05  # of the views' height: gaps between its pieces
PIECES = 2  # no sword or ruler has more
CRUMB = 0.01  # of the largest piece: a smaller one is dust beside it
SLENDER = 0.12  # of its height: a drawing is no narrower


def other_groups(
    found: SheetLayout, views: list[View], rgba: UInt8[np.ndarray, "height width 4"]
) -> list[str]:
    """Return a line for every other group that may be the turnaround."""
    taken, cell = found.groups[found.taken.group], found.cell_px
    colors = [view.rgba[view.mask][:, :3] for view in views]
    said = []

    def colors_of(number: int) -> UInt8[np.ndarray, "n 3"]:
        small = rgba[::cell, ::cell, :3][found.blobs.window(number)]
        return np.asarray(small[found.blobs.mask(number)])

    for number, group in enumerate(found.groups):
        boxes = found.blobs.boxes[group.members]
        if group is taken or found.taken.group:
            continue
        small = len(taken.members) == 1 and _has_whole(boxes, taken.height)
        small = small and all(_shares(colors_of(int(n)), colors) for n in group.members)
        if not small and group.merit < AS_LIKELY * taken.merit:
            continue
        x, y = (int(v) * found.cell_px for v in boxes[:, :2].min(axis=0))
        said.append(
            f"{len(group.members)} drawings from {x}, {y} on may be the turnaround, too: take "
            f"them with --group {number + 1}"
        )
    return said


def _has_whole(boxes: Int[np.ndarray, "figures 4"], tall: float) -> bool:
    """Return whether several drawings beside a single, larger one are whole figures."""
    slender = boxes[:, 3] >= UPRIGHT * boxes[:, 2]
    return bool((slender & (boxes[:, 3] >= SMALL * tall)).sum() > 1)


def like_views(
    found: SheetLayout, views: list[View], rgba: np.ndarray, *, chosen: bool
) -> list[str]:
    """Return a line for every drawing left out that is as high as a view, or like a small one.

    Lower drawings of another row of equal figures are poses or busts, which the row says, and so
    are those beside the views that do not stand in their row.
    """
    rows = [row for group in found.groups for row in group.rows if len(row) > 1]
    in_rows = set(np.concatenate([np.zeros(0, int), *rows]).tolist())
    usual = float(np.median([view.figure_box[3] for view in views]))
    shapes = [view.figure_box[2] / view.figure_box[3] for view in views]
    colors = [view.rgba[view.mask][:, :3] for view in views]
    said, cell = [], found.cell_px
    for number, kind in enumerate(found.grouping.kinds):
        x, y, width, height = (int(value) * cell for value in found.blobs.boxes[number])
        if kind != "study" or (number in in_rows and (chosen or height < usual)):
            continue
        strays = min(map(abs, beside_row(y, height, views))) > OFF_ROW
        if height < NEARLY_A_VIEW * usual or strays:
            continue
        own = rgba[::cell, ::cell, :3][found.blobs.window(number)][found.blobs.mask(number)]
        slender = width / height >= min(shapes) / PROPORTIONS
        shaped = slender and width / height <= max(shapes) * PROPORTIONS
        if height >= LOWEST * usual or (shaped and _shares(own, colors)):
            said.append(
                f"a drawing at {x}, {y} of {100 * height / usual:.0f} % of the views' height "
                "was left out: if it is a view, give all views with --boxes"
            )
    return said


def scattered_strokes(found: SheetLayout, views: list[View]) -> list[str]:
    """Return a line for strokes left out that lie together as high as a view: a pencil drawing."""
    kinds = np.array([*found.grouping.kinds, ""], dtype=object)
    cell = found.cell_px
    usual = float(np.median([view.figure_box[3] for view in views])) / cell
    reach = max(1, round(BROKEN / 2 * usual))
    strokes = np.isin(kinds, STROKES)[found.blobs.labels - 1]
    together = find_blobs(dilate(strokes, reach))
    said = []
    for number, (x, y, width, height) in enumerate(together.boxes.tolist()):
        tall, broad = height - 2 * reach, width - 2 * reach
        if tall < NEARLY_A_VIEW * usual or broad < SLENDER * tall:
            continue
        if not any(is_level((y + reach) * cell, tall * cell, view) for view in views):
            continue
        inside = found.blobs.labels[(together.labels == number + 1) & strokes]
        pieces = np.bincount(inside)
        if np.count_nonzero(pieces > CRUMB * pieces.max()) > PIECES:
            x, y = (x + reach) * cell, (y + reach) * cell
            said.append(
                f"strokes at {x}, {y} lie together {100 * tall / usual:.0f} % as high as the "
                "views: if they are a drawing, close its outline"
            )
    return said


def _shares(own: UInt8[np.ndarray, "n 3"], views: list[np.ndarray]) -> bool:
    """Return whether a drawing has the views' colours about as much as they have each other's."""
    among = [shared_colors(a, b) for i, a in enumerate(views) for b in views[i + 1 : i + 2]]
    least = ALIKE * float(np.median(among)) if among else ALIKE
    return float(np.median([shared_colors(own, view) for view in views])) >= least
