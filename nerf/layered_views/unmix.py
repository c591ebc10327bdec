"""Find the two paints that a pixel is a mixture of, by its colour and the areas around it.

Colours say more than labels: where a view is a drawing itself, its labels lie a little beside. A
paint's core is an area whose pixels have its very colour; a soft border is a mixture of two paints
with cores nearby. Blends that happen to look like a third paint have no core and are none of it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.palette.palette import Shadow
from toonset.palette.pixels.ramp_recolor import find_shaded_mixtures
from toonset.raster import dilate, from_nearest

PARTS = 16  # of a mixture
LIKE = 9.0  # levels of 255: a colour so near to its paint is that paint
# Pixels: the side of a window, paints in which may be in a mixture, the commonest COMMON; and how
# far a labelled area names a paint
AROUND = 7
COMMON = 4
BETTER = 1.15  # a mixture explains a colour so much better, squared, or it is none
LINELESS = 2.0  # the same of one without the line's colour, where there are lines
FAR = 26.0  # levels of 255: a colour so far from all shades of its mixture is none of it
ELSE = 2.0  # times LIKE: so much worse is a paint that is not around
STRANGE = 2.5  # times LIKE: what is not so like it is not that paint (under ink: 1)
SHADED = 1.5  # times LIKE: so much worse is a shade of a paint
DARKEST, BRIGHTEST = 0.3, 1.25  # shades of a paint
BAND = 7  # pixels of a window that a paint's core has; blends along a border have less
AREA = 21  # pixels of a window: a blend along a border, three rows of it at most, has no more
THREE = np.ones((3, 3), np.uint8)
TWO = np.ones((2, 2), np.uint8)  # pixels: what is thinner the lossy picture of tints loses

Map = UInt8[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
Colors = UInt8[np.ndarray, "paints 3"]


@dataclass(eq=False)
class Unmixed:
    """Paints of every pixel.

    Attributes:
        first, second: (height, width) paints.
        part: (height, width) of the second, 0 to PARTS / 2.
        stays: (height, width) no shade of its paints, it does not change with them.
    """

    first: Map
    second: Map
    part: Map
    stays: Mask

    def share(self, paint: int) -> Float[np.ndarray, "height width"]:
        """Return how much of every pixel a paint covers."""
        part = self.part.astype(np.float32) / PARTS
        return (self.first == paint) * (1 - part) + (self.second == paint) * part

    def rename(self, old: int, new: int, where: Mask) -> None:
        """Give a paint another number in some pixels."""
        for paints in (self.first, self.second):
            paints[where & (paints == old)] = new

    def lift(self, line: int, where: Mask) -> Float[np.ndarray, "height width"]:
        """Take a line's paint out of some pixels and return its share; the paint beside goes on."""
        share = np.where(where, self.share(line), 0).astype(np.float32)
        at = share > 0
        other = np.where(self.first == line, self.second, self.first)
        known = other != line
        if at.any() and known.any():
            other = from_nearest(other, known)
            self.first[at] = self.second[at] = other[at]
            self.part[at], self.stays[at] = 0, False
        return share

    def colors(self, paints: Float[np.ndarray, "paints 3"]) -> Float[np.ndarray, "h w 3"]:
        """Return every pixel's mixture of some paints."""
        one, other = paints[self.first], paints[self.second]
        return one + (self.part.astype(np.float32) / PARTS)[..., None] * (other - one)


