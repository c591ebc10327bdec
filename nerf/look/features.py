"""Carry eyes, mouths, buttons and badges whole.

A feature is a small blot of a drawing. Looked up pixel by pixel over a surface that is a little
wrong it tears, and two drawings that put it in two places show it twice. So features are taken off
the paint and put back as stamps: each moves and foreshortens as one flat piece on the surface, and
the same feature of several drawings is shown once, as the nearest of them drew it, in between their
places.

Sources: blots that a small area opening or closing takes away, Vincent 1993; billboards on a
surface, Rademacher 1999 ("View-dependent geometry").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, Int16, UInt8

from toonset.raster import depth_inside, dilate, distance_to, erode, nearest, sized_parts

if TYPE_CHECKING:
    from toonset.nerf.look.choose import Look

LOOKED_AT_PX = 360.0  # height of the figure: features are found in a copy no larger
LARGEST, LONGEST = 6e-3, 0.2  # of the squared height; of the height
SMALLEST = 6e-5  # of the squared height
CONTRAST, LEVELS = 26, 12  # of 255: blots differ so much from what is round them; steps
STRAY, COARSE = 3e-3, 24  # of the squared height: smaller blots of a view; steps of theirs
ROUND = 1.2  # times the pen's width: the line round a blot is its
INK_LIKE = 90  # of 255: such a colour is a line, which is no paint to go on with
MATTE = (0.03, 0.06)  # of 1: such a difference to the paint without it shows none, or all of it
SEEN = 0.55  # share of a feature that its drawing has to see
GRAZING, WIDEST = (
    0.22,
    2.0,
)  # times its width in the drawing: narrower ones are hidden; wider ones torn
APART = 0.07  # of the figure's height: farther apart are two
ALIKE, SIZES = 0.3, 3.3  # of a channel; times the area
OWN = 0.5  # share of its place that shows its drawing
FEWEST_PX = 6  # of a view
FINE, SOFT = 1.4, 0.4  # pixels of a drawing per pixel of a view: from here on it is blurred; sigma

Mask = Bool[np.ndarray, "height width"]
Picture = Float[np.ndarray, "height width 3"]
Numbers = Int[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class Feature:
    """A small blot of a drawing, with the line round it.

    Attributes:
        rows, columns: of the drawing, that it lies in.
        matte: (rows, columns) how far it covers every pixel, 0 to 1.
        middle: (2,) column and row.
        area: pixels that it covers.
        rgb: (3,) mean colour in [0, 1].
    """

    rows: slice
    columns: slice
    matte: Float[np.ndarray, "rows columns"]
    middle: Float[np.ndarray, " 2"]
    area: float
    rgb: Float[np.ndarray, " 3"]


@dataclass(frozen=True, eq=False)
class Features:
    """Features of a drawing, and its paint without them.

    Attributes:
        numbers: (height, width) of the feature that a pixel lies in, from 1; 0: none.
        paint: (height, width, 3) without features, in [0, 1].
        labels: (height, width) of this paint.
        found: the features, the first with number 1.
        blots: (height, width) small blots of any size, and what is beside them.
    """

    numbers: Int16[np.ndarray, "height width"]
    paint: Picture
    labels: UInt8[np.ndarray, "height width"]
    found: tuple[Feature, ...]
    blots: Mask


@dataclass(frozen=True, eq=False)
class Stamp:
    """A feature in a view.

    Attributes:
        drawing: its place in the view's list of drawings.
        feature: of this drawing.
        middle: (2,) column and row of the view.
        slopes: (2, 2) drawing's pixels per pixel of the view.
        depth: of the surface under it.
    """

    drawing: int
    feature: Feature
    middle: Float[np.ndarray, " 2"]
    slopes: Float[np.ndarray, "2 2"]
    depth: float


def features_of(
    paint: Picture,
    labels: UInt8[np.ndarray, "height width"],
    inside: Mask,
    pen: tuple[float, tuple[int, int, int]] | None,
    figure_px: float,
) -> Features:
    """Find a drawing's features and take them off.

    Args:
        paint: in [0, 1].
        labels: of the paint.
        inside: pixels of the figure.
        pen: width in pixels and colour of the lines; None: there are none.
        figure_px: height of the figure.
    """
    shrink = min(1.0, LOOKED_AT_PX / figure_px)
    size = (max(1, round(paint.shape[1] * shrink)), max(1, round(paint.shape[0] * shrink)))
    small = cv2.resize((paint * 255).astype(np.uint8), size, interpolation=cv2.INTER_AREA)
    depth = depth_inside(cv2.resize(inside.view(np.uint8), size) > 0)
    width = pen[0] if pen else 1.0
    every = blots_of(cv2.split(small), depth > 0, LARGEST * (figure_px * shrink) ** 2, LEVELS)
    blots = _short(every, LONGEST * figure_px * shrink, SMALLEST * (figure_px * shrink) ** 2)
    beside = cv2.resize(dilate(every).view(np.uint8), inside.shape[::-1]) > 0
    part = np.zeros(depth.shape, np.int64)
    if blots.any():
        near = (distance_to(blots > 0) <= max(1.0, ROUND * width * shrink + 1)) & (depth > 0)
        part = np.where(near, blots[nearest(blots > 0)], 0)
    whole = cv2.resize(part.astype(np.int16), inside.shape[::-1], interpolation=cv2.INTER_NEAREST)
    whole *= inside
    lined = np.zeros(inside.shape, dtype=bool)
    if pen:
        apart = np.abs(paint * 255 - np.array(pen[1], np.float32)).max(axis=2)
        lined = dilate(apart < INK_LIKE)
    bare = inside & (whole == 0)
    kept = bare & ~lined if (bare & ~lined).any() else bare
    if not kept.any() or not whole.any():
        return Features(np.zeros_like(whole), paint, labels, (), beside)
    at = nearest(kept)
    off = whole > 0
    plain = np.where(off[..., None], paint[at], paint)
    differs = np.abs(paint - plain).max(axis=2)
    matte = ((differs - MATTE[0]) / MATTE[1]).clip(0, 1)
    matte = cv2.GaussianBlur(cv2.dilate(matte, np.ones((3, 3), np.uint8)), (0, 0), 0.6) * off
    return _numbered(paint, whole, matte, plain, np.where(off, labels[at], labels), beside)


def _numbered(
    paint: Picture,
    parts: Numbers,
    matte: Float[np.ndarray, "height width"],
    plain: Picture,
    labels: UInt8[np.ndarray, "height width"],
    beside: Mask,
) -> Features:
    from scipy.ndimage import find_objects

    found, numbers = [], np.zeros(int(parts.max()) + 1, np.int16)
    for one, box in enumerate(find_objects(parts), start=1):
        own = None if box is None else matte[box] * (parts[box] == one)
        if own is None or own.sum() < 1:
            continue
        area = float(own.sum())
        y, x = np.mgrid[box]
        middle = np.array([(own * x).sum(), (own * y).sum()]) / area
        rgb = (paint[box] * own[..., None]).sum(axis=(0, 1)) / area
        across, down = box[1], box[0]
        found.append(Feature(down, across, own.astype(np.float32), middle, area, rgb))
        numbers[one] = len(found)
    return Features(numbers[parts], plain.astype(np.float32), labels, tuple(found), beside)


def blots_of(
    channels: Sequence[UInt8[np.ndarray, "height width"]], inside: Mask, most_px: float, step: int
) -> Mask:
    """Return blots that are darker or lighter than all round them, away from the outline.

    Args:
        channels: of a picture.
        inside: pixels of the figure.
        most_px: their area is smaller.
        step: between the levels at which they are looked for.
    """
    rim = inside & ~erode(inside)
    marked = np.zeros(inside.shape, dtype=bool)
    for channel in channels:
        for values in (channel, 255 - channel):
            for level in range(CONTRAST, 256, step):
                part, areas = sized_parts((values <= level) & inside)
                few = areas < most_px
                few[part[rim]] = False
                few[0] = False
                if few.any():
                    marked |= few[part] & (values <= level - CONTRAST)
    return marked


def _short(marked: Mask, longest: float, least: float = 0.0) -> Numbers:
    """Return the numbers of connected parts that are no longer, and have so many pixels."""
    _, part, boxes, _ = cv2.connectedComponentsWithStats(marked.view(np.uint8), connectivity=8)
    size = boxes[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
    kept = (boxes[:, cv2.CC_STAT_AREA] >= least) & (size <= longest)
    kept[0] = False
    return kept[part] * part


def stamps(
    looks: Sequence[Look],
    chosen: Int[np.ndarray, "h w"],
    counts: Float[np.ndarray, "looks h w"],
    depth: Float[np.ndarray, "h w"],
    figure_px: float,
) -> tuple[list[Stamp], list[Bool[np.ndarray, " features"]]]:
    """Return the features that a view shows, and which every drawing's paint has to go without.

    Args:
        looks: the drawings.
        chosen: of the drawings, by every pixel; -1: none.
        counts: what each counts there.
        depth: of the surface.
        figure_px: height of the figure.
    """
    without = [np.zeros(len(look.texture.features.found) + 1, dtype=bool) for look in looks]
    places = []
    for number, look in enumerate(looks):
        places += _places(number, look, chosen == number, counts[number], depth, without[number])
    places.sort(key=lambda place: -place.count)
    shown, left = [], places
    while left:
        first = left[0]
        group = [first]
        for number in range(len(looks)):
            same = [
                one for one in left if one.stamp.drawing == number and _same(first, one, figure_px)
            ]
            if number != first.stamp.drawing and same:
                group.append(min(same, key=lambda one: _apart(first, one)))
        left = [one for one in left if one not in group]
        if len(group) == 1 and first.own < OWN:
            continue
        for one in group:
            without[one.stamp.drawing][one.number] = True
        shares = np.array([max(looks[one.stamp.drawing].share, 1e-6) for one in group])
        middles = np.stack([one.stamp.middle for one in group])
        shown.append(replace(first.stamp, middle=shares @ middles / shares.sum()))
    return shown[::-1], without


@dataclass(frozen=True, eq=False)
class _Place:
    """Where a view shows a feature; its number; pixels there; what it counts; share that is its."""

    stamp: Stamp
    number: int
    area: float
    count: float
    own: float


def _places(
    number: int,
    look: Look,
    own: Bool[np.ndarray, "h w"],
    counts: Float[np.ndarray, "h w"],
    depth: Float[np.ndarray, "h w"],
    hidden: Bool[np.ndarray, " features"],
) -> list[_Place]:
    """Return where a view shows a drawing's features; and mark those that it sees from the side."""
    features = look.texture.features
    if not features.found:
        return []
    at = cv2.remap(features.numbers, look.x, look.y, cv2.INTER_NEAREST) * look.seen
    rows, columns = np.nonzero(at)
    order = np.argsort(at[rows, columns], kind="stable")
    rows, columns = rows[order], columns[order]
    starts = np.searchsorted(at[rows, columns], np.arange(1, len(features.found) + 2))
    steps = [np.gradient(look.x, axis=1), np.gradient(look.x, axis=0), np.gradient(look.y, axis=0)]
    found = []
    for k, feature in enumerate(features.found, start=1):
        here = slice(starts[k - 1], starts[k])
        pixels = (rows[here], columns[here])
        if here.stop - here.start < FEWEST_PX:
            continue
        wide, shear, tall = (float(np.median(step[pixels])) for step in steps)
        if wide * look.scale > 1 / GRAZING:
            hidden[k] = True
            continue
        if min(wide, tall) * look.scale < 1 / WIDEST or abs(shear) > wide:
            continue
        slopes = np.array([[wide, shear], [0, tall]])
        size = (features.numbers[feature.rows, feature.columns] == k).sum() / (wide * tall)
        if len(pixels[0]) < SEEN * size:
            continue
        off = feature.middle - (look.x[pixels].mean(), look.y[pixels].mean())
        middle = np.array([pixels[1].mean(), pixels[0].mean()]) + np.linalg.solve(slopes, off)
        stamp = Stamp(number, feature, middle, slopes, float(np.median(depth[pixels])))
        count, share = float(counts[pixels].mean()), float(own[pixels].mean())
        found.append(_Place(stamp, k, feature.area / (wide * tall), count, share))
    return found


