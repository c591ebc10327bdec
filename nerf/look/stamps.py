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

from toonset.camera import Camera
from toonset.nerf.look.choose import Look, Shared
from toonset.nerf.look.features import Feature, blots_of, lines_of
from toonset.nerf.look.paint_flow import between
from toonset.nerf.look.texture import Texture
from toonset.raster import dilate

SEEN = 0.35  # share of a feature that its drawing has to see
# Times its width in the drawing: narrower ones are hidden, and what is larger is shown so large
GRAZING, LARGER = 0.22, 1.25
ACROSS, DOWN = 0.12, 0.04  # of the figure's height: features of two drawings farther apart are two
ALIKE, SIZES = 0.3, 3.3  # of a channel; times the area: the same
OWN = 0.5  # share of its place that shows its drawing
NEARER = 0.09  # of the figure's height: what hides a feature is so much nearer
FEWEST_PX = 6  # of a view
FINE, SOFT = 1.4, 0.4  # pixels of a drawing per pixel of a view: from here on it is blurred; sigma
STRAY, COARSE = 1e-3, 24  # of the squared height: smaller blots of a view; steps of theirs

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
    both: bool,
    camera: Camera,
    chosen: Int[np.ndarray, "h w"],
    counts: Float[np.ndarray, "looks h w"],
    depth: Float[np.ndarray, "h w"],
    height: float,
    shared: Sequence[Shared] = (),
) -> tuple[list[Stamp], list[Bool[np.ndarray, " features"]]]:
    """Return the features that a view shows, and which every drawing's paint has to go without.

    Args:
        looks: the drawings.
        both: the first two flank the view; else the first alone does.
        camera: of the view.
        chosen: of the drawings, by every pixel; -1: none.
        counts: what each counts there.
        depth: of the surface.
        height: of the figure, world units.
        shared: groups of features that one drawing shows.
    """
    without = [np.zeros(len(look.texture.features.found) + 1, dtype=bool) for look in looks]
    alone: dict[tuple[int, int], _Place] = {}
    for number, look in enumerate(looks):
        for place in _places(
            number, look, chosen == number, counts[number], depth, without[number]
        ):
            alone[number, place.number] = place
    shown = []
    pairs = _same_features(looks[0].texture, looks[1].texture, height) if both else []
    for one in shared:  # as the one drawing has them, not in between
        members = [
            [k for k, group in enumerate(look.texture.features.group_of, 1) if group in its]
            for look, its in zip(looks, one.groups, strict=False)
        ]
        pairs = [pair for pair in pairs if pair[0] not in members[0] and pair[1] not in members[1]]
        other = 1 - one.leader
        for k in members[other]:
            alone.pop((other, k), None)
            without[other][k] = True
    for pair in pairs:
        places = [alone.pop(key) for key in enumerate(pair) if key in alone]
        if places:
            shown.append(_joined(places, pair, looks, camera))
            for own, number in zip(without, pair, strict=False):
                own[number] = True
    for place in alone.values():
        without[place.stamp.drawing][place.number] = True
        if place.own >= OWN:
            shown.append(place)
    placed = [_moved_in(place.stamp, chosen >= 0) for place in shown]
    kept = [stamp for stamp in placed if stamp is not None]
    return sorted(kept, key=lambda stamp: -stamp.depth), without


def _moved_in(stamp: Stamp, inside: Mask) -> Stamp | None:
    """Return a stamp moved sideways onto the figure; None if it is half beside it."""
    x, y = stamp.middle
    row = inside[int(np.clip(round(y), 0, len(inside) - 1))]
    runs = np.flatnonzero(np.diff(np.pad(row, 1).view(np.int8))).reshape(-1, 2)
    if not len(runs):
        return None
    half = (stamp.feature.matte.max(axis=0) > 0.5).sum() / 2 / stamp.slopes[0, 0]
    start, stop = min(runs, key=lambda run: max(run[0] - x, x - run[1] + 1, 0))
    near = min(start + half, (start + stop) / 2) - 0.5
    far = max(stop - half, (start + stop) / 2) - 0.5
    moved = float(np.clip(x, near, far))
    return replace(stamp, middle=np.array([moved, y])) if abs(moved - x) <= half else None


