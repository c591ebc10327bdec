"""How much of the character every paint covers, soft pixels and drawn lines included.

A pixel within flat paint, or of a flat paint's exact colour, is that paint's. A soft pixel is a
blend of what lies beside it, so it counts for the nearest of its four neighbours' paints and the
ink, not for a third paint that the blend happens to look like. So on average half of an edge's
pixels goes to either side; at the figure's rim those count that it covers by half.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int, UInt8, UInt16

from toonset.palette.pixels import OPAQUE_WORD, RGB, Band, Histogram, Words, bands, box_of, words_of
from toonset.palette.shades import Paint

SOFT = np.uint16(1 << 15)  # marks a colour that no flat pixel has
NONE = np.uint16(SOFT - 1)  # no paint
COVERED = np.uint32(128 << 24)  # a word whose pixel the figure covers by half
BESIDE = ((0, -1), (0, 1), (-1, 0), (1, 0))  # rows, columns

Table = UInt16[np.ndarray, " colors"]
Mask = Bool[np.ndarray, "rows columns"]
Counts = Int[np.ndarray, " paints"]


@dataclass(frozen=True, eq=False)
class Areas:
    """Pixels per paint.

    Attributes:
        painted: pixels that are no drawn lines.
        soft: those of them that are blends, on whose share in each nobody can swear.
        drawn: pixels of drawn lines.
    """

    painted: Counts
    soft: Counts
    drawn: Counts


def paint_areas(
    images: Sequence[UInt8[np.ndarray, "_ _ 4"]],
    histogram: Histogram,
    paints: Sequence[Paint],
    lines: Sequence[Bool[np.ndarray, "_ _"]] | None = None,
) -> Areas:
    """Return how many pixels every paint has.

    Args:
        images: the character's pictures.
        histogram: of these pictures.
        paints: of this histogram.
        lines: the drawn lines of every picture; None = not known, nothing is a line.
    """
    table = _table(histogram, paints)
    totals = np.zeros((3, len(paints)), dtype=np.int64)
    for number, image in enumerate(images):
        box, top = box_of(image), 0
        mask = None if lines is None else lines[number][box]
        for band in bands(words_of(image)[box], histogram.noise):
            paint, counted, soft = _read(band, table, paints)
            line = (
                np.zeros(paint.shape, dtype=bool) if mask is None else mask[top : top + len(paint)]
            )
            for place, where in enumerate(
                (counted & ~line, counted & soft & ~line, counted & line)
            ):
                totals[place] += np.bincount(paint[where], minlength=len(paints))
            top += len(paint)
    return Areas(*totals)


def _table(histogram: Histogram, paints: Sequence[Paint]) -> Table:
    """Return every colour's paint, with a mark where no flat pixel has the colour."""
    paint_of = np.zeros(len(histogram.counts), dtype=np.uint16)
    for number, paint in enumerate(paints):
        paint_of[paint.members] = number
    codes = histogram.colors.astype(np.uint32) @ np.array([1, 1 << 8, 1 << 16], dtype=np.uint32)
    table = np.zeros(1 << 24, dtype=np.uint16)
    table[codes] = paint_of | np.where(histogram.flat > 0, np.uint16(0), SOFT)
    return table


def _read(
    band: Band, table: Table, paints: Sequence[Paint]
) -> tuple[UInt16[np.ndarray, "rows columns"], Mask, Mask]:
    """Return the paint of every pixel of the band's own rows, which count, and which are soft."""
    entry = table[band.words & RGB]
    opaque, covered = band.words >= OPAQUE_WORD, band.words >= COVERED
    around = np.pad(np.where(band.flat, entry & ~SOFT, NONE), 1, constant_values=NONE)
    soft = covered & ~band.flat & ((entry >= SOFT) | ~opaque)
    soft[: band.inner.start] = False
    soft[band.inner.stop :] = False
    rows, columns = np.nonzero(soft)
    paint = np.where(opaque, entry & ~SOFT, NONE)
    paint[rows, columns] = _of_neighbours(band.words, around, rows, columns, paint, paints)
    counted = covered & (paint != NONE)
    return paint[band.inner], counted[band.inner], soft[band.inner]


def _of_neighbours(
    words: Words,
    around: UInt16[np.ndarray, "padded_rows padded_columns"],
    rows: Int[np.ndarray, " soft"],
    columns: Int[np.ndarray, " soft"],
    paint: UInt16[np.ndarray, "rows columns"],
    paints: Sequence[Paint],
) -> UInt16[np.ndarray, " soft"]:
    """Return the nearest, in RGB, of four neighbours' paints and the ink; as it was without any."""
    rgb = np.array([one.rgb for one in paints], dtype=np.int32)
    colors = np.ascontiguousarray(words[rows, columns])[:, None].view(np.uint8)[:, :3]
    best, least = paint[rows, columns], np.full(len(rows), np.iinfo(np.int32).max, dtype=np.int32)
    inks = [number for number, one in enumerate(paints) if one.is_ink]
    candidates = [around[rows + 1 + down, columns + 1 + right] for down, right in BESIDE]
    known = np.min(candidates, axis=0) < NONE
    candidates += [np.where(known, np.uint16(ink), NONE) for ink in inks]
    for candidate in candidates:
        ok = candidate < NONE
        away = ((colors - rgb[np.where(ok, candidate, 0)]) ** 2).sum(axis=1, dtype=np.int32)
        closer = ok & ((away < least) | ((away == least) & (candidate < best)))
        best[closer], least[closer] = candidate[closer], away[closer]
    return best
