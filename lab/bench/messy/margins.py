"""What stands round the rows of a messy sheet, and its ruled lines: frames, cells, guides."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from lab.bench.messy.cast import Brief
from lab.bench.messy.figure import Canvas, Cast, Rgb, Stamp
from lab.bench.messy.layout import Layout, Placed, Spacing
from lab.bench.messy.props import arrow, faded, signature, swatches, title_block
from toonset.view import Box

LEAST_ARROW_PX = 16
INK: Rgb = (0, 0, 0)
RED: Rgb = (200, 40, 40)


@dataclass(frozen=True, eq=False)
class Margins:
    """The sheet's spacing, and the stamps that its bands are made for; None = not there."""

    spacing: Spacing
    title: Stamp | None
    swatches: Stamp | None
    signature: Stamp | None


def plan_margins(
    cast: Cast, brief: Brief, chosen: frozenset[str], rgb: Rgb, rng: np.random.Generator
) -> Margins:
    """Return distances, with room for what stands in the bands."""
    unit = brief.figure_px
    title = strip = name = None
    upright = bool(rng.integers(2))
    if "title" in chosen:
        title = title_block(max(unit * float(rng.uniform(0.08, 0.16)), 14), rgb, rng)
    if "swatches" in chosen:
        size = max(round(unit * float(rng.uniform(0.06, 0.15))), 10)
        strip = swatches(cast.colors, size, rng, upright=upright)
    if "signature" in chosen:
        name = signature(max(unit * float(rng.uniform(0.05, 0.12)), 12), rgb, rng)
        name = faded(name, float(rng.choice([1.0, rng.uniform(0.25, 0.6)])))
    pad = round(0.06 * unit) + 4
    below = [len(s) + pad for s in (None if upright else strip, name) if s is not None]
    widths = [s.shape[1] for s in (title, None if upright else strip, name) if s is not None]
    return Margins(
        Spacing(
            margin=round(unit * float(rng.uniform(0.06, 0.25)))
            + frame_px(bool({"frame", "hand frame"} & chosen)),
            gap=max(round(unit * _gap(chosen, rng)), 4),
            leading=max(round(unit * float(rng.uniform(0.08, 0.3))), 8),
            text_gap=max(round(unit * float(rng.uniform(0.025, 0.08))), 4),
            centred=bool(rng.integers(2)),
            cells="cells" in chosen,
            header=0 if title is None else len(title) + pad,
            footer=sum(below),
            side=strip.shape[1] + pad if strip is not None and upright else 0,
            least=max(widths, default=0),
        ),
        title,
        strip,
        name,
    )


def furnish(
    canvas: Canvas,
    layout: Layout,
    margins: Margins,
    chosen: frozenset[str],
    rgb: Rgb,
    rng: np.random.Generator,
) -> None:
    """Paint the bands' stamps, and arrows between figures."""
    width, height = layout.size_wh
    margin = margins.spacing.margin
    y = height - margin
    if margins.title is not None:
        free = width - 2 * margin - margins.title.shape[1]
        canvas.over(margins.title, margin + round(free * float(rng.choice([0, 0.5]))), margin)
    if margins.signature is not None:
        y -= len(margins.signature)
        free = width - 2 * margin - margins.signature.shape[1]
        canvas.over(margins.signature, margin + round(free * float(rng.choice([0, 1]))), y)
    if margins.swatches is not None and margins.spacing.side:
        canvas.over(margins.swatches, width - margin - margins.swatches.shape[1], margin)
    elif margins.swatches is not None:
        top = height - margin - margins.spacing.footer + round(0.5 * margin)
        top = min(top, y - len(margins.swatches) - 4)
        free = width - 2 * margin - margins.swatches.shape[1]
        canvas.over(margins.swatches, margin + round(free * float(rng.choice([0, 0.5, 1]))), top)
    if "arrows" in chosen:
        _arrows(canvas, layout, rgb, rng)


def _gap(chosen: frozenset[str], rng: np.random.Generator) -> float:
    """Return the distance between figures as a share of their height."""
    least, most = (0.3, 0.5) if "arrows" in chosen else (0.08, 0.4)
    return float(rng.uniform(max(least, 0.15) if "cells" in chosen else least, most))


