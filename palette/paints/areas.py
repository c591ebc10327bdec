"""Measure the area of every paint, antialiased pixels and drawn lines included.

A pixel of a colour that flat paint has, too, is that paint's. Any other is a blend of what lies
beside it, so it counts for the nearest of its four neighbours' paints and the ink, not for a third
paint that the blend happens to look like. So on average half of an edge's pixels goes to either
side; at the figure's rim those count that it covers by half.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int, UInt16, UInt32

from toonset.palette.paints.clusters import Paint
from toonset.palette.paints.histogram import OPAQUE_WORD, RGB, Histogram, Picture

SETTLED = np.uint16(1 << 15)  # marks a colour that flat pixels have, too
NONE = np.uint16(SETTLED - 1)  # no paint
FAR = np.int32(4 * 255**2)  # squared levels: farther than any two colours are

Table = UInt16[np.ndarray, " colors"]
Counts = Int[np.ndarray, " paints"]


@dataclass(frozen=True, eq=False)
class Areas:
    """Pixels per paint.

    Attributes:
        painted: pixels that are no drawn lines.
        soft: those of them that are blends, of which a paint may hold more or less.
        drawn: pixels of drawn lines.
    """

    painted: Counts
    soft: Counts
    drawn: Counts


def paint_areas(
    histogram: Histogram,
    paints: Sequence[Paint],
    lines: Sequence[Bool[np.ndarray, "_ _"]] | None = None,
) -> Areas:
    """Return how many pixels every paint has.

    Args:
        histogram: of the character's pictures.
        paints: of this histogram.
        lines: the drawn lines of every picture; None = not known, nothing is a line.
    """
    settled = histogram.flat > 0
    painted = np.array([histogram.counts[p.members] @ settled[p.members] for p in paints])
    soft, drawn = np.zeros((2, len(paints)), dtype=np.int64)
    table = _table(histogram, paints)
    for number, picture in enumerate(histogram.pictures):
        blend = _is_soft(picture.own, table)
        if lines is not None:
            mask = lines[number][picture.top : picture.top + len(picture.words)].ravel()
            words = picture.words.ravel()[mask]
            own = table[words[words >= OPAQUE_WORD] & RGB]
            drawn += _count(own & ~SETTLED, paints)
            painted -= _count(own[own >= SETTLED] & ~SETTLED, paints)
            blend &= ~mask[picture.rough]
        soft += _count(_of_blends(picture, blend, table, paints), paints)
    return Areas(painted + soft, soft, drawn)


def _table(histogram: Histogram, paints: Sequence[Paint]) -> Table:
    """Return every colour's paint, with a mark where flat pixels have the colour, too."""
    paint_of = np.zeros(len(histogram.counts), dtype=np.uint16)
    for number, paint in enumerate(paints):
        paint_of[paint.members] = number
    table = np.zeros(1 << 24, dtype=np.uint16)
    table[histogram.codes] = paint_of | (histogram.flat > 0) * SETTLED
    return table


def _is_soft(words: UInt32[np.ndarray, " n"], table: Table) -> Bool[np.ndarray, " n"]:
    return (table[words & RGB] < SETTLED) | (words < OPAQUE_WORD)


def _count(paint: UInt16[np.ndarray, " n"], paints: Sequence[Paint]) -> Counts:
    return np.bincount(paint[paint != NONE], minlength=len(paints))


def _of_blends(
    picture: Picture, blend: Bool[np.ndarray, " rough"], table: Table, paints: Sequence[Paint]
) -> UInt16[np.ndarray, " blends"]:
    """Return the nearest, in RGB, of four neighbours' paints and the ink.

    Without such neighbours: what an opaque pixel's colour is nearest to; NONE on the rim.
    """
    own = picture.own[blend]
    best = np.where(own >= OPAQUE_WORD, table[own & RGB] & ~SETTLED, NONE)
    candidates = []
    for beside in picture.beside:
        words = beside[blend]
        candidates.append(np.where(_is_soft(words, table), NONE, table[words & RGB] & ~SETTLED))
    known = np.min(candidates, axis=0) < NONE
    candidates += [
        np.where(known, np.uint16(number), NONE) for number, one in enumerate(paints) if one.is_ink
    ]
    channels = own[:, None].view(np.uint8)[:, :3].astype(np.int32).T
    rgb = np.array([*(one.rgb for one in paints), (0, 0, 0)], dtype=np.int32).T
    least = np.full(len(own), FAR, dtype=np.int32)
    for candidate in candidates:
        place = np.minimum(candidate, len(paints))
        away = sum((c - r[place]) ** 2 for c, r in zip(channels, rgb, strict=True))
        away = np.where(candidate < NONE, away, FAR)
        closer = (away < least) | ((away == least) & (away < FAR) & (candidate < best))
        best, least = np.where(closer, candidate, best), np.minimum(away, least)
    return best
