"""Put features into a view as stamps.

Looked up pixel by pixel over a surface that is a little wrong a feature tears, and two drawings
that put it in two places show it twice. As a stamp it moves and foreshortens as one flat piece on
the surface, and the same feature of several drawings is shown once: as the one of them drew it that
counts most, in between their places.

Source: billboards on a surface, Rademacher 1999 ("View-dependent geometry").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.nerf.look.choose import Look
from toonset.nerf.look.features import Feature, blots_of
from toonset.raster import dilate

SEEN = 0.55  # share of a feature that its drawing has to see
# Times its width in the drawing: narrower ones are hidden, for wider ones the surface is wrong
GRAZING, WIDEST = 0.22, 2.0
APART = 0.07  # of the figure's height: farther apart are two
ALIKE, SIZES = 0.3, 3.3  # of a channel; times the area
OWN = 0.5  # share of its place that shows its drawing
FEWEST_PX = 6  # of a view
FINE, SOFT = 1.4, 0.4  # pixels of a drawing per pixel of a view: from here on it is blurred; sigma
STRAY, COARSE = 3e-3, 24  # of the squared height: smaller blots of a view; steps of theirs

Mask = Bool[np.ndarray, "h w"]


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
    numbers = at[rows, columns]
    starts = np.searchsorted(numbers, np.arange(1, len(features.found) + 2))
    sizes = np.bincount(features.numbers.ravel(), minlength=len(starts))
    x, y = look.x, look.y
    values = [*(_steps(*each, rows, columns) for each in ((x, 1), (x, 0), (y, 0)))]
    medians = [_medians(each, numbers, starts) for each in (*values, depth[rows, columns])]
    ends = [columns, rows, x[rows, columns], y[rows, columns], counts[rows, columns]]
    ends.append(own[rows, columns])
    sums = [np.concatenate([[0.0], np.cumsum(each, dtype=np.float64)]) for each in ends]
    means = [np.diff(each[starts]) / np.maximum(np.diff(starts), 1) for each in sums]
    found = []
    for k, feature in enumerate(features.found, start=1):
        pixels = int(starts[k] - starts[k - 1])
        if pixels < FEWEST_PX:
            continue
        wide, shear, tall, deep = (float(each[k - 1]) for each in medians)
        if wide * look.scale > 1 / GRAZING:
            hidden[k] = True
            continue
        if min(wide, tall) * look.scale < 1 / WIDEST or abs(shear) > wide:
            continue
        if pixels < SEEN * sizes[k] / (wide * tall):
            continue
        u, v, in_x, in_y, count, share = (float(each[k - 1]) for each in means)
        slopes = np.array([[wide, shear], [0, tall]])
        middle = np.array([u, v]) + np.linalg.solve(slopes, feature.middle - (in_x, in_y))
        stamp = Stamp(number, feature, middle, slopes, deep)
        found.append(_Place(stamp, k, feature.area / (wide * tall), count, share))
    return found


def _steps(
    values: Float[np.ndarray, "h w"],
    axis: int,
    rows: Int[np.ndarray, " n"],
    columns: Int[np.ndarray, " n"],
) -> Float[np.ndarray, " n"]:
    """Return the slopes of `np.gradient` at some pixels."""
    at, last = (rows, columns)[axis], values.shape[axis] - 1
    ends = (at - 1).clip(0), (at + 1).clip(max=last)
    low, high = (values[(end, columns) if axis == 0 else (rows, end)] for end in ends)
    return (high - low) / np.maximum(ends[1] - ends[0], 1).astype(np.float32)


def _medians(
    values: Float[np.ndarray, " n"],
    groups: Int[np.ndarray, " n"],
    starts: Int[np.ndarray, " groups+1"],
) -> Float[np.ndarray, " groups"]:
    """Return the median of every group; they follow each other. 0 of an empty one."""
    if not len(values):
        return np.zeros(len(starts) - 1)
    ordered = values[np.lexsort((values, groups))]
    few, many = ((starts[:-1] + starts[1:] - off) // 2 for off in (1, 0))
    last = len(values) - 1
    return (ordered[few.clip(0, last)].astype(np.float64) + ordered[many.clip(0, last)]) / 2


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