def _arrows(canvas: Canvas, layout: Layout, rgb: Rgb, rng: np.random.Generator) -> None:
    """Draw an arrow between neighbouring figures wherever there is room."""
    color = (rgb, rgb, RED)[int(rng.integers(3))]
    curved, leftwards = bool(rng.integers(2)), bool(rng.integers(2))
    level, pen = float(rng.uniform(0.15, 0.8)), float(rng.uniform(1, 4))
    for row in layout.rows:
        for left, right in pairwise(row.items):
            free = right.x - left.right
            length = round(0.7 * free)
            if length < LEAST_ARROW_PX or not _both_views(left, right):
                continue
            stamp = arrow(length, color, pen, curved=curved, leftwards=leftwards)
            y = row.top + round(level * (row.ground - row.top)) - len(stamp) // 2
            canvas.over(stamp, left.right + (free - length) // 2, y)


def _both_views(left: Placed, right: Placed) -> bool:
    return left.item.is_view and right.item.is_view


INSETS = (0, 3, 8)  # px from the sheet's edge to its frame
WIDEST_PEN, BETWEEN = 5, 3  # px; of a frame's lines
FAR_PX, UNSTEADY_PX = 12, 2.5  # a hand's line from the sheet's edge, and off the straight line
GUIDES: tuple[Rgb, ...] = ((150, 190, 230), (190, 190, 190), (230, 140, 140))


def rule_lines(
    canvas: Canvas, layout: Layout, chosen: frozenset[str], rgb: Rgb, rng: np.random.Generator
) -> None:
    """Draw the chosen lines."""
    width = layout.size_wh[0]
    if "frame" in chosen:
        _frame(canvas, layout.size_wh, rgb, rng)
    if "hand frame" in chosen:
        _frame_by_hand(canvas, layout.size_wh, rgb, rng)
    if "cells" in chosen:
        pen = int(rng.integers(1, 4))
        for row in layout.rows:
            for box in row.cell_boxes:
                rectangle(canvas, box, pen, rgb)
    views = [row for row in layout.rows if any(p.item.is_view for p in row.items)]
    if "ground line" in chosen:
        pen = int(rng.integers(1, 5))
        for row in views:
            canvas.rule(0, row.ground, width, pen, rgb, 1.0)
    if "guides" in chosen:
        color = GUIDES[int(rng.integers(len(GUIDES)))]
        pen, dash = int(rng.integers(1, 3)), int(rng.choice([0, 6, 12]))
        shares = np.linspace(0, 1, int(rng.integers(3, 9)))
        for row in views:
            for share in shares:
                y = round(row.ground + share * (row.top - row.ground))
                _dashed(canvas, y, width, pen, dash, color)


def rectangle(canvas: Canvas, box: Box, pen: int, rgb: Rgb) -> None:
    """Draw the rim of a box, inwards."""
    x, y, width, height = box
    canvas.rule(x, y, width, pen, rgb, 1.0)
    canvas.rule(x, y + height - pen, width, pen, rgb, 1.0)
    canvas.rule(x, y, pen, height, rgb, 1.0)
    canvas.rule(x + width - pen, y, pen, height, rgb, 1.0)


def frame_px(framed: bool) -> int:
    """Return how far a frame can reach into the sheet."""
    return max(INSETS) + 2 * (WIDEST_PEN + BETWEEN) if framed else 0


def _frame(canvas: Canvas, size_wh: tuple[int, int], rgb: Rgb, rng: np.random.Generator) -> None:
    """Draw one line or two round the sheet, at its very edge or a little inside."""
    inset, pen = int(rng.choice(INSETS)), int(rng.integers(1, WIDEST_PEN + 1))
    for _ in range(int(rng.integers(1, 3))):
        inner = size_wh[0] - 2 * inset, size_wh[1] - 2 * inset
        rectangle(canvas, (inset, inset, *inner), pen, rgb)
        inset += pen + BETWEEN


def _dashed(canvas: Canvas, y: int, width: int, pen: int, dash: int, rgb: Rgb) -> None:
    if dash == 0:
        canvas.rule(0, y, width, pen, rgb, 1.0)
    for x in range(0, width, 2 * dash) if dash else ():
        canvas.rule(x, y, dash, pen, rgb, 1.0)


def _frame_by_hand(
    canvas: Canvas, size_wh: tuple[int, int], rgb: Rgb, rng: np.random.Generator
) -> None:
    """Draw a line round the sheet that wavers."""
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)])
    at = np.linspace(0, 4, 4 * int(rng.integers(8, 25)), endpoint=False)
    places = np.stack([np.interp(at, range(5), corners[:, axis]) for axis in (0, 1)], axis=1)
    places = FAR_PX + places * (np.array(size_wh) - 2 * FAR_PX)
    places += rng.normal(0, float(rng.uniform(0.5, UNSTEADY_PX)), places.shape)
    cover = np.zeros(size_wh[::-1], np.uint8)
    line = np.rint(16 * places).astype(np.int32)
    cv2.polylines(cover, [line], True, 255, int(rng.integers(1, WIDEST_PEN)), cv2.LINE_AA, 4)
    stamp = np.dstack([np.full((*cover.shape, 3), rgb, np.uint8), cover])
    canvas.over(stamp, 0, 0)