def unmixed(
    color: UInt8[np.ndarray, "height width 3"],
    labels: Map,
    there: Mask,
    paints: Colors,
    line: int | None,
    shadow: Shadow | None,
) -> Unmixed:
    """Return the paints of every pixel.

    Args:
        color: straight.
        labels: of `paints`; they count where no core is near.
        there: where anything is.
        paints: that may be found.
        line: the paint of lines, which are thin; None: there are none.
        shadow: that the drawings have.
    """
    known = paints.astype(np.float32)
    named = [_named(labels == number) for number in range(len(paints))]
    if line is not None:
        named[line] = np.ones_like(there)
    first, part, stays = labels.copy(), np.zeros_like(labels), np.zeros_like(there)
    cores = _cores(color, there, known, line, named)
    if shadow is not None:
        cores = _in_light(cores, labels, known * np.array(shadow.factor, np.float32), known)
    settled = np.zeros_like(there)
    for number, core in cores.items():
        settled |= core
        first[core] = number
    at = np.flatnonzero(there & ~settled)
    own = color.reshape(-1, 3)[at].astype(np.float32)
    second = first.copy()
    near = _Near.of(cores, first, labels, there, at, line)
    around = np.stack([one.take(at) for one in named])
    for number, core in cores.items():
        around[number] |= dilate(core, AROUND).take(at)
    a, b, t, off = near.best(own, known, line, around)
    if shadow is not None:  # the same in shadow
        dark = near.best(
            (own / np.array(shadow.factor)).clip(0, 255).astype(np.float32), known, line, around
        )
        a, b, t = (np.where(dark[3] < off, *pair) for pair in zip(dark, (a, b, t), strict=False))
    steps = np.rint(t * PARTS)
    less = steps > PARTS / 2
    a, b, steps = np.where(less, b, a), np.where(less, a, b), np.where(less, PARTS - steps, steps)
    b = np.where(steps > 0, b, a)
    for whole, values in ((first, a), (second, b), (part, steps)):
        whole.reshape(-1)[at] = values
    cover = known[a] + (steps / PARTS).astype(np.float32)[:, None] * (known[b] - known[a])
    stays.reshape(-1)[at] = _off_shade(own, cover) > FAR**2
    stays &= cv2.morphologyEx(stays.view(np.uint8), cv2.MORPH_OPEN, TWO).view(np.bool_)
    return Unmixed(first, second, part, stays)


def unmixed_shaded(color: UInt8[np.ndarray, "height width 3"], labels: Map, there: Mask) -> Unmixed:
    """Return the paints of every pixel of drawings that are shaded throughout.

    Args:
        color: straight.
        labels: of paints.
        there: where anything is.
    """
    found = find_shaded_mixtures(color, labels, there)
    part = np.rint(PARTS * found.share).astype(np.uint8)
    second = np.where(part > 0, found.second, found.first)
    return Unmixed(found.first, second, part, np.zeros_like(there))


def _cores(
    color: UInt8[np.ndarray, "h w 3"],
    there: Mask,
    known: Float[np.ndarray, "paints 3"],
    line: int | None,
    named: Sequence[Mask],
) -> dict[int, Mask]:
    """Return the areas that surely are a paint, by its number.

    Labels nearby name it, or the area is too wide for a blend.
    """
    like = np.zeros(there.shape, np.uint8)
    least = np.where(there, np.float32(LIKE**2), np.float32(-1))
    sure = np.zeros_like(there)
    flat = color.astype(np.float32)
    for number, paint in enumerate(known):
        way = flat - paint
        off = np.einsum("hwk,hwk->hw", way, way)
        nearer = off <= least
        like[nearer], least[nearer] = number, off[nearer]
        sure |= nearer
    cores = {}
    for number in np.unique(like[sure]).tolist():
        own = sure & (like == number)
        core, count = own, _counts(own)
        if number != line:
            core = own & (count >= BAND) & (named[number] | (count > AREA))
        if core.any():
            cores[number] = core
    return cores


def _in_light(
    cores: dict[int, Mask],
    labels: Map,
    dark: Float[np.ndarray, "paints 3"],
    known: Float[np.ndarray, "paints 3"],
) -> dict[int, Mask]:
    """Return cores that are another paint in shadow, unless labels say that they are none."""
    found = {number: core.copy() for number, core in cores.items()}
    for number, core in cores.items():
        off = _apart(dark, known[number])
        off[number] = np.inf
        lit = int(off.argmin())
        if off[lit] <= LIKE**2:
            moved = core & (labels != number)
            found[number] &= ~moved
            found[lit] = found.get(lit, np.zeros_like(core)) | moved
    return found


