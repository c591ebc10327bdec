"""Trace a view in the drawn look: closed smooth paths of filled regions, a colour each.

1. Colours. The pen's, the commonest ones of flat places, then those that no mixture of two colours
   around explains.
2. Shares. Every pixel is one colour, or t of one and 1 - t of another that are seen around it,
   whichever is nearer. Beside an outline one of them is the pen's. Parts that change little if they
   take the colour beside them do.
3. Stack. Large paints lie below small ones, lines on top. A region's border is where half of a
   pixel is its own. Where a higher region meets it, it goes on beneath that one, and holes that
   only higher regions fill are filled: no reader shows a gap between neighbours.
4. Curves. See `bezier`.

Sources: Porter and Duff, "Compositing Digital Images", 1984 (coverage that adds up); Selinger,
"Potrace: a polygon-based tracing algorithm", 2003 (outlines of regions, one upon the other).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from skimage.measure import find_contours, label

from toonset.nerf.look.drawn_view import SOLID, DrawnView
from toonset.nerf.look.outline import Outline
from toonset.nerf.render.bezier import Curve, Points, fit_closed
from toonset.raster import (
    connected_to,
    dilate,
    distance_to,
    from_nearest,
    is_uniform,
    parts,
    sized_parts,
)

LINES = -1  # the paint of lines
OFF_PX = 0.2  # how far a curve may be off the border that it follows
MOST_PX = 1600  # longest side: larger views are traced smaller
NEAR = 0.06  # of colours (Euclidean, channels in [0, 1]): nearer ones count as one
SAME = 4 / 255  # of a channel: a mean of pixels that is so near to a paint is that paint
STEP = 0.12  # of colours: less between neighbours is no edge
MIXED = 0.02  # by how much two colours must explain a pixel better than one
AFAR = 0.03  # the same, if the second is not seen around
PENLESS = 0.1  # the same beside the outline, without the pen's colour
UNCLEAR = 0.2  # of colours, off a pixel's explanation: its border is smoothed
UNEXPLAINED = 0.12  # the same: it may be a colour of its own
AROUND_PX, FEWEST, MOST = 7, 3, 4  # window in which colours are looked for, pixels of one, how many
COLORS, RARE = 48, 2  # of a view at most; flat pixels of a colour, each amid its own
CRUMB = 1.0  # pixels times colour that a part must differ by from what is beside it
ROUNDS = 8  # of taking crumbs away
BENEATH_PX = 2.0  # by which regions go on beneath those above
LEAST_PX = 0.5  # area of a path
CRISPER = 0.5  # of what a blur takes away, put on top: thin lines stay whole
NONE = -1

Mask = Bool[np.ndarray, "height width"]
Share = Float[np.ndarray, "height width"]
Color = Float[np.ndarray, "height width 3"]
Colors = Float[np.ndarray, "colors 3"]
Labels = Int[np.ndarray, "height width"]
Box = tuple[slice, slice]  # rows and columns
Shape = tuple[Curve, ...]


@dataclass(frozen=True, eq=False)
class Region:
    """What a view shows in one colour.

    Attributes:
        paint: its number; LINES.
        rgb: sRGB bytes.
        shapes: connected parts, each its outline and then its holes; pixels of the view.
    """

    paint: int
    rgb: tuple[int, int, int]
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, eq=False)
class Vectors:
    """A traced view.

    Attributes:
        size_wh: of the view, pixels.
        regions: the lowest first; those of a paint follow one another, lines are last.
    """

    size_wh: tuple[int, int]
    regions: tuple[Region, ...]


def trace(
    view: DrawnView,
    paints: UInt8[np.ndarray, "paints 3"],
    pen: Outline | None,
    enlarged: float = 1.0,
) -> Vectors:
    """Return a view as regions; none where nothing is seen.

    Args:
        view: in the drawn look.
        paints: colours of its labels.
        pen: that drew its lines, `width_px` in the view's pixels; None: there are none.
        enlarged: the view's pixels in one of the drawings: an enlarged one is traced smaller.
    """
    height, width = view.alpha.shape
    by = min(1.0, 1 / enlarged, MOST_PX / max(height, width))
    smaller = (max(1, round(by * width)), max(1, round(by * height)))
    if by < 1:
        view = _resized(view, smaller)
        pen = pen and replace(pen, width_px=pen.width_px * by)
    box = _box(view.alpha >= SOLID)
    if box is None:
        return Vectors((width, height), ())
    view = DrawnView(*(getattr(view, name)[box] for name in DrawnView.__annotations__))
    picture = _Picture.of(view, pen)
    colors, shares = _explained(picture)
    colors = _as_paints(colors, paints)
    shares = _without_crumbs(shares, colors, picture.color)
    of_colors = _paints_of(colors, paints, shares.labels, view.labels)
    shares = _with_borders(shares, colors, picture)
    colors, of_colors, shares = _with_lines(colors, of_colors, shares, picture, pen)
    corner = np.array([box[1].start, box[0].start])
    scale = np.array(smaller) / (width, height)  # in whole pixels
    outline = (shares.ink > shares.cover) & (shares.labels != NONE)
    labels = np.where(outline, len(colors) - 1, shares.labels)
    like_pen = (np.linalg.norm(colors - colors[-1], axis=1) < NEAR) & (pen is not None)
    like_pen[-1] = False
    stack = _Stack(colors, tuple(of_colors), like_pen, shares, labels)
    return Vectors((width, height), stack.regions(corner, scale))


def _resized(view: DrawnView, size: tuple[int, int]) -> DrawnView:
    """Return a smaller view, `size` wide and high."""
    how = {"labels": cv2.INTER_NEAREST, "source": cv2.INTER_NEAREST}
    return DrawnView(
        *(
            cv2.resize(getattr(view, name), size, interpolation=how.get(name, cv2.INTER_AREA))
            for name in DrawnView.__annotations__
        )
    )


def _box(there: Mask) -> Box | None:
    """Return rows and columns of a figure, with two pixels round it."""
    if not there.any():
        return None
    x, y, width, height = cv2.boundingRect(there.view(np.uint8))
    return slice(max(0, y - 2), y + height + 2), slice(max(0, x - 2), x + width + 2)


@dataclass(frozen=True, eq=False)
class _Picture:
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
    def of(cls, view: DrawnView, pen: Outline | None) -> _Picture:
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
class _Shares:
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


def _explained(picture: _Picture) -> tuple[Colors, _Shares]:
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


def _shares(picture: _Picture, colors: Colors) -> tuple[_Shares, Share]:
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
    return _Shares(picture.cover, picture.ink, first, second, part, np.ones_like(part)), off


@dataclass(frozen=True, eq=False)
class _Best:
    """The best explanations so far; see `_Shares`. `least` is how far they are off."""

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


def _without_crumbs(shares: _Shares, colors: Colors, color: Color) -> _Shares:
    """Return shares without parts that might as well have the colour of a larger part beside."""
    for _ in range(ROUNDS):
        labels = shares.labels
        numbers: Labels = np.asarray(label(labels, background=NONE, connectivity=1))
        count = int(numbers.max())
        beside = _beside(numbers, count, labels, colors, color)
        there = beside[numbers] != NONE
        own, other = colors[labels[there]], colors[beside[numbers[there]]]
        more = np.linalg.norm(color[there] - other, axis=-1)
        more -= np.linalg.norm(color[there] - own, axis=-1)
        crumb = (np.bincount(numbers[there], more, count + 1) < CRUMB) & (beside != NONE)
        if not crumb.any():
            break
        gone, new = crumb[numbers], beside[numbers]
        first, second = (np.where(gone, new, old) for old in (shares.first, shares.second))
        shares = _supported(replace(shares, first=first, second=second), len(colors))
    return shares


def _beside(
    numbers: Labels, count: int, labels: Labels, colors: Colors, color: Color
) -> Int[np.ndarray, " parts"]:
    """Return the colour of the larger part beside each that is most like it; NONE without one."""
    area = np.bincount(numbers.ravel(), minlength=count + 1)
    sums = [np.bincount(numbers.ravel(), color[..., c].ravel(), count + 1) for c in range(3)]
    means = np.stack(sums, axis=1) / np.maximum(area, 1)[:, None]
    codes = []
    for left, right in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        for one, other in ((left, right), (right, left)):
            a, b = numbers[one], numbers[other]
            larger = (area[b] > area[a]) | ((area[b] == area[a]) & (b > a))
            meet = larger & (a > 0) & (b > 0)
            codes.append(a[meet].astype(np.int64) * len(colors) + labels[other][meet])
    own, near = np.divmod(np.unique(np.concatenate(codes)), len(colors))
    order = np.lexsort([np.linalg.norm(means[own] - colors[near], axis=1), own])
    kinds, firsts = np.unique(own[order], return_index=True)
    beside = np.full(count + 1, NONE)
    beside[kinds] = near[order[firsts]]
    return beside


def _supported(shares: _Shares, colors: int) -> _Shares:
    """Return shares without those of colours that no pixel beside shows most of."""
    labels = shares.labels
    first_ok, second_ok = (np.zeros(labels.shape, dtype=bool) for _ in range(2))
    for k in range(colors):
        near = dilate(labels == k)
        first_ok |= near & (shares.first == k)
        second_ok |= near & (shares.second == k)
    first = np.where(first_ok | ~second_ok, shares.first, shares.second)
    return replace(shares, first=first, second=np.where(second_ok, shares.second, first))


def _with_borders(shares: _Shares, colors: Colors, picture: _Picture) -> _Shares:
    """Return shares that know which borders are clear: strong, and explained."""
    first, second = colors[shares.first], colors[shares.second]
    mixed = first + shares.part[..., None] * (second - first)
    off = np.linalg.norm(picture.color - mixed, axis=-1) > UNCLEAR
    clear = (picture.contrast > STEP) & ~dilate(off, 2)
    smooth = cv2.GaussianBlur(clear.astype(np.float32), (0, 0), 1.0)
    return replace(shares, clear=np.where(picture.cover > 1 - MIXED, smooth, 1))


def _as_paints(colors: Colors, paints: UInt8[np.ndarray, "paints 3"]) -> Colors:
    """Return the colours, exactly a paint's where averaging has moved them off it."""
    away = np.abs(paints / np.float32(255) - colors[:, None]).max(axis=-1, initial=0)
    if not away.size:
        return colors
    like = away.min(axis=1) < SAME
    return np.where(like[:, None], paints[away.argmin(axis=1)] / np.float32(255), colors)