def _apart(first: _Place, other: _Place) -> float:
    return float(np.hypot(*(first.stamp.middle - other.stamp.middle)))


def _same(first: _Place, other: _Place, figure_px: float) -> bool:
    """Return whether two drawings show one feature."""
    a, b = first.stamp, other.stamp
    ratio = first.area / other.area
    return (
        _apart(first, other) < APART * figure_px
        and 1 / SIZES < ratio < SIZES
        and float(np.abs(a.feature.rgb - b.feature.rgb).max()) < ALIKE
    )


def stamped(
    color: Float[np.ndarray, "h w 3"],
    label: UInt8[np.ndarray, "h w"],
    looks: Sequence[Look],
    shown: Sequence[Stamp],
    depth: Float[np.ndarray, "h w"],
    slack: float,
) -> tuple[Float[np.ndarray, "h w 3"], UInt8[np.ndarray, "h w"]]:
    """Return colours and labels with features on them.

    Args:
        color: of the view, in [0, 1].
        label: of it.
        looks: its drawings.
        shown: the features, what counts most last.
        depth: of the surface.
        slack: world units by which what hides a feature is nearer.
    """
    color, label = color.copy(), label.copy()
    last = np.array(label.shape[::-1])
    for stamp in shown:
        feature, texture = stamp.feature, looks[stamp.drawing].texture
        low = np.array([feature.columns.start, feature.rows.start]) - 1
        high = np.array([feature.columns.stop, feature.rows.stop])
        corners = np.array([(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])])
        corners = stamp.middle + np.linalg.solve(stamp.slopes, (corners - feature.middle).T).T
        start = np.floor(corners.min(axis=0)).astype(int).clip(0, last)
        stop = (np.ceil(corners.max(axis=0)).astype(int) + 1).clip(0, last)
        if (stop <= start).any():
            continue
        box = (slice(start[1], stop[1]), slice(start[0], stop[0]))
        y, x = np.mgrid[box]
        off = np.stack([x, y], axis=-1) - stamp.middle
        there = off @ stamp.slopes.T + feature.middle - (feature.columns.start, feature.rows.start)
        places = there[..., 0].astype(np.float32), there[..., 1].astype(np.float32)
        picture = np.dstack([texture.paint[feature.rows, feature.columns], feature.matte])
        coarse = max(stamp.slopes[0, 0], stamp.slopes[1, 1])
        if coarse > FINE:
            picture = cv2.GaussianBlur(picture, (0, 0), SOFT * coarse)
        edge = cv2.BORDER_REPLICATE
        rgb = cv2.remap(picture[..., :3], *places, cv2.INTER_LINEAR, borderMode=edge)
        cover = cv2.remap(picture[..., 3], *places, cv2.INTER_LINEAR)
        cover = cover * (depth[box] > stamp.depth - slack)
        own = texture.labels[feature.rows, feature.columns]
        new = cv2.remap(own, *places, cv2.INTER_NEAREST, borderMode=edge)
        color[box] += cover[..., None] * (rgb - color[box])
        label[box] = np.where(cover > 0.5, new, label[box])
    return color, label


def torn(
    color: Float[np.ndarray, "h w 3"],
    looks: Sequence[Look],
    chosen: Int[np.ndarray, "h w"],
    inside: Mask,
    figure_px: float,
) -> Mask:
    """Return small blots of a view that the drawings do not have there, and what is beside them."""
    light = cv2.cvtColor((color * 255).astype(np.uint8), cv2.COLOR_RGB2GRAY)
    blots = blots_of([light], inside, STRAY * figure_px**2, COARSE)
    for number, look in enumerate(looks):
        own = chosen == number
        if (blots & own).any():
            places = (look.x, look.y)
            theirs = cv2.remap(
                look.texture.features.blots.view(np.uint8), *places, cv2.INTER_NEAREST
            )
            blots &= ~(own & (theirs > 0))
    return dilate(blots) & inside