@dataclass(frozen=True, eq=False)
class _Near:
    """What lies around some pixels.

    Attributes:
        common: (COMMON, n) the commonest paints around, or fewer.
        count: (COMMON, n) pixels of each in the window.
    """

    common: Int[np.ndarray, "k n"]
    count: Int[np.ndarray, "k n"]

    @classmethod
    def of(
        cls,
        cores: dict[int, Mask],
        first: Map,
        labels: Map,
        there: Mask,
        at: Int[np.ndarray, " n"],
        line: int | None,
    ) -> _Near:
        """Return what lies around the pixels of these numbers: cores, or else labels.

        Lines may be anywhere: they are too thin to show their colour.
        """
        lines = [] if line is None else [line]
        numbers = np.union1d(np.unique(labels[there]), [*cores, *lines]).astype(np.int64)
        around = np.zeros((len(at), len(numbers)), np.int16)
        loose = np.zeros_like(around)
        for i, one in enumerate(numbers.tolist()):
            if one in cores:
                around[:, i] = _counted(cores[one], at)
            loose[:, i] = _counted(there & (labels == one), at)
        areas = np.zeros_like(there)
        for one, core in cores.items():
            areas |= core & (one != line)
        bare = around.max(axis=1, initial=0) == 0
        around[bare] = loose[bare]
        if line is not None:
            around[:, numbers == line] += 1
        if areas.any():
            nearest = np.searchsorted(numbers, from_nearest(first, areas).take(at))
            around[np.arange(len(at)), nearest] += 1
        rows, order, count = np.arange(len(at)), [], []
        for _ in range(min(COMMON, len(numbers))):
            most = around.argmax(axis=1)
            order.append(most)
            count.append(around[rows, most])
            around[rows, most] = -1
        return cls(numbers[np.stack(order)], np.stack(count))

    def best(
        self,
        color: Float[np.ndarray, "n 3"],
        known: Float[np.ndarray, "paints 3"],
        line: int | None,
        named: Bool[np.ndarray, "paints n"],
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the two paints that explain each colour best, the second's share, how far off.

        One paint, its shade or two of those that lie around; others, alone or under ink, only where
        these are far off.
        """
        a = self.common[0].copy()
        least = np.full(len(color), np.inf, np.float32)
        for one, count in zip(self.common, self.count, strict=True):
            shade = _off_shade(color, known[one]) + (SHADED * LIKE) ** 2
            off = np.minimum(_apart(color, known[one]), shade)
            better = (count > 0) & (off < least)
            a, least = np.where(better, one, a), np.where(better, off, least)
        b, t = a.copy(), np.zeros(len(color), np.float32)
        for i, j in itertools.combinations(range(len(self.common)), 2):
            one, other = known[self.common[i]], known[self.common[j]]
            way = other - one
            share = (_dot(color - one, way) / np.maximum(_dot(way, way), 1)).clip(0, 1)
            away = _apart(color, one + share[:, None] * way)
            lined = (self.common[i] == line) | (self.common[j] == line)
            away = np.where(lined, BETTER, LINELESS if line is not None else BETTER) * away
            better = (self.count[j] > 0) & (away < least)
            a, b = (np.where(better, self.common[n], old) for n, old in ((i, a), (j, b)))
            t, least = np.where(better, share, t), np.where(better, away, least)
        off, share = (np.empty((len(known), len(color)), np.float32) for _ in range(2))
        for number, paint in enumerate(known):
            way = (paint if line is None else known[line]) - paint
            share[number] = ((color - paint) @ way / max(float(way @ way), 1)).clip(0, 1)
            off[number] = _apart(color, paint + share[number][:, None] * way)
        off[~named] = np.inf
        like, each = off.argmin(axis=0), np.arange(len(color))
        off, share = off[like, each] + (ELSE * LIKE) ** 2, share[like, each]
        strayed = np.where(share > 0, LIKE, STRANGE * LIKE)
        strange = (off <= (ELSE * LIKE) ** 2 + strayed**2) & (off < least)
        a, b = np.where(strange, like, a), np.where(strange, like if line is None else line, b)
        return a, b, np.where(strange, share, t), np.where(strange, off, least)


def _named(labelled: Mask) -> Mask:
    """Return where labels name a paint: near areas of it, not near the blends of a border."""
    area = cv2.morphologyEx(labelled.view(np.uint8), cv2.MORPH_OPEN, THREE)
    return dilate(area > 0, AROUND)


def _counted(mask: Mask, at: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """Return how many pixels of a mask lie in the windows round some pixels."""
    return np.asarray(_counts(mask).take(at))


def _counts(mask: Mask) -> UInt8[np.ndarray, "height width"]:
    """Return how many pixels of a mask lie in the window round every pixel."""
    return np.asarray(cv2.boxFilter(mask.view(np.uint8), -1, (AROUND, AROUND), normalize=False))


def _off_shade(
    color: Float[np.ndarray, "n 3"], paint: Float[np.ndarray, "*n 3"]
) -> Float[np.ndarray, " n"]:
    """Return how far colours are from the nearest shade of a paint, squared."""
    shade = (color * paint).sum(axis=1) / np.maximum(np.square(paint).sum(axis=-1), 1)
    return _apart(color, shade.clip(DARKEST, BRIGHTEST)[:, None] * paint)


def _apart(
    color: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "*n 3"]
) -> Float[np.ndarray, " n"]:
    way = color - other
    return _dot(way, way)


def _dot(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    return np.einsum("nk,nk->n", a, b)
