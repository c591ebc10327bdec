"""Warn of views by their own shape, and by how they stand beside each other."""

from __future__ import annotations

from itertools import combinations

import cv2
import numpy as np
from jaxtyping import Int

from toonset.dataset.split.figures.blobs import find_blobs
from toonset.dataset.split.figures.parts_in_doubt import LEVEL
from toonset.dataset.split.figures.rows import OFF_ROW
from toonset.dataset.split.touching.selection import HEAD
from toonset.raster import wider_than
from toonset.view import View

BROAD = 1.15  # times its own height: wider than arms reach
IN_EACH_OTHER = 0.45  # of the smaller one's box
EVEN = 0.85  # of the others' height: views of one figure differ by less
WIDE = 1.28  # times the next widest of four or more: two figures, or a study that touches
TWO_HEADS = 0.68  # of a view's width: two tops that are broader are no ears
LIMB = 0.12  # of the figure's height: what is no wider is an arm, a scarf or a tail
BROADER = 1.05  # times the next broadest without those: spread arms alone are a pose
LOOKED_AT = 200  # pixels: height of the copy of which limbs are taken off


def wide_views(views: list[View]) -> list[str]:
    """Return a line for every view as wide as two figures, or as one and a study.

    Wider than the other views counts only without arms, scarves and tails, which may be spread.
    """
    said, bodies = [], list[float]()
    widths = [view.figure_box[2] / view.figure_box[3] for view in views]
    most = WIDE * sorted(widths)[-2] if len(views) > 3 else BROAD
    for number, width in enumerate(widths):
        if width <= min(most, BROAD):
            continue
        bodies = bodies or [_body_width(view) for view in views]
        others = bodies[:number] + bodies[number + 1 :]
        if width > BROAD or bodies[number] > BROADER * max(others):
            said.append(f"view {views[number].name} is unusually wide: do two figures touch?")
    return said


def two_heads(views: list[View]) -> list[str]:
    """Return a line for every view with two heads: broad tops, apart, that are most of its width.

    Ears and raised claws leave more of it to the body.
    """
    said = []
    for view in views:
        heads = tops_of(view, 1.0)
        if len(heads) > 1 and heads.sum() >= TWO_HEADS * view.figure_box[2]:
            said.append(f"view {view.name} has two heads: do two figures touch?")
    return said


def tops_of(view: View, broad: float) -> Int[np.ndarray, " tops"]:
    """Return the widths, pixels, of a view's tops that are so many heads' heights wide or wider."""
    left, top, width, height = view.figure_box
    x, y, depth = left - view.box[0], top - view.box[1], max(1, round(HEAD * height))
    tops = find_blobs(view.mask[y : y + depth, x : x + width])
    wide = np.bincount(tops.labels[-1], minlength=len(tops.areas) + 1)[1:]
    return wide[(wide >= broad * depth) & (tops.boxes[:, 1] <= OFF_ROW * height)]


def _body_width(view: View) -> float:
    """Return how wide a figure is without its limbs, in its heights."""
    left, top, width, height = view.figure_box
    x, y = left - view.box[0], top - view.box[1]
    size = max(1, round(width * LOOKED_AT / height)), LOOKED_AT
    figure = view.mask[y : y + height, x : x + width].view(np.uint8)
    small = cv2.resize(255 * figure, size, interpolation=cv2.INTER_AREA) >= 128
    columns = np.flatnonzero(wider_than(small, round(LIMB / 2 * LOOKED_AT)).any(axis=0))
    return float(columns[-1] - columns[0] + 1) / LOOKED_AT if len(columns) else 0.0


def off_row(views: list[View]) -> list[str]:
    """Return a line for every view whose head and feet are both higher or lower than its row's."""
    said = []
    for view in views:
        _, top, _, height = view.figure_box
        heads, feet = beside_row(top, height, [other for other in views if other is not view])
        if min(abs(heads), abs(feet)) > OFF_ROW and heads * feet > 0:
            said.append(
                f"view {view.name} stands {'lower' if heads < 0 else 'higher'} than the rest of "
                "its row: is it another drawing?"
            )
    return said


def uneven_views(views: list[View]) -> list[str]:
    """Return a line if one view is much lower than all others: a part, a study, another figure."""
    if len(views) < 2:
        return []
    low, *others = sorted(views, key=lambda view: view.figure_box[3])
    least, usual = others[0].figure_box[3], np.median([view.figure_box[3] for view in others])
    share = low.figure_box[3] / usual
    if share >= EVEN or least < EVEN * usual:
        return []
    whom = others[0].name if len(others) == 1 else "the others"
    return [
        f"view {low.name} is {100 * share:.0f} % as high as {whom}: are all whole figures of one "
        "character?"
    ]


def one_in_another(views: list[View]) -> list[str]:
    """Return a line for every two views whose boxes lie far in each other: one was cut in two."""
    said = []
    for one, other in combinations(views, 2):
        (x, y, width, height), (left, top, wide, tall) = one.figure_box, other.figure_box
        across = min(x + width, left + wide) - max(x, left)
        down = min(y + height, top + tall) - max(y, top)
        if min(across, down) > 0 and across * down > IN_EACH_OTHER * min(
            width * height, wide * tall
        ):
            said.append(f"views {one.name} and {other.name} lie in each other: are they two?")
    return said


def beside_row(top: int, height: int, views: list[View]) -> tuple[float, float]:
    """Return how far something's row has its heads and its feet below its own, in its height."""
    row = [
        (view.figure_box[1] - top, view.figure_box[1] + view.figure_box[3] - top - height)
        for view in views
        if is_level(top, height, view)
    ]
    if len(row) < 2:
        return 0.0, 0.0
    heads, feet = np.median(row, axis=0) / height
    return float(heads), float(feet)


def is_level(top: int, tall: int, view: View) -> bool:
    """Return whether something stands beside a view, not above or below it."""
    _, first, _, height = view.figure_box
    return min(top + tall, first + height) - max(top, first) >= LEVEL * tall
