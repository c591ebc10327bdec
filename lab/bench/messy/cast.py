"""Who stands on a messy sheet, in which style, and in which rows, studies and props among them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lab.bench.messy.cartoon import cartoon_cast
from lab.bench.messy.figure import (
    Cast,
    Figure,
    Rgb,
    Stamp,
    as_line_art,
    bent,
    bust_of,
    mirrored,
    resized,
    shaded,
    with_colored_lines,
    with_gaps,
)
from lab.bench.messy.ground import DARK, LIGHT, clothes, luma
from lab.bench.messy.layout import Item
from lab.bench.messy.options import MessyOptions
from lab.bench.messy.props import bag, caption, sword

UNLINED = 0.15  # of coloured sheets have figures without lines
COLORED_LINES = 0.25  # of them have lines of a dark colour
BLACK: Rgb = (0, 0, 0)
CHALK: Rgb = (238, 238, 240)
PENCIL: Rgb = (112, 112, 116)
SHADED = 0.3  # of coloured sheets are lit softly
CHARACTERS = 1_000  # numbers to choose from
MOST_VIEWS = 8  # a turnaround's usual number; more figures repeat the round
Style = Callable[[Figure], Figure]


@dataclass(frozen=True)
class Brief:
    """Brief of a sheet: figures in each row, their height, the contour's width (0 = none)."""

    rows: tuple[int, ...]
    figure_px: int
    outline_px: float


def brief_of(chosen: frozenset[str], options: MessyOptions, rng: np.random.Generator) -> Brief:
    """Return how many figures in which rows, and how large."""
    rows: tuple[int, ...] = (int(rng.integers(2, 9)),)
    if "one" in chosen:
        rows = (1,)
    elif "rows" in chosen:
        across = int(rng.integers(2, 7))
        most = min(options.most_figures, 4 * across)
        rows = _filled(int(rng.integers(across + 1, most + 1)), across)
    low, high = options.figure_px
    high = max(low, round(high / math.sqrt(max(1, sum(rows) / 4))))
    figure_px = round(math.exp(rng.uniform(math.log(low), math.log(high))))
    lined = bool(chosen & {"line art", "open contour"}) or rng.random() > UNLINED
    pen = max(figure_px * float(rng.uniform(0.006, 0.014)), 1.2) if lined else 0.0
    return Brief(rows, figure_px, round(pen, 1))


def cast_of(
    brief: Brief, chosen: frozenset[str], ground: tuple[Rgb, ...], rng: np.random.Generator
) -> Cast:
    """Return the figures of all rows in reading order, in the sheet's style."""
    colors = clothes(ground, brief.outline_px > 0, rng)
    count = sum(brief.rows)
    number = int(rng.integers(CHARACTERS))
    casts = [
        cartoon_cast(
            number + i,
            min(count, MOST_VIEWS),
            brief.figure_px,
            brief.outline_px,
            colors,
            floats="floating" in chosen,
            heads="heads" in chosen and i == 0,
        )
        for i in range(math.ceil(count / MOST_VIEWS))
    ]
    figures = [figure for cast in casts for figure in cast.figures][:count]
    if "sizes" in chosen:
        figures = [resized(figure, float(rng.uniform(0.9, 1.0))) for figure in figures]
    whole = replace(casts[0], figures=tuple(figures))
    if chosen & {"line art", "open contour"}:
        return _inked(whole, min(map(luma, ground)), "open contour" in chosen, rng)
    return _painted(whole, min(map(luma, ground)), rng)


def _painted(cast: Cast, ground_luma: float, rng: np.random.Generator) -> Cast:
    """Return the cast in its colours, at times with coloured lines or lit softly."""
    colored, lit = rng.random(2) < (COLORED_LINES, SHADED)
    red, green, blue = (int(v) for v in rng.integers(20, 90, size=3))
    strength = float(rng.uniform(0.1, 0.3))
    if colored and ground_luma >= LIGHT:
        cast = _styled(cast, lambda figure: with_colored_lines(figure, (red, green, blue)))
    return _styled(cast, lambda figure: shaded(figure, strength)) if lit else cast