def _joined(
    places: Sequence[_Place], pair: tuple[int, int], looks: Sequence[Look], camera: Camera
) -> _Place:
    """Return the place of a feature that both flanking drawings have, between both places.

    It is that of the one which counts more. Where the view shows one of them only, the other's is
    as far from it as their surfaces tell.
    """
    first = max(places, key=lambda place: place.count)
    share = looks[1].share / max(looks[0].share + looks[1].share, 1e-6)
    if len(places) == 2:
        apart = places[1].stamp.middle - places[0].stamp.middle
    else:
        anchors = [look.texture.anchors[k - 1] for look, k in zip(looks, pair, strict=False)]
        apart = np.subtract(*camera.project(np.stack(anchors))[0][::-1])
    moved = share - first.stamp.drawing  # along the way from the first drawing's to the second's
    return replace(first, stamp=replace(first.stamp, middle=first.stamp.middle + moved * apart))


def _same_features(first: Texture, second: Texture, height: float) -> list[tuple[int, int]]:
    """Return the numbers of the features that two drawings have in common, one to one.

    Hands and cameras err sideways, where nothing holds a drawing, more than in height.

    Source: sparse linear assignment, Jonker and Volgenant 1987 (`scipy.sparse.csgraph`).
    """
    sides = [texture.features.found for texture in (first, second)]
    if not all(sides):
        return []
    from scipy.sparse import csr_array  # loaded for seams already, unlike scipy.optimize
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    half_way = between(first.camera, second.camera, 1.0, height)
    at, other = (half_way.project(texture.anchors)[0] for texture in (first, second))
    rgb = [np.stack([feature.rgb for feature in side]) for side in sides]
    area = [np.log([feature.area for feature in side]) for side in sides]
    area[1] += 2 * np.log(first.figure_px / second.figure_px)
    apart = np.abs(at[:, None] - other[None]) / (ACROSS, DOWN)
    unlike = np.abs(rgb[0][:, None] - rgb[1][None]).max(axis=-1) / ALIKE
    larger = np.abs(area[0][:, None] - area[1][None]) / np.log(SIZES)
    terms = np.dstack([apart, unlike, larger])
    price = np.where((terms < 1).all(axis=-1), (terms**2).sum(axis=-1) - terms.shape[-1], 0)
    matched = min_weight_full_bipartite_matching(csr_array(price - 1))  # 0 would be no edge
    found = zip(*matched, strict=True)
    return [(int(i) + 1, int(j) + 1) for i, j in found if price[i, j] < 0]


@dataclass(frozen=True, eq=False)
class _Place:
    """Where a view shows a feature; its number; what it counts there; share that is its."""

    stamp: Stamp
    number: int
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
    y, x = np.nonzero(at)
    numbers = at[y, x]
    pixels, sizes = (
        np.bincount(each.ravel(), minlength=len(hidden)) for each in (numbers, features.numbers)
    )
    index = np.flatnonzero((pixels >= FEWEST_PX) & (np.arange(len(pixels)) > 0))
    if not len(index):
        return []
    steps = [_slope(look.x, y, x, 1), _slope(look.x, y, x, 0), _slope(look.y, y, x, 0)]
    levels = [_medians(each, numbers, pixels)[index] for each in (*steps, depth[y, x])]
    values = (x, y, *(each[y, x] for each in (look.x, look.y, counts, own)))
    means = [
        (np.bincount(numbers, each, len(hidden)) / np.maximum(pixels, 1))[index] for each in values
    ]
    found = []
    for place, k in enumerate(index.tolist()):
        feature = features.found[k - 1]
        wide, shear, tall, deep = (float(each[place]) for each in levels)
        if wide * look.scale > 1 / GRAZING:
            hidden[k] = True
            continue
        if tall <= 0 or abs(shear) > wide:  # the surface is folded
            continue
        wide, tall = (max(slope, 1 / (LARGER * look.scale)) for slope in (wide, tall))
        if pixels[k] < SEEN * sizes[k] / (wide * tall):
            hidden[k] = True
            continue
        u, v, in_x, in_y, count, share = (float(each[place]) for each in means)
        slopes = np.array([[wide, shear], [0, tall]])
        middle = np.array([u, v]) + np.linalg.solve(slopes, feature.middle - (in_x, in_y))
        found.append(_Place(Stamp(number, feature, middle, slopes, deep), k, count, share))
    return found