def _paints_of(
    colors: Colors,
    paints: UInt8[np.ndarray, "paints 3"],
    own: Labels,
    labels: UInt8[np.ndarray, "height width"],
) -> list[int]:
    """Return the paint of every colour: the one that it is, else that most of its pixels have."""
    found = []
    for k, color in enumerate(colors):
        away = np.linalg.norm(paints / 255.0 - color, axis=1)
        same = away.min(initial=np.inf) < NEAR
        most = np.bincount(labels[own == k], minlength=1)
        found.append(int(away.argmin() if same else most.argmax()))
    return found


def _with_lines(
    colors: Colors, paints: list[int], shares: _Shares, picture: _Picture, pen: Outline | None
) -> tuple[Colors, list[int], _Shares]:
    """Return colours, paints and shares with lines as the last colour.

    Lines are the outline, and what is as thin and in a colour like the pen's.
    """
    lines = len(colors)
    tone = picture.known if pen is not None else np.zeros((1, 3), np.float32)
    every = np.concatenate([colors, tone]), [*paints, LINES]
    if pen is None:
        return *every, shares
    inky = np.linalg.norm(colors - tone, axis=1) < STEP
    drawn = inky[shares.labels] & (shares.labels != NONE)
    thick = drawn & (distance_to(~drawn) > 0.9 * pen.width_px + 0.5)
    line = drawn & (distance_to(thick) > 1.9 * pen.width_px if thick.any() else True)
    numbers, areas = sized_parts(line)
    body = connected_to(thick, drawn)  # ends of it are no lines
    line &= ~body | (areas >= (3 * pen.width_px) ** 2)[numbers]
    first, second = (
        np.where(dilate(line) & inky[one], lines, one) for one in (shares.first, shares.second)
    )
    return *every, replace(shares, first=first, second=second)


