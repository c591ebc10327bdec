"""Unmix the pixels between areas into two tones each, for sub-pixel borders.

A pixel of colour c between areas is a mixture of two tones a and b that are drawn nearby:

    min over a, b, t of  3 log(1 + |c - (1 - t) a - t b|^2 / 3) - 2 log(w_a w_b)

Colours are in units of the picture's own noise (`toonset.palette.pixels.antialias`), with the tails
of Student's t. w_a is how much of the pixel's surroundings a covers, under a Gaussian. Mixtures
speak for their neighbours: w is taken `ROUNDS` times from labels and mixtures together, a mean
field of the Markov field whose sites are the pixels along borders.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int16, UInt8

from toonset.palette.pixels.antialias import YCC_FROM_RGB, noise_beside_edges
from toonset.raster import Mask, dilate, median_inside

NONE = -1  # of a pixel without a tone
LINE = 32  # of 255: a line that covers so much of a pixel may be in its neighbours, too
FEW = 20  # pixels from which a tone's colour cannot be told
AROUND = 2.0  # pixels: the Gaussian's sigma
PRIOR = 2.0  # times the logarithms of what is around
MOST = 5  # tones around, the commonest, that a pixel may be mixed of
FAINT = 1e-4  # of the surroundings: less is not told from nothing
ROUNDS = 2
TAILS = 3.0  # of Student's t
UNEVEN = 2.0  # times the noise: paint along borders strays more
TINY = 1e-6

Map = UInt8[np.ndarray, "height width"]
Tones = Int16[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class Mixtures:
    """Two tones that cover each of some pixels.

    Attributes:
        first, second: (n,) tones; the number of tones stands for a drawn line.
        part: (n,) how much of it `second` covers, 0 to 1.
    """

    first: Int16[np.ndarray, " n"]
    second: Int16[np.ndarray, " n"]
    part: Float[np.ndarray, " n"]

    def share(self, tone: int) -> Float[np.ndarray, " n"]:
        """Return how much of the pixels a tone covers."""
        return (self.first == tone) * (1 - self.part) + (self.second == tone) * self.part

    def of(self, values: Float[np.ndarray, "tones k"]) -> Float[np.ndarray, "n k"]:
        """Return the mean of the tones' values where they cover the pixels."""
        first, second = values[self.first], values[self.second]
        return first + self.part[:, None] * (second - first)


def colors_as_drawn(
    picture: UInt8[np.ndarray, "height width 4"],
    tones: Tones,
    inside: Mask,
    colors: UInt8[np.ndarray, "n 3"],
) -> Float[np.ndarray, "tones 3"]:
    """Return the colours of tones, and of lines, in the picture: medians; the palette's of rare.

    Args:
        picture: sRGB with straight alpha.
        tones: of every pixel; `NONE` for blends and the background; the last one is drawn lines.
        inside: where a pixel and its eight neighbours have one tone; medians are of these.
        colors: the palette's of the tones.
    """
    drawn = np.concatenate([colors.astype(np.float32), np.zeros((1, 3), np.float32)])
    for kind in np.unique(tones[tones != NONE]):
        where = tones == kind
        where &= inside | (kind == len(colors))
        if where.sum() >= FEW:
            drawn[kind] = [median_inside(picture[..., n], where) for n in range(3)]
    return drawn


def find_mixtures(
    picture: UInt8[np.ndarray, "height width 4"],
    tones: Tones,
    inside: Mask,
    contour: Map,
    drawn: Float[np.ndarray, "tones 3"],
    at: Mask,
) -> Mixtures:
    """Unmix the chosen pixels.

    Args:
        picture: sRGB with straight alpha.
        tones: see `colors_as_drawn`.
        inside: the same.
        contour: how far lines cover every pixel.
        drawn: the tones' colours in the picture.
        at: which pixels; others are taken as their tones say.
    """
    units = _units(picture, tones, inside, drawn)
    places, colors = drawn @ units, picture[at][:, :3] @ units
    shares = _around(tones, contour, len(drawn), at)
    for _ in range(ROUNDS):
        shares = _around(tones, contour, len(drawn), at, _best(colors, shares, places))
    return _best(colors, shares, places)


def _units(
    picture: np.ndarray, tones: Tones, inside: Mask, drawn: Float[np.ndarray, "tones 3"]
) -> Float[np.ndarray, "3 3"]:
    """Return (3, 3) from 8-bit RGB to units of the noise inside areas that end nearby."""
    painted = inside & (tones != NONE)
    ring = painted & dilate(~painted, 2)
    off = (picture[ring][:, :3] - drawn[tones[ring]]) @ YCC_FROM_RGB.T
    return (YCC_FROM_RGB / (UNEVEN * noise_beside_edges(off))[:, None]).T.astype(np.float32)


def _around(
    tones: Tones, contour: Map, kinds: int, at: Mask, mixtures: Mixtures | None = None
) -> Float[np.ndarray, "tones n"]:
    """Return how much of some pixels' surroundings every tone covers; mixtures count if given."""
    shares = np.full((kinds, int(at.sum())), FAINT, np.float32)
    for kind in range(kinds if at.any() else 0):
        is_line = kind == kinds - 1
        field = ((contour >= LINE) if is_line else (tones == kind)).astype(np.float32)
        if mixtures is not None:
            field[at] = mixtures.share(kind)
        if field.any():
            shares[kind] += cv2.GaussianBlur(field, (0, 0), AROUND)[at]
    return shares / shares.sum(axis=0)


def _best(
    colors: Float[np.ndarray, "n 3"],
    shares: Float[np.ndarray, "tones n"],
    places: Float[np.ndarray, "tones 3"],
) -> Mixtures:
    """Return the mixtures of least energy; see the module."""
    order = np.argsort(-shares, axis=0, kind="stable")[:MOST]
    log_shares = np.log(np.take_along_axis(shares, order, axis=0))
    first, second = order[0].astype(np.int16), order[0].astype(np.int16)
    part, least = np.zeros(len(colors), np.float32), np.full(len(colors), np.inf, np.float32)
    for i, j in itertools.combinations(range(len(order)), 2):
        a, b = places[order[i]], places[order[j]]
        way = b - a
        t = ((colors - a) * way).sum(axis=1) / np.maximum(np.square(way).sum(axis=1), TINY)
        t = t.clip(0, 1)
        off = np.square(colors - a - t[:, None] * way).sum(axis=1)
        energy = TAILS * np.log1p(off / TAILS) - PRIOR * (log_shares[i] + log_shares[j])
        less = energy < least
        first[less], second[less] = order[i][less], order[j][less]
        part[less], least[less] = t[less], energy[less]
    return Mixtures(first, second, part)
