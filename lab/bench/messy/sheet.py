"""Messy synthetic sheets with their truth: what artists hand over, for tests and benchmarks.

A character is drawn all round, its drawings are laid out in rows, and the sheet is made difficult:
paper, shadows, captions, arrows, swatches, frames, props, head studies, figures that touch, line
art, JPEG. Every difficulty has a name (`options.DIFFICULTIES`) and can be drawn alone. The
truth is what each figure shows of itself: with its floating parts, without shadows and lettering.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from lab.bench.cases.jpeg import through_jpeg
from lab.bench.messy.cast import brief_of, cast_of, compose_rows
from lab.bench.messy.figure import Canvas, Rgb, tight_window
from lab.bench.messy.ground import (
    DARK,
    ground_colors,
    ground_picture,
    ground_strokes,
    luma,
    shadow,
    stroke_look,
)
from lab.bench.messy.layout import Layout, Placed, lay_out
from lab.bench.messy.margins import Margins, furnish, plan_margins, rule_lines
from lab.bench.messy.options import GROUNDS, MessyOptions, checked, in_order, mixture
from toonset.view import Box

JPEG_QUALITY = (60, 95)


@dataclass(frozen=True, eq=False)
class MessySheet:
    """A sheet and the figures that are drawn on it.

    Attributes:
        rgba: (height, width, 4) sRGB, straight alpha; opaque unless transparent.
        boxes: (x, y, width, height) of every figure in reading order, just around what shows.
        alphas: per figure (height, width) of its box: its visible coverage, 0 to 255.
        what: names of the difficulties.
    """

    rgba: UInt8[np.ndarray, "height width 4"]
    boxes: tuple[Box, ...]
    alphas: tuple[UInt8[np.ndarray, "h w"], ...]
    what: tuple[str, ...]


def make_messy_sheet(
    seed: int, difficulties: Iterable[str] = (), options: MessyOptions | None = None
) -> MessySheet:
    """Return a messy sheet; the same arguments give the same bytes.

    Args:
        seed: of everything random.
        difficulties: which of `options.DIFFICULTIES`; none = a random mixture.
        options: see `MessyOptions`.

    Raises:
        SheetError: a difficulty is unknown, or two exclude each other.
        SetupError: EGL or Mesa is missing.
    """
    options = options or MessyOptions()
    planning, casting, composing, spacing, painting = (
        np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(5)
    )
    asked = tuple(difficulties)
    chosen = checked(asked) if asked else mixture(options, planning)
    kind = next(name for name in GROUNDS if name in chosen)
    ground = ground_colors(kind, planning)
    text_rgb = _text_color(ground[0], planning)
    brief = brief_of(chosen, options, planning)
    cast = cast_of(brief, chosen, ground, casting)
    rows = compose_rows(cast, brief, chosen, text_rgb, composing)
    margins = plan_margins(cast, brief, chosen, text_rgb, spacing)
    layout = lay_out(rows, margins.spacing)
    paper = None
    if kind != "transparent":
        paper = ground_picture(kind, ground, layout.size_wh, painting)
    canvas = Canvas(paper, layout.size_wh)
    _paint(canvas, layout, margins, chosen, ground[0], text_rgb, painting)
    rgba = canvas.bytes()
    if "jpeg" in chosen:
        rgba = through_jpeg(rgba, int(painting.integers(JPEG_QUALITY[0], JPEG_QUALITY[1] + 1)))
    boxes, alphas = _truth(layout)
    return MessySheet(rgba, boxes, alphas, in_order(chosen))


def _paint(
    canvas: Canvas,
    layout: Layout,
    margins: Margins,
    chosen: frozenset[str],
    ground: Rgb,
    text_rgb: Rgb,
    rng: np.random.Generator,
) -> None:
    rule_lines(canvas, layout, chosen, text_rgb, rng)
    sketched = None
    if "ground strokes" in chosen:
        sketched = stroke_look(ground, _text_color(ground, rng), rng)
    for row in layout.rows if chosen & {"shadows", "ground strokes"} else ():
        for placed in row.items:
            if placed.item.is_view:
                _cast_shadow(canvas, placed, row.ground, sketched, rng)
    for row in layout.rows:
        for placed in row.items:
            if isinstance(placed.item.picture, np.ndarray):
                canvas.over(placed.item.picture, placed.x, placed.y)
            else:
                canvas.figure(placed.item.picture, placed.x, placed.y)
        for text, x, y in row.texts:
            canvas.over(text, x, y)
    furnish(canvas, layout, margins, chosen, text_rgb, rng)


def _cast_shadow(
    canvas: Canvas,
    placed: Placed,
    ground: int,
    sketched: tuple[str, Rgb] | None,
    rng: np.random.Generator,
) -> None:
    feet = placed.item.rgba[-max(placed.item.rgba.shape[0] // 12, 1) :, :, 3].any(axis=0)
    columns = np.flatnonzero(feet)
    left, right = int(columns[0]), int(columns[-1])
    width, middle = max(right - left, 12), placed.x + (left + right) // 2
    if sketched is not None:
        tall = placed.item.rgba.shape[0]
        strokes, (cx, cy) = ground_strokes(width, tall, *sketched, rng)
        canvas.over(strokes, middle - cx, ground - cy)
    else:
        layer, (cx, cy) = shadow(width, rng)
        canvas.darken(layer, middle - cx, ground - cy)


def _text_color(ground: Rgb, rng: np.random.Generator) -> Rgb:
    if luma(ground) < DARK:
        return 240, 240, 236
    inks: tuple[Rgb, ...] = ((0, 0, 0), (60, 60, 66), (120, 120, 120), (150, 30, 30), (30, 50, 120))
    return inks[int(rng.integers(len(inks)))]


def _truth(layout: Layout) -> tuple[tuple[Box, ...], tuple[np.ndarray, ...]]:
    """Return what shows of every figure: later ones lie over earlier ones."""
    views = [p for row in layout.rows for p in row.items if p.item.is_view]
    boxes, alphas = [], []
    for i, placed in enumerate(views):
        alpha = placed.item.rgba[..., 3].astype(np.float32)
        for over in views[i + 1 :]:
            _hide(alpha, placed, over)
        shown = np.rint(alpha).astype(np.uint8)
        rows, columns = tight_window(shown)
        crop = shown[rows, columns]
        x, y = placed.x + columns.start, placed.y + rows.start
        boxes.append((x, y, crop.shape[1], crop.shape[0]))
        alphas.append(crop)
    return tuple(boxes), tuple(alphas)


def _hide(alpha: np.ndarray, below: Placed, above: Placed) -> None:
    """Take from `alpha` of the one below what the one above covers."""
    dx, dy = above.x - below.x, above.y - below.y
    cover = above.item.rgba[..., 3]
    left, top = max(dx, 0), max(dy, 0)
    right = min(dx + cover.shape[1], alpha.shape[1])
    bottom = min(dy + cover.shape[0], alpha.shape[0])
    if left < right and top < bottom:
        window = cover[top - dy : bottom - dy, left - dx : right - dx]
        alpha[top:bottom, left:right] *= 1 - window / np.float32(255)
