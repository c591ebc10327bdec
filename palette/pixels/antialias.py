"""Detect antialiased pixels, which are blends of two colours and have no label.

They lie along the borders between labels. Every pixel there is compared with the colours that begin
beside it, in units of the picture's own noise: a clean picture tells a blend of one part in a
hundred, a JPEG only what rises above its ringing. Let a be the nearest of those colours and b
another one next to the pixel x. How far x has gone from a towards b is

    (|x - a|^2 + |a - b|^2 - |x - b|^2) / (2 |a - b|).

Lightness and chroma are weighed apart, for JPEG smears chroma over two pixels. A line so faint that
all of it is nearest to the colour around it keeps that colour.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.raster import dilate, is_uniform

NONE = 255
OPAQUE = 250  # of 255: less alpha is an edge of the figure
# JPEG's lightness and chroma of 8-bit RGB (ITU-T T.871), without offsets
YCC_FROM_RGB = np.array(
    [[0.299, 0.587, 0.114], [-0.168736, -0.331264, 0.5], [0.5, -0.418688, -0.081312]]
)
ROUNDING = 1 / np.sqrt(12)  # levels: the noise of 8 bits
BESIDE = np.array([1.4, 2.5, 2.5])  # JPEG's noise next to an edge, over that two pixels away
SURE = 3.0  # times the noise towards a neighbour's colour: a blend
LOST = 4.0  # times the noise from every colour around: a blend of what is not seen
LOST_AT_RIM = 12.0  # where the figure ends: JPEG lets the paper in
STRAY = 3.0  # times the noise (in squares) that a colour with no area nearby must be nearer
SIGMA = 0.683  # quantile of absolute deviations that is one sigma
FEW = 50  # pixels from which a colour cannot be told
SAMPLE = 1 << 17  # pixels that noise is told from
CELLS = 1 << 21  # distances held at once
REACH = 2  # pixels to where a colour must begin
WINDOW = tuple(itertools.product(range(-REACH, REACH + 1), repeat=2))
NEIGHBOURS = tuple(o for o in itertools.product((-1, 0, 1), repeat=2) if o != (0, 0))
BLOCKS = tuple(itertools.product((-1, 1), repeat=2))  # the 2 x 2 blocks that a pixel is in


@dataclass(frozen=True, eq=False)
class Paints:
    """The palette as drawn, in units of noise.

    Attributes:
        units: (3, 3) from 8-bit RGB.
        places: (colors, 3) as drawn.
        apart: (colors, colors) distances.
    """

    units: Float[np.ndarray, "3 3"]
    places: Float[np.ndarray, "colors 3"]
    apart: Float[np.ndarray, "colors colors"]


def settle_borders(
    nearest: UInt8[np.ndarray, "height width"],
    rgba: UInt8[np.ndarray, "height width 4"],
    palette: UInt8[np.ndarray, "colors 3"],
) -> UInt8[np.ndarray, "height width"]:
    """Return the labels with blends marked 255, and strays given to a colour that begins nearby.

    Args:
        nearest: nearest palette colour of every pixel, 255 = not opaque.
        rgba: the picture.
        palette: its colours.
    """
    padded = np.pad(nearest, REACH, constant_values=NONE)
    inner = _inner(padded)
    border = np.flatnonzero((padded != NONE) & ~inner)
    paints = _paints(padded, inner, rgba, palette)
    result = nearest.copy()
    step = max(1, CELLS // len(palette))
    for start in range(0, len(border), step):
        at = border[start : start + step]
        settled = _settled(at, padded, inner, rgba, paints)
        result[at // padded.shape[1] - REACH, at % padded.shape[1] - REACH] = settled
    return result


def _inner(padded: UInt8[np.ndarray, "height width"]) -> np.ndarray:
    """Return where a pixel and its eight neighbours have the same label."""
    return is_uniform(padded) & (padded != NONE)


def _paints(padded: np.ndarray, inner: np.ndarray, rgba: np.ndarray, palette: np.ndarray) -> Paints:
    """Return the palette's colours as drawn in the picture, and its noise beside edges."""
    ring = np.flatnonzero(inner & dilate((padded != NONE) & ~inner, 2))
    ring = ring[:: max(1, len(ring) // SAMPLE)]
    rows, columns = np.divmod(ring, padded.shape[1])
    labels = padded[rows, columns]
    seen = rgba[rows - REACH, columns - REACH, :3] @ YCC_FROM_RGB.T
    places = palette @ YCC_FROM_RGB.T
    for label in np.flatnonzero(np.bincount(labels, minlength=len(palette)) >= FEW):
        places[label] = np.median(seen[labels == label], axis=0)
    noise = noise_beside_edges(seen - places[labels])
    units, places = YCC_FROM_RGB / noise[:, None], places / noise
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    return Paints(units, places, np.maximum(apart, 1e-9))


def noise_beside_edges(off: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " 3"]:
    """Return the noise next to an edge, in levels.

    Args:
        off: how far pixels two away from one are from their paint, in lightness and chroma.
    """
    noise = np.quantile(np.abs(off), SIGMA, axis=0) if len(off) >= FEW else np.zeros(3)
    return np.hypot(BESIDE * noise, ROUNDING)


def _settled(
    at: Int[np.ndarray, " n"],
    padded: np.ndarray,
    inner: np.ndarray,
    rgba: np.ndarray,
    paints: Paints,
) -> UInt8[np.ndarray, " n"]:
    """Return the labels of some border pixels, given by their places in the flat padded picture."""
    from scipy.spatial.distance import cdist

    rows, columns = at // padded.shape[1] - REACH, at % padded.shape[1] - REACH
    away = cdist(rgba[rows, columns, :3] @ paints.units.T, paints.places)
    first = _first(at, padded, inner, away)
    near = np.take_along_axis(away, first[:, None].astype(np.intp), axis=1)[:, 0]
    off = np.flatnonzero(near > SURE)  # nearer ones have gone less far towards any other
    off = off[_gone(at[off], padded, first[off], away[off], paints.apart)]
    off = off[~_in_flat_block(rows[off], columns[off], rgba)]
    first[off] = NONE
    return first


def _first(
    at: np.ndarray, padded: np.ndarray, inner: np.ndarray, away: np.ndarray
) -> UInt8[np.ndarray, " n"]:
    """Return the nearest colour that begins nearby, or one that is nearer by far."""
    first = padded.ravel()[at]
    own = np.take_along_axis(away, first[:, None].astype(np.intp), axis=1)[:, 0]
    rival = np.sort(away, axis=1)[:, 1] if away.shape[1] > 1 else np.full(len(at), np.inf)
    open_ones = np.flatnonzero(own**2 + STRAY**2 >= rival**2)
    at, away, label = at[open_ones], away[open_ones], first[open_ones]
    best, least = label.copy(), np.full(len(at), np.inf)
    every = np.arange(len(at))
    for down, right in WINDOW:
        there = at + down * padded.shape[1] + right
        begins = inner.ravel()[there]
        beside = np.where(begins, padded.ravel()[there], label)
        distance = np.where(begins, away[every, beside], np.inf)
        closer = distance < least
        best[closer] = beside[closer]
        least[closer] = distance[closer]
    keeps = own[open_ones] ** 2 + STRAY**2 < least**2
    first[open_ones] = np.where(keeps, label, best)
    return first


def _gone(
    at: np.ndarray, padded: np.ndarray, first: np.ndarray, away: np.ndarray, apart: np.ndarray
) -> Bool[np.ndarray, " n"]:
    """Return which pixels have gone from their colour towards a neighbour's, or are lost."""
    every = np.arange(len(at))
    near = away[every, first]
    rim, gone = np.zeros(len(at), dtype=bool), np.zeros(len(at), dtype=bool)
    for down, right in NEIGHBOURS:
        beside = padded.ravel()[at + down * padded.shape[1] + right]
        rim |= beside == NONE
        other = np.where(beside == NONE, first, beside)
        way = apart[first, other]
        far = (near**2 + way**2 - away[every, other] ** 2) / (2 * way)
        gone |= (other != first) & (far > SURE)
    return gone | (near > np.where(rim, LOST_AT_RIM, LOST))


def _in_flat_block(rows: np.ndarray, columns: np.ndarray, rgba: np.ndarray) -> np.ndarray:
    """Return which pixels lie in a 2 x 2 block of one colour: painted or scaled up, no blend."""
    height, width = rgba.shape[:2]
    flat = np.zeros(len(rows), dtype=bool)
    here = rgba[rows, columns]
    for down, right in BLOCKS:
        below, beside = rows + down, columns + right
        within = (below >= 0) & (below < height) & (beside >= 0) & (beside < width)
        below, beside = below.clip(0, height - 1), beside.clip(0, width - 1)
        for place in ((below, columns), (rows, beside), (below, beside)):
            within &= (rgba[place] == here).all(axis=1)
        flat |= within
    return flat
