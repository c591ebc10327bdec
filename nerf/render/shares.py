"""Explain a view by few colours: every pixel is one, or t of one and 1 - t of another.

The colours are the pen's, the commonest ones of flat places, then those that no mixture of two
colours around explains. The two of a pixel are seen around it; beside an outline one of them is the
pen's.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.nerf.look.drawn_view import SOLID, DrawnView
from toonset.nerf.look.outline import Outline
from toonset.raster import dilate, distance_to, from_nearest, is_uniform

NEAR = 0.06  # of colours (Euclidean, channels in [0, 1]): nearer ones count as one
STEP = 0.12  # of colours: less between neighbours is no edge
MIXED = 0.02  # by how much two colours must explain a pixel better than one
AFAR = 0.03  # the same, if the second is not seen around
PENLESS = 0.1  # the same beside the outline, without the pen's colour
UNEXPLAINED = 0.12  # of colours, off a pixel's explanation: it may be a colour of its own
AROUND_PX, FEWEST, MOST = 7, 3, 4  # window in which colours are looked for, pixels of one, how many
COLORS, RARE = 48, 2  # of a view at most; flat pixels of a colour, each amid its own
CRUMB = 1.0  # pixels times colour that a part must differ by from what is beside it
NONE = -1

Mask = Bool[np.ndarray, "height width"]
Share = Float[np.ndarray, "height width"]
Color = Float[np.ndarray, "height width 3"]
Colors = Float[np.ndarray, "colors 3"]
Labels = Int[np.ndarray, "height width"]
Box = tuple[slice, slice]  # rows and columns


@dataclass(frozen=True, eq=False)
class Picture:
    """What is explained.

    Attributes:
        color: straight colour under the outline, everywhere.
        cover: of paint, without the outline.
        ink: of the outline; 0 where it is taken for paint.
        known: the pen's colour, or none.
        rim: where colours may be mixed with the pen's.
        pure: where they are no mixtures of two neighbours.
        contrast: to the neighbours, largest channel.
        around_px: window in which colours are looked for.
    """

    color: Color
    cover: Share
    ink: Share
    known: Colors
    rim: Mask
    pure: Mask
    contrast: Share
    around_px: int

    @classmethod
    def of(cls, view: DrawnView, pen: Outline | None) -> Picture:
        """Return the picture of a view; a drawing's own outline is taken for paint."""
        ink, rgb, rim = np.zeros_like(view.alpha), view.rgb, dilate(view.ink > 0)
        known: Colors = np.zeros((0, 3), np.float32)
        around_px = AROUND_PX
        if pen is not None:
            known = np.array([pen.rgb], np.float32) / 255
            around_px = max(AROUND_PX, 2 * round(pen.width_px) + 5)
            rim |= distance_to(view.alpha < SOLID) < pen.width_px + 1.5
            under = view.rgb - view.ink[..., None] * known[0]
            off = np.abs(under - (view.alpha - view.ink)[..., None] * view.paint).max(axis=-1)
            wrong = np.count_nonzero(off[view.ink > 0] > MIXED)
            if wrong < MIXED * np.count_nonzero(view.ink):  # the outline was drawn anew
                ink, rgb = view.ink, under
        cover = view.alpha - ink
        color = rgb / np.maximum(cover, 1e-6)[..., None]
        seen = cover >= min(SOLID, float(cover.max()))
        color = from_nearest(color, seen).clip(0, 1).astype(np.float32)
        color = cv2.bilateralFilter(color, 3, NEAR, 3)
        low, high = (one(color, np.ones((3, 3), np.uint8)) for one in (cv2.erode, cv2.dilate))
        pure = (cover > 1 - MIXED) & ~_edges(color)
        return cls(color, cover, ink, known, rim, pure, (high - low).max(axis=-1), around_px)


def _edges(color: Color) -> Mask:
    """Return the pixels of soft edges: mixtures of two opposite neighbours."""
    height, width = color.shape[:2]
    found = np.zeros((height, width), dtype=bool)
    padded = np.pad(color, ((1, 1), (1, 1), (0, 0)), mode="edge")
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        one, other = (
            padded[1 + sign * down :, 1 + sign * right :][:height, :width] for sign in (-1, 1)
        )
        part, off, apart = _mixture(color, one, other)
        found |= (apart > STEP) & (np.abs(part - 0.5) < 0.42) & (off < NEAR)
    return found


def _mixture(
    color: Float[np.ndarray, "*n 3"], low: Float[np.ndarray, "*n 3"], high: np.ndarray
) -> tuple[Float[np.ndarray, " *n"], Float[np.ndarray, " *n"], Float[np.ndarray, " *n"]]:
    """Return the share of `high` in the nearest mixture, how far it is off, and how far apart."""
    way = high - low
    length = np.square(way).sum(axis=-1)
    part = (((color - low) * way).sum(axis=-1) / np.maximum(length, 1e-6)).clip(0, 1)
    off = np.linalg.norm(color - low - part[..., None] * way, axis=-1)
    return part, off, np.sqrt(length)


@dataclass(frozen=True, eq=False)
class Shares:
    """Pixels in one or two colours.

    Attributes:
        cover: of paint.
        ink: of the outline.
        first, second: numbers of colours; the same where there is one.
        part: of the second.
        clear: how far borders are to be followed closely, 0 to 1.
    """

    cover: Share
    ink: Share
    first: Labels
    second: Labels
    part: Share
    clear: Share

    @property
    def labels(self) -> Labels:
        """Return the number of every pixel's larger share, NONE beside the figure."""
        larger = np.where(self.part > 0.5, self.second, self.first)
        return np.where(self.cover + self.ink >= SOLID, larger, NONE)

    def of(self, chosen: Bool[np.ndarray, " colors"], at: Box) -> Share:
        """Return the share of every pixel of a box that some colours cover."""
        part = self.part[at]
        paint = np.where(chosen[self.first[at]], 1 - part, 0)
        paint += np.where(chosen[self.second[at]], part, 0)
        return self.cover[at] * paint + chosen[-1] * self.ink[at]


