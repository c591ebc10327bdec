"""Take a drawn view apart into what a page puts together again in any colours.

    colour = ((1 - t) a + t b + rest) (1 - ink) + pen ink

a and b are paints; most pixels have one, those along borders are mixtures of two. `rest` is what
paints do not explain: shadow, grain, features without a paint of their own. When a paint changes, a
colour moves by `moved` times the change of its mixture, as in `toonset.palette.pixels.recolor`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, Int8, Int16, UInt8

from toonset.nerf.look.blend import DrawnView
from toonset.palette.palette import Shadow
from toonset.palette.pixels.recolor import share_moved

LEVELS = 15  # of alpha and ink, from nothing to all
PARTS = 8  # of a mixture
MOVES = np.array([1, 0, 0.4, 0.7, 0.87, 1.15])  # kinds of `moved`; 0: as the mixture
LIKE = 6.0  # levels of 255: a colour so near to its paint is that paint
EXACT = 1.5 / 255  # so well do paint and ink make up a pixel, or it is a drawing's own
INKED = 16 / 255  # so near to a mixture of paint and pen a drawing's pixel is one
MOST_INK = 0.9  # of a drawing's pixel, under which its paint is seen
AROUND = 5  # pixels, a window's side: paints in it may be in a mixture, the commonest COMMON
COMMON = 3
BETTER = 1.15  # a mixture explains a colour so much better, squared, or it is none
FAR = 16.0  # levels of 255: a colour not so far from its mixture moves as that does
TWO = np.ones((2, 2), np.uint8)  # pixels: what is thinner the lossy picture of `rest` loses
ELSE = 3.0  # times LIKE: so much worse is a paint that is neither the label nor around

Map = UInt8[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "paints 3"]
Rgb = tuple[int, int, int]
Box = tuple[slice, slice]  # rows and columns


@dataclass(frozen=True, eq=False)
class Layered:
    """A drawn view in layers, cut to the figure.

    Attributes:
        corner: x, y of the first pixel in the view.
        alpha: (height, width) coverage, 0 to LEVELS.
        ink: (height, width) share of the coverage that lines have, 0 to LEVELS.
        first, second: (height, width) paints.
        part: (height, width) of the second, 0 to PARTS / 2.
        moved: (height, width) how far a colour moves with its paints: one of MOVES.
        rest: (height, width, 3) what paints do not explain, levels of 255.
    """

    corner: tuple[int, int]
    alpha: Map
    ink: Map
    first: Map
    second: Map
    part: Map
    moved: Map
    rest: Int16[np.ndarray, "height width 3"]


def layered(
    view: DrawnView, paints: Colors, pen: Rgb | None, shadow: Shadow | None = None
) -> Layered | None:
    """Return a view's layers; None where it shows nothing.

    Args:
        view: in the colours of `paints`.
        paints: that its labels name.
        pen: colour of the lines; None: there are none.
        shadow: that the drawings have.
    """
    there = view.alpha >= 0.5 / LEVELS
    if not there.any():
        return None
    box, corner = _box(there)
    there, alpha = there[box], view.alpha[box].clip(0, 1)
    paint, ink = _under_lines(view, box, there, pen)
    labels = np.where(there, view.labels[box], 0).astype(np.uint8)
    color = np.rint(paint * 255).clip(0, 255).astype(np.uint8)
    share = np.divide(ink, alpha, out=np.zeros_like(alpha), where=there).clip(0, 1)
    cover, line = (
        np.rint(np.where(there, one, 0) * LEVELS).astype(np.uint8) for one in (alpha, share)
    )
    return Layered(corner, cover, line, *_unmixed(color, labels, there, paints, shadow))


def layered_shares(
    shares: Float[np.ndarray, "height width paints"], alpha: Float[np.ndarray, "height width"]
) -> Layered | None:
    """Return a view of pure paints in layers, from the share of every pixel that each covers."""
    there = alpha >= 0.5 / LEVELS
    if not there.any():
        return None
    box, corner = _box(there)
    shares, alpha = shares[box], alpha[box]
    two = np.argsort(-shares, axis=2, kind="stable")[..., :2]
    covered = np.take_along_axis(shares, two, axis=2)
    one, other = covered[..., 0], covered[..., -1]
    first, second = (two[..., i].astype(np.uint8) for i in (0, -1))
    part = np.rint(PARTS * other / np.maximum(one + other, 1e-6)).astype(np.uint8)
    part[second == first] = 0
    none = np.zeros(alpha.shape, np.uint8)
    cover = np.rint(alpha.clip(0, 1) * LEVELS).astype(np.uint8)
    rest = np.zeros((*alpha.shape, 3), np.int16)
    return Layered(corner, cover, none, first, second, part, none, rest)


def _box(there: Mask) -> tuple[Box, tuple[int, int]]:
    """Return the rows and columns that hold all of a mask, and the first column and row."""
    rows, columns = (np.flatnonzero(there.any(axis=axis)) for axis in (1, 0))
    box = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    return box, (int(columns[0]), int(rows[0]))


def _under_lines(
    view: DrawnView, box: Box, there: Mask, pen: Rgb | None
) -> tuple[Float[np.ndarray, "h w 3"], Float[np.ndarray, "h w"]]:
    """Return straight colour and ink that make up exactly what the view shows.

    Near a drawing the view is that drawing, whose pixels are not made of the view's paint and ink.
    """
    rgb, alpha, ink, paint = (part[box] for part in (view.rgb, view.alpha, view.ink, view.paint))
    line = np.array(pen or (0, 0, 0), np.float32) / np.float32(255)
    own = np.zeros(there.shape, dtype=bool)
    for shown, under, over in zip(cv2.split(rgb), cv2.split(paint), line, strict=True):
        own |= np.abs(under * (alpha - ink) + ink * over - shown) > EXACT
    own &= there
    if not own.any():
        return paint, ink
    paint, ink, before = paint.copy(), ink.copy(), paint[own]
    shown = (rgb[own] / alpha[own][:, None]).clip(0, 1)
    way = line - before
    share = (_dot(shown - before, way) / np.maximum(_dot(way, way), 1e-6)).clip(0, 1)
    off = _largest(shown - before - share[:, None] * way)
    share = np.where((off < INKED) & (pen is not None), share, 0)
    left = (shown - share[:, None] * line) / np.maximum(1 - share, 1 - MOST_INK)[:, None]
    paint[own] = np.where((share < MOST_INK)[:, None], left.clip(0, 1), before)
    ink[own] = share * alpha[own]
    return paint, ink


def _unmixed(
    color: UInt8[np.ndarray, "h w 3"],
    labels: Map,
    there: Mask,
    paints: Colors,
    shadow: Shadow | None,
) -> tuple[Map, Map, Map, Map, Int16[np.ndarray, "h w 3"]]:
    """Return the two paints of every pixel, the second one's part, how it moves, and the rest."""
    known = paints.astype(np.float32)
    first, part = labels.copy(), np.zeros_like(labels)
    moved = np.zeros_like(labels)
    rest = color - paints.astype(np.int16).take(labels, axis=0)
    rest[~there] = 0
    at = np.flatnonzero(_largest(rest) > LIKE)
    second = first.copy()
    own = color.reshape(-1, 3)[at]
    near = _Near.of(labels, there, at)
    a, b, t, off = near.best(own.astype(np.float32), known)
    if shadow is not None:  # the same in shadow
        dark = near.best((own / np.array(shadow.factor)).clip(0, 255).astype(np.float32), known)
        a, b, t = (np.where(dark[3] < off, *pair) for pair in zip(dark, (a, b, t), strict=False))
    steps = np.rint(t * PARTS)
    less = steps > PARTS / 2
    a, b, steps = np.where(less, b, a), np.where(less, a, b), np.where(less, PARTS - steps, steps)
    cover = known[a] + (steps / PARTS).astype(np.float32)[:, None] * (known[b] - known[a])
    left = own - cover
    far = np.flatnonzero(_largest(left) > FAR)
    found = np.abs(share_moved(own[far], cover[far])[:, None] - MOVES).argmin(axis=1)
    for whole, where, values in (
        *((first, at, a), (second, at, b), (part, at, steps)),
        (moved, at[far], found),
    ):
        whole.reshape(-1)[where] = values
    rest.reshape(-1, 3)[at] = np.rint(left)
    kept = cv2.morphologyEx((moved > 0).astype(np.uint8), cv2.MORPH_OPEN, TWO)
    moved[kept == 0] = 0
    return first, second, part, moved, rest


