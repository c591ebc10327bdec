"""The rows of a messy sheet: figures with captions, studies and props among them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.messy.cast import Brief
from bench.messy.figure import Cast, Figure, Rgb, Stamp, resized
from bench.messy.layout import Item
from bench.messy.props import bag, sword
from bench.messy.text import caption

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