def _slope(
    picture: Float[np.ndarray, "h w"], y: Int[np.ndarray, " n"], x: Int[np.ndarray, " n"], axis: int
) -> Float[np.ndarray, " n"]:
    """Return `np.gradient` of a picture along an axis, at some pixels."""
    at, last = (y, x)[axis], picture.shape[axis] - 1
    after, before = np.minimum(at + 1, last), np.maximum(at - 1, 0)
    ends = [(each, x) if axis == 0 else (y, each) for each in (after, before)]
    return np.asarray((picture[ends[0]] - picture[ends[1]]) / (after - before).astype(np.float32))


def _medians(
    values: Float[np.ndarray, " n"], numbers: Int[np.ndarray, " n"], counts: Int[np.ndarray, " k"]
) -> Float[np.ndarray, " k"]:
    """Return the median of the values with each number, 0 where there are none."""
    ordered = values[np.lexsort((values, numbers))]
    first = np.cumsum(counts) - counts
    low, high = (
        ordered[(first + np.maximum(each, 0)).clip(0, len(values) - 1)]
        for each in ((counts - 1) // 2, counts // 2)
    )
    return np.where(counts > 0, (low + high) / 2, 0)


def stamped(
    color: Float[np.ndarray, "h w 3"],
    label: UInt8[np.ndarray, "h w"],
    looks: Sequence[Look],
    shown: Sequence[Stamp],
    depth: Float[np.ndarray, "h w"],
    nearer: float,
) -> tuple[Float[np.ndarray, "h w 3"], UInt8[np.ndarray, "h w"]]:
    """Return colours and labels with features on them.

    Args:
        color: of the view, in [0, 1].
        label: of it.
        looks: its drawings.
        shown: the features, the nearest last.
        depth: of the surface.
        nearer: world units by which what hides a feature is nearer.
    """
    color, label = color.copy(), label.copy()
    last = np.array(label.shape[::-1])
    for stamp in shown:
        feature, look = stamp.feature, looks[stamp.drawing]
        texture = look.texture
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
        cover = cover * ((depth[box] > stamp.depth - nearer) | look.seen[box])
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
    pen: tuple[float, tuple[int, int, int]] | None,
) -> Mask:
    """Return small blots of a view that the drawings do not have there, and what is beside them.

    Where there are lines, only these can be astray: a patch of paint is what a seam left of one.

    Args:
        color: of the view, in [0, 1].
        looks: its drawings.
        chosen: of them, by every pixel; -1: none.
        inside: pixels of the figure.
        figure_px: its height.
        pen: width in the view's pixels and colour of the lines; None: there are none.
    """
    light = cv2.cvtColor((color * 255).astype(np.uint8), cv2.COLOR_RGB2GRAY)
    (blots,) = blots_of([light], inside, [STRAY * figure_px**2], COARSE)
    if pen:
        blots &= lines_of(color, pen)
    for number, look in enumerate(looks):
        own = chosen == number
        if (blots & own).any():
            places = (look.x, look.y)
            theirs = cv2.remap(
                look.texture.features.blots.view(np.uint8), *places, cv2.INTER_NEAREST
            )
            blots &= ~(own & (theirs > 0))
    return dilate(blots) & inside