@dataclass(frozen=True, eq=False)
class _Near:
    """What lies around some pixels.

    Attributes:
        own: (n,) their labels.
        common: (COMMON, n) the commonest labels around, or fewer.
        count: (COMMON, n) pixels of each in the window.
    """

    own: Int[np.ndarray, " n"]
    common: Int[np.ndarray, "k n"]
    count: Int8[np.ndarray, "k n"]

    @classmethod
    def of(cls, labels: Map, there: Mask, at: Int[np.ndarray, " n"]) -> _Near:
        """Return what lies around the pixels of these numbers."""
        seen = np.unique(labels[there])
        around = np.empty((len(at), len(seen)), np.int8)
        for number, one in enumerate(seen):
            mask = (there & (labels == one)).view(np.uint8)
            whole = cv2.boxFilter(mask, -1, (AROUND, AROUND), normalize=False)
            around[:, number] = whole.take(at)
        rows, order, count = np.arange(len(at)), [], []
        for _ in range(min(COMMON, len(seen))):
            most = around.argmax(axis=1)
            order.append(most)
            count.append(around[rows, most])
            around[rows, most] = -1
        common = seen[np.stack(order)].astype(np.int64)
        return cls(labels.take(at).astype(np.int64), common, np.stack(count))

    def best(
        self, color: Float[np.ndarray, "n 3"], known: Float[np.ndarray, "paints 3"]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the two paints that explain each colour best, the second's share, how far off.

        Of one paint: the label's, or else one that the colour is like. Of two: both lie around.
        """
        apart = np.stack([_dot(way, way) for way in (color - paint for paint in known)], axis=1)
        rows, like = np.arange(len(color)), apart.argmin(axis=1)
        least, other = apart[rows, self.own], apart[rows, like]
        strange = (least > LIKE**2) & (other <= LIKE**2)
        a = np.where(strange, like, self.own)
        least = np.where(strange, other + (ELSE * LIKE) ** 2, least)
        b, t = a.copy(), np.zeros(len(color), np.float32)
        for i, j in itertools.combinations(range(len(self.common)), 2):
            one, other = known[self.common[i]], known[self.common[j]]
            way = other - one
            share = (_dot(color - one, way) / np.maximum(_dot(way, way), 1)).clip(0, 1)
            off = color - one - share[:, None] * way
            away = _dot(off, off)
            better = (self.count[j] > 0) & (BETTER * away < least)
            a, b = (np.where(better, self.common[n], old) for n, old in ((i, a), (j, b)))
            t, least = np.where(better, share, t), np.where(better, away, least)
        return a, b, t, least


def _largest(values: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
    red, green, blue = (np.abs(values[..., i]) for i in range(3))
    return np.maximum(np.maximum(red, green), blue)


def _dot(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    return np.einsum("nk,nk->n", a, b)