@dataclass(frozen=True, eq=False)
class _Stack:
    """Colours that are to lie on each other.

    Attributes:
        colors, paints: of the shares, lines last.
        like_pen: colours that lines go on over, for nobody sees where they end there.
        shares: of every pixel.
        labels: those of the shares, lines where the outline is.
    """

    colors: Colors
    paints: tuple[int, ...]
    like_pen: Bool[np.ndarray, " colors"]
    shares: _Shares
    labels: Labels

    def order(self) -> list[int]:
        """Return the colours, the lowest first: large paints, in them large ones; lines last."""
        areas = np.bincount(self.labels[self.labels != NONE], minlength=len(self.paints))
        whole = dict.fromkeys(self.paints, 0)
        for paint, area in zip(self.paints, areas.tolist(), strict=True):
            whole[paint] += area

        def place(k: int) -> tuple[bool, int, int, int, int]:
            paint = self.paints[k]
            return paint == LINES, -whole[paint], paint, -int(areas[k]), k

        return sorted(np.flatnonzero(areas).tolist(), key=place)

    def regions(
        self, corner: Int[np.ndarray, " 2"], scale: Float[np.ndarray, " 2"]
    ) -> tuple[Region, ...]:
        """Return the regions, the lowest first.

        Args:
            corner: of the picture in its view.
            scale: pixels of the picture in one of the result, across and down.
        """
        above = np.ones(len(self.colors), dtype=bool)
        borders: dict[int, list[Points]] = {}
        order = self.order()
        for k in order:
            above[k] = False
            under = self.like_pen if self.paints[k] == LINES else above
            borders[k] = [points + corner for points in self._borders(k, under)]
        curves = iter(fit_closed(list(itertools.chain.from_iterable(borders.values())), OFF_PX))
        found = []
        for k in order:
            mine = [curve / scale for curve in itertools.islice(curves, len(borders[k]))]
            red, green, blue = np.rint(255 * self.colors[k]).astype(int).tolist()
            if mine:
                shapes = _shapes(borders[k], mine)
                found.append(Region(self.paints[k], (red, green, blue), shapes))
        return tuple(found)

    def _borders(self, k: int, above: Bool[np.ndarray, " colors"]) -> list[Points]:
        """Return the contours of a colour and of what it goes on under; lines go on above."""
        x, y, width, height = cv2.boundingRect((self.labels == k).view(np.uint8))
        x, y = max(0, x - 3), max(0, y - 3)
        at = (slice(y, y + height + 6), slice(x, x + width + 6))
        labels, own = self.labels[at], np.arange(len(self.colors)) == k
        mask, outside = labels == k, labels == NONE
        holes = parts(~mask, connectivity=4)
        lower = ~(above[labels] & ~outside) | (self.paints[k] == LINES)
        filled = np.bincount(holes.ravel(), lower.ravel()) == 0
        filled[[0, *holes[[0, -1]].ravel(), *holes[:, [0, -1]].ravel()]] = False
        reach = np.clip(BENEATH_PX + 1 - distance_to(mask), 0, 1)
        reach = np.maximum(reach, dilate(filled[holes]))
        reach = np.minimum(reach, np.clip(distance_to(outside) - 1, 0, 1))
        field = self.shares.of(own, at) + reach * self.shares.of(above, at)
        field, clear = np.pad(field, 2), np.pad(self.shares.clear[at], 2, mode="edge")
        soft = cv2.GaussianBlur(field, (0, 0), 1.0)
        field = soft + clear * (1 + CRISPER) * (field - soft)
        finer = cv2.resize(
            field.astype(np.float32), None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC
        )
        found = [(points[:-1, ::-1] + 0.5) / 2 - 2 + (x, y) for points in find_contours(finer, 0.5)]
        return [points for points in found if len(points) > 2 and abs(_area(points)) > LEAST_PX]


def _shapes(contours: Sequence[Points], curves: Sequence[Curve]) -> tuple[Shape, ...]:
    """Return outlines, each with its holes: those that lie in it and in no smaller one."""
    areas = [_area(points) for points in contours]
    shapes = {i: [i] for i, area in enumerate(areas) if area > 0}
    for i, area in enumerate(areas):
        if area > 0:
            continue
        x, y = contours[i][0].tolist()
        around = [
            j
            for j in shapes
            if areas[j] > -area
            and cv2.pointPolygonTest(contours[j].astype(np.float32), (x, y), measureDist=False) >= 0
        ]
        if around:
            shapes[min(around, key=areas.__getitem__)].append(i)
    return tuple(tuple(curves[i] for i in part) for part in shapes.values())


def _area(points: Points) -> float:
    """Return the area within a contour, negative for a hole."""
    x, y = points.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)