def explained(picture: Picture) -> tuple[Colors, Shares]:
    """Return a picture's colours, and every pixel's shares of them."""
    color, inner = picture.color, picture.pure & ~picture.rim
    flat = color[inner & (picture.contrast < STEP)]
    colors = _common(flat, np.ones(len(flat)), RARE, picture.known)
    if len(colors) == len(picture.known):  # nothing is flat
        mean = color[picture.cover >= min(SOLID, float(picture.cover.max()))].mean(axis=0)
        colors = np.concatenate([colors, mean[None]])
    shares, off = _shares(picture, colors)
    left = (off > UNEXPLAINED) & inner
    more = _common(color[left], off[left], CRUMB, colors)
    return (more, _shares(picture, more)[0]) if len(more) > len(colors) else (colors, shares)


def _common(
    pixels: Float[np.ndarray, "n 3"], weights: Float[np.ndarray, " n"], least: float, known: Colors
) -> Colors:
    """Return known colours, then the weightiest one that is near to none of them, and so on."""
    level = np.rint(pixels * 31).astype(np.int64) @ np.array([1024, 32, 1])
    kinds, where = np.unique(level, return_inverse=True)
    left = np.bincount(where, weights, len(kinds))
    sums = [np.bincount(where, weights * pixels[:, c], len(kinds)) for c in range(3)]
    means = np.stack(sums, axis=1) / left[:, None]
    for one in known:
        left[np.linalg.norm(means - one, axis=1) < NEAR] = 0
    found = list(known)
    while len(found) < COLORS and left.max(initial=0) > 0:
        away = np.linalg.norm(means - means[left.argmax()], axis=1)
        if left[away < NEAR].sum() >= least:
            core = (away < NEAR / 2) & (left > 0)
            found.append(np.average(means[core], axis=0, weights=left[core]))
        left[away < NEAR] = 0
    return np.array(found, np.float32).reshape(-1, 3)


def _shares(picture: Picture, colors: Colors) -> tuple[Shares, Share]:
    """Return every pixel's explanation by the colours around, and how far it is off."""
    color, pens = picture.color, len(picture.known)
    square = np.square(color).sum(axis=-1)[..., None] + np.square(colors).sum(axis=-1)
    far = np.sqrt(np.maximum(square - 2 * color @ colors.T, 0))
    single = far.argmin(axis=-1)
    off = far.min(axis=-1)
    pure = picture.pure & (off < NEAR) & (~picture.rim | (single < pens))
    side = (picture.around_px, picture.around_px)
    around = np.stack(
        [
            cv2.boxFilter((pure & (single == k)).astype(np.float32), -1, side, normalize=False)
            for k in range(len(colors))
        ],
        axis=-1,
    )
    own = np.take_along_axis(around, single[..., None], axis=-1)[..., 0]
    at = ~(pure & (own >= FEWEST) & is_uniform(single)) & (picture.cover > 0)
    common = np.argsort(-around[at], axis=1, kind="stable")[:, :MOST].T
    seen = np.take_along_axis(around[at].T, common, axis=0) >= FEWEST
    shown, beside = color[at], picture.rim[at] & (pens > 0)
    best = _Best(single[at], single[at].copy(), np.zeros(len(shown)), off[at].astype(np.float64))
    best.least[seen[0]] = np.inf
    every = np.arange(len(shown))
    for one, there in zip(common, seen, strict=True):
        penless = PENLESS * (beside & (one >= pens))
        best.try_(every, one, one, 0.0, np.where(there, far[at][every, one] + penless, np.inf))
    for (one, _), (other, there) in itertools.combinations(zip(common, seen, strict=True), 2):
        part, away, _ = _mixture(shown, colors[one], colors[other])
        away = away + MIXED + PENLESS * (beside & (np.minimum(one, other) >= pens))
        best.try_(every, one, other, part, np.where(there, away, np.inf))
    rest = np.flatnonzero(best.least > NEAR)
    for (one, there), k in itertools.product(zip(common, seen, strict=True), range(len(colors))):
        part, away, apart = _mixture(shown[rest], colors[one[rest]], colors[k])
        away = away + (0 if k < pens else AFAR + PENLESS * beside[rest])
        away = np.where(there[rest] & (apart > STEP), away, np.inf)
        best.try_(rest, one[rest], np.full(len(rest), k), part, away)
    first, second, part = single.copy(), single.copy(), np.zeros(single.shape)
    first[at], second[at], part[at], off[at] = best.first, best.second, best.part, best.least
    return Shares(picture.cover, picture.ink, first, second, part, np.ones_like(part)), off


@dataclass(frozen=True, eq=False)
class _Best:
    """The best explanations so far; see `Shares`. `least` is how far they are off."""

    first: Int[np.ndarray, " n"]
    second: Int[np.ndarray, " n"]
    part: Float[np.ndarray, " n"]
    least: Float[np.ndarray, " n"]

    def try_(
        self,
        at: Int[np.ndarray, " some"],
        first: Int[np.ndarray, " some"],
        second: Int[np.ndarray, " some"],
        part: Float[np.ndarray, " some"] | float,
        off: Float[np.ndarray, " some"],
    ) -> None:
        """Take another explanation where it is nearer."""
        better = off < self.least[at]
        where = at[better]
        self.first[where], self.second[where] = first[better], second[better]
        self.part[where] = part[better] if isinstance(part, np.ndarray) else part
        self.least[where] = off[better]
