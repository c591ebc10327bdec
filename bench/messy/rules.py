"""Ruled lines of messy sheets, drawn before the figures: frames, cells, ground lines, guides."""

from __future__ import annotations

import numpy as np

from bench.messy.canvas import Canvas
from bench.messy.figure import Rgb
from bench.messy.layout import Layout
from toonset.view import Box

INSETS = (0, 3, 8)  # px from the sheet's edge to its frame
WIDEST_PEN, BETWEEN = 5, 3  # px; of a frame's lines
GUIDES: tuple[Rgb, ...] = ((150, 190, 230), (190, 190, 190), (230, 140, 140))


def rule_lines(
    canvas: Canvas, layout: Layout, chosen: frozenset[str], rgb: Rgb, rng: np.random.Generator
) -> None:
    """Draw the chosen lines."""
    width = layout.size_wh[0]
    if "frame" in chosen:
        _frame(canvas, layout.size_wh, rgb, rng)
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