def _inked(cast: Cast, ground_luma: float, is_open: bool, rng: np.random.Generator) -> Cast:
    """Return the cast as line art, some contours of it interrupted."""
    inks: tuple[Rgb, ...] = (BLACK, (40, 36, 48), (70, 44, 30), PENCIL)
    if ground_luma < LIGHT:
        inks = (CHALK if ground_luma < DARK else BLACK,)
    ink = inks[int(rng.integers(len(inks)))]
    drawn = _styled(cast, lambda figure: as_line_art(figure, ink))
    if not is_open:
        return drawn
    figures = list(drawn.figures)
    opened = rng.permutation(len(figures))[: max(1, len(figures) // 2)]
    for i in opened:
        gaps, width = int(rng.integers(1, 4)), float(rng.uniform(1, 2))
        figures[i] = with_gaps(figures[i], gaps, width, cast.outline_px, rng)
    return replace(drawn, figures=tuple(figures))


def _styled(cast: Cast, style: Style) -> Cast:
    return replace(
        cast,
        figures=tuple(style(figure) for figure in cast.figures),
        heads=tuple(style(head) for head in cast.heads),
    )


def _filled(count: int, across: int) -> tuple[int, ...]:
    """Return full rows and what remains."""
    full, rest = divmod(count, across)
    return (across,) * full + ((rest,) if rest else ())


OVERLAP_PX = (2, 8)


def compose_rows(
    cast: Cast, brief: Brief, chosen: frozenset[str], text_rgb: Rgb, rng: np.random.Generator
) -> list[list[Item]]:
    """Return the items of every row from left to right."""
    items = [Item(figure, is_view=True) for figure in cast.figures]
    if "captions" in chosen:
        items = _captioned(items, brief.figure_px, text_rgb, rng)
    rows, start = [], 0
    for length in brief.rows:
        rows.append(_closed_up(items[start : start + length], chosen, rng))
        start += length
    if "props" in chosen:
        for prop in _props(brief.figure_px, rng):
            _insert(rows, prop, rng)
    if "outfits" in chosen:
        rows = [*rows, *(_dressed(row, rng) for row in rows * int(rng.integers(1, 3)))]
    if "glued study" in chosen:
        _glue(rows, cast, rng)
    for name, make in (("busts", _busts), ("poses", _poses)):
        if name in chosen:
            items = make(cast, rng)
            rows = [*rows, items] if rng.random() < 0.8 else [items, *rows]
    if "heads" in chosen:
        rows = _with_heads(rows, _studies(cast, brief.figure_px, rng), rng)
    return rows


def _captioned(items: list[Item], figure_px: int, rgb: Rgb, rng: np.random.Generator) -> list[Item]:
    size = max(figure_px * float(rng.uniform(0.04, 0.09)), 10)
    is_above = rng.random() < 0.25
    style = rng.integers(2**32)  # the same hand for all of them
    texts = [
        caption(i, len(items), size, rgb, np.random.default_rng(style)) for i in range(len(items))
    ]
    return [
        replace(item, above=text) if is_above else replace(item, below=text)
        for item, text in zip(items, texts, strict=True)
    ]


def _closed_up(items: list[Item], chosen: frozenset[str], rng: np.random.Generator) -> list[Item]:
    """Return the row with some neighbours touching or overlapping; at least one pair."""
    if not chosen & {"touching", "overlap"} or len(items) < 2:
        return items
    closed = rng.random(len(items) - 1) < 0.4
    closed[rng.integers(len(closed))] = True
    low, high = OVERLAP_PX if "overlap" in chosen else (0, 1)
    depths = rng.integers(low, high + 1, size=len(closed))
    return items[:1] + [
        replace(item, closer_px=int(depth)) if close else item
        for item, close, depth in zip(items[1:], closed, depths, strict=True)
    ]


def _insert(rows: list[list[Item]], extra: Item, rng: np.random.Generator) -> None:
    """Put an extra into a random row, at a place that parts no pair that touches."""
    row = rows[int(rng.integers(len(rows)))]
    free = [i for i in range(len(row) + 1) if i == len(row) or row[i].closer_px is None]
    row.insert(free[int(rng.integers(len(free)))], extra)


def _props(figure_px: int, rng: np.random.Generator) -> list[Item]:
    made = []
    for _ in range(int(rng.integers(1, 4))):
        picture: Stamp
        if rng.random() < 0.5:
            picture = sword(round(figure_px * float(rng.uniform(0.35, 0.8))), rng)
        else:
            picture = bag(round(figure_px * float(rng.uniform(0.15, 0.35))), rng)
        made.append(Item(picture, is_view=False, lifted=float(rng.choice([0, rng.random()]))))
    return made


def _studies(cast: Cast, figure_px: int, rng: np.random.Generator) -> list[Figure]:
    share = float(rng.uniform(0.3, 0.7))
    count = int(rng.integers(1, len(cast.heads) + 1))
    tallest = max(head.height for head in cast.heads)
    factor = min(share * figure_px / tallest, 1.0)
    return [resized(head, factor) for head in cast.heads[:count]]


def _busts(cast: Cast, rng: np.random.Generator) -> list[Item]:
    """Return a row of heads and shoulders, some of one drawing."""
    share, scale = float(rng.uniform(0.35, 0.6)), float(rng.uniform(0.6, 1.0))
    views = rng.integers(min(len(cast.figures), 3), size=int(rng.integers(3, 7)))
    return [
        Item(resized(bust_of(cast.figures[i], share), scale), is_view=False) for i in views.tolist()
    ]


def _poses(cast: Cast, rng: np.random.Generator) -> list[Item]:
    """Return a row of small action poses, some with a bag at the hand."""
    scale, made = float(rng.uniform(0.55, 0.85)), []
    for i in rng.integers(len(cast.figures), size=int(rng.integers(3, 9))).tolist():
        figure = mirrored(cast.figures[i]) if rng.random() < 0.5 else cast.figures[i]
        lean = float(rng.choice([-1, 1]) * rng.uniform(0.1, 0.3))
        pose = bent(figure, lean, float(rng.choice([0, rng.uniform(0, 0.6)])))
        made.append(Item(resized(pose, scale), is_view=False))
    return made


def _glue(rows: list[list[Item]], cast: Cast, rng: np.random.Generator) -> None:
    """Put a bust beside a figure so that the two touch, at the figure's head, hand or feet."""
    bust = resized(bust_of(cast.figures[0], float(rng.uniform(0.25, 0.4))), 0.9)
    row = rows[int(rng.integers(len(rows)))]
    lifted = float(rng.choice([0.0, rng.uniform(0.5, 1.0)]))
    study = Item(bust, is_view=False, closer_px=int(rng.integers(1, 4)), lifted=lifted)
    row.insert(int(rng.integers(1, len(row) + 1)), study)


def _dressed(row: list[Item], rng: np.random.Generator) -> list[Item]:
    """Return the same drawings in other colours."""
    order, level = rng.permutation(3), rng.uniform(0.6, 1.0, size=3)
    items = []
    for item in row:
        assert isinstance(item.picture, Figure)
        rgba = item.picture.rgba.copy()
        rgba[..., :3] = np.rint(rgba[..., order] * level)
        items.append(replace(item, picture=replace(item.picture, rgba=rgba)))
    return items


def _with_heads(
    rows: list[list[Item]], heads: list[Figure], rng: np.random.Generator
) -> list[list[Item]]:
    """Return the rows with the studies in a row of their own, or beside the figures."""
    items = [Item(head, is_view=False, lifted=float(rng.choice([0, 0.5, 1]))) for head in heads]
    if rng.random() < 0.5:
        return [items, *rows] if rng.random() < 0.5 else [*rows, items]
    for item in items:
        _insert(rows, item, rng)
    return rows
