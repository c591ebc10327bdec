"""Find the features of a drawing: eyes, mouths, buttons, badges; and its paint without them.

A feature is a small blot, darker or lighter than all round it, with the line about it. What it
becomes in a view: `stamps`.

Source: blots are what a small area opening or closing takes away, Vincent 1993.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, Int16, UInt8

from toonset.raster import depth_inside, dilate, distance_to, erode, nearest, sized_parts

LOOKED_AT_PX = 360.0  # height of the figure: features are found in a copy no larger
SMALL, LARGEST = 2e-3, 0.022  # of the squared height: what is between is a feature if it is round
DISC = 0.5  # area over that of a circle as long as the outline: so round
LONGEST = 0.17  # of the height
SMALLEST = 6e-5  # of the squared height
CONTRAST, LEVELS = 26, 12  # of 255: blots differ so much from what is round them; steps
ROUND = 1.2  # times the pen's width: the line round a blot is its
THICK = 2.0  # times the pen's width, from its edge: black so deep is paint
INK_LIKE = 90  # of 255: such a colour is a line, which is no paint to go on with
SAME_PAINT, ON_ONE = 0.15, 0.6  # of a channel; share of what is under a feature that is one paint
# Of the height, and of a feature's width: gaps in a group; its largest side; room round it
GAP, WIDEST, ROOM = (0.03, 1.0), 0.35, 0.015
MATTE = (0.03, 0.06)  # of 1: what differs less from the paint without it shows none; all, by more

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
        rgb: (3,) mean colour in [0, 1], the artist's.
        under: (3,) of the paint that it lies on.
    """

    rows: slice
    columns: slice
    matte: Float[np.ndarray, "rows columns"]
    middle: Float[np.ndarray, " 2"]
    area: float
    rgb: Float[np.ndarray, " 3"]
    under: Float[np.ndarray, " 3"]


@dataclass(frozen=True, eq=False)
class Features:
    """Features of a drawing, and its paint without them.

    Attributes:
        numbers: (height, width) of the feature that a pixel lies in, from 1; 0: none.
        paint: (height, width, 3) without features, in [0, 1].
        labels: (height, width) of this paint.
        found: the features, the first with number 1.
        blots: (height, width) blots of any form, at the outline too, and what is beside them.
        groups: (height, width) of the group of features that a pixel lies in, from 1; 0: none.
    """

    numbers: Int16[np.ndarray, "height width"]
    paint: Picture
    labels: UInt8[np.ndarray, "height width"]
    found: tuple[Feature, ...]
    blots: Mask
    groups: Int16[np.ndarray, "height width"]

    @cached_property
    def group_of(self) -> list[int]:
        """Return the group of every feature."""
        middles = (np.rint(one.middle).astype(int) for one in self.found)
        return [int(self.groups[y, x]) for x, y in middles]


def features_of(
    paint: Picture,
    labels: UInt8[np.ndarray, "height width"],
    inside: Mask,
    pen: tuple[float, tuple[int, int, int]] | None,
    figure_px: float,
    drawn: Picture | None = None,
) -> Features:
    """Find a drawing's features and take them off.

    Args:
        paint: in [0, 1], to be shown.
        labels: of the paint.
        inside: pixels of the figure.
        pen: width in pixels and colour of the lines; None: there are none.
        figure_px: height of the figure.
        drawn: the paint in the artist's colours, by which features are told; None: as shown.
    """
    drawn = paint if drawn is None else drawn
    shrink = min(1.0, LOOKED_AT_PX / figure_px)
    size = (max(1, round(paint.shape[1] * shrink)), max(1, round(paint.shape[0] * shrink)))
    small = cv2.resize((drawn * 255).astype(np.uint8), size, interpolation=cv2.INTER_AREA)
    depth = depth_inside(cv2.resize(inside.view(np.uint8), size) > 0)
    width = pen[0] if pen else 1.0
    tall = figure_px * shrink
    channels, sizes = cv2.split(small), [SMALL * tall**2, LARGEST * tall**2]
    few, every = blots_of(channels, depth > 0, sizes, LEVELS)
    blots = _whole(every, few, tall)
    (anywhere,) = blots_of(channels, np.ones_like(every), sizes[1:], LEVELS)
    beside = cv2.resize(dilate(anywhere).view(np.uint8), inside.shape[::-1]) > 0
    part = np.zeros(depth.shape, np.int64)
    if blots.any():
        near = (distance_to(blots > 0) <= max(1.0, ROUND * width * shrink + 1)) & (depth > 0)
        part = np.where(near, blots[nearest(blots > 0)], 0)
    whole = cv2.resize(part.astype(np.int16), inside.shape[::-1], interpolation=cv2.INTER_NEAREST)
    whole *= inside
    lined = lines_of(drawn, pen)
    bare = inside & (whole == 0)
    kept = bare & ~lined if (bare & ~lined).any() else bare
    if not kept.any() or not whole.any():
        return Features(np.zeros_like(whole), paint, labels, (), beside, np.zeros_like(whole))
    at = nearest(kept)
    off = whole > 0
    plain, ground = (np.where(off[..., None], one[at], one) for one in (paint, drawn))
    differs = np.abs(drawn - ground).max(axis=2)
    matte = ((differs - MATTE[0]) / MATTE[1]).clip(0, 1)
    matte = cv2.GaussianBlur(cv2.dilate(matte, np.ones((3, 3), np.uint8)), (0, 0), 0.6) * off
    numbers, found = _numbered(drawn, whole, matte, ground)
    return Features(
        numbers,
        plain.astype(np.float32),
        np.where(off, labels[at], labels),
        found,
        beside,
        _grouped(found, inside, figure_px),
    )


def lines_of(
    picture: Picture, pen: tuple[float, tuple[int, int, int]] | None, *, beside: bool = True
) -> Mask:
    """Return the pixels of a picture in which a pen's lines are.

    Args:
        picture: in [0, 1].
        pen: width in pixels and colour; None: there are no lines.
        beside: those beside them, too.
    """
    lined = np.zeros(picture.shape[:2], dtype=bool)
    if pen:
        width, rgb = pen
        inky = np.ones(lined.shape, dtype=bool)
        for channel, level in zip(cv2.split(picture), rgb, strict=True):
            inky &= np.abs(channel * 255 - np.float32(level)) < INK_LIKE
        thick = depth_inside(inky) > THICK * width  # is paint
        lined = inky & (distance_to(thick) > (THICK + 1) * width if thick.any() else True)
        lined = dilate(lined) if beside else lined
    return lined


def _numbered(
    drawn: Picture, parts: Numbers, matte: Float[np.ndarray, "height width"], ground: Picture
) -> tuple[Int16[np.ndarray, "height width"], tuple[Feature, ...]]:
    """Return features that lie on one paint each, and the number that every pixel has."""
    from scipy.ndimage import find_objects

    found, numbers = [], np.zeros(int(parts.max()) + 1, np.int16)
    for one, box in enumerate(find_objects(parts), start=1):
        if box is None:
            continue
        own = matte[box] * (parts[box] == one)
        area = float(own.sum())
        under = ground[box][parts[box] == one]
        paint = np.median(under, axis=0)
        like = np.abs(under - paint).max(axis=-1) < SAME_PAINT
        if area < 1 or like.mean() < ON_ONE:
            continue
        y, x = np.mgrid[box]
        middle = np.array([(own * x).sum(), (own * y).sum()]) / area
        rgb = (drawn[box] * own[..., None]).sum(axis=(0, 1)) / area
        across, down = box[1], box[0]
        found.append(Feature(down, across, own.astype(np.float32), middle, area, rgb, paint))
        numbers[one] = len(found)
    return numbers[parts], tuple(found)


def _grouped(
    found: Sequence[Feature], inside: Mask, figure_px: float
) -> Int16[np.ndarray, "height width"]:
    """Return the group of features that every pixel belongs to: the eyes and mouth of a face.

    It is the convex hull of features near each other, with room round it. The nearest are joined
    first, and no group becomes larger than a face.
    """
    groups = np.zeros(inside.shape, np.int16)
    if not found:
        return groups
    low = np.array([(one.columns.start, one.rows.start) for one in found])
    high = np.array([(one.columns.stop, one.rows.stop) for one in found]) - 1
    wide = np.sqrt([one.area for one in found])
    gaps = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).clip(0)
    apart = np.hypot(gaps[..., 0], gaps[..., 1])
    near = apart < GAP[0] * figure_px + GAP[1] * (wide[:, None] + wide[None]) / 2
    under = np.stack([one.under for one in found])
    near &= np.abs(under[:, None] - under[None]).max(axis=-1) < SAME_PAINT
    member = np.arange(len(found))
    pairs = np.argwhere(np.triu(near, 1))
    for i, j in pairs[np.argsort(apart[tuple(pairs.T)], kind="stable")]:
        joined = (member == member[i]) | (member == member[j])
        if (high[joined].max(axis=0) - low[joined].min(axis=0)).max() < WIDEST * figure_px:
            member[joined] = member[i]
    side = 2 * round(ROOM * figure_px) + 1
    room = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    for number, one in enumerate(np.unique(member), start=1):
        (x0, y0), (x1, y1) = (np.moveaxis(at[member == one], -1, 0) for at in (low, high))
        corners = np.stack([[x0, x0, x1, x1], [y0, y1, y0, y1]], axis=-1).reshape(-1, 2)
        hull = np.zeros(inside.shape, np.uint8)
        cv2.fillConvexPoly(hull, cv2.convexHull(corners.astype(np.int32)), 1)
        groups[(cv2.dilate(hull, room) > 0) & inside] = number
    return groups


def blots_of(
    channels: Sequence[UInt8[np.ndarray, "height width"]],
    inside: Mask,
    most_px: Sequence[float],
    step: int,
) -> list[Mask]:
    """Return blots that are darker or lighter than all round them, away from the outline.

    Args:
        channels: of a picture.
        inside: pixels of the figure.
        most_px: their area is smaller than each of these.
        step: between the levels at which they are looked for.
    """
    rim = np.flatnonzero(inside & ~erode(inside))
    marked = [np.zeros(inside.shape, dtype=bool) for _ in most_px]
    for channel in channels:
        for values in (channel, 255 - channel):
            for level in range(CONTRAST, 256, step):
                part, areas = sized_parts((values <= level) & inside)
                if len(areas) < 2:
                    continue
                at_rim = part.take(rim)
                for most, found in zip(most_px, marked, strict=True):
                    few = areas < most
                    few[at_rim] = False
                    few[0] = False
                    if few.any():
                        found |= few.take(part) & (values <= level - CONTRAST)
    return marked


def _whole(every: Mask, small: Mask, tall: float) -> Numbers:
    """Return the numbers of features among blots, the small ones of which may lie on larger ones.

    What is long, or large and not round, is a line, hair, a face or clothes: no feature, but what
    lies on it may be.
    """
    (part, size, areas), (on, own_size, own_areas) = _measured(every), _measured(small)
    under = size > LONGEST * tall
    for one in np.flatnonzero(~under & (areas > SMALL * tall**2)):
        under[one] = _roundness(part == one) < DISC
    kept = ~under & (areas >= SMALLEST * tall**2)
    lies_on = np.zeros(len(own_areas), np.int64)
    lies_on[on[small]] = part[small]
    own_kept = under[lies_on] & (own_size <= LONGEST * tall) & (own_areas >= SMALLEST * tall**2)
    kept[0] = own_kept[0] = False
    return np.where(kept[part], part, np.where(own_kept[on], on + len(areas), 0))


def _measured(marked: Mask) -> tuple[Numbers, Int[np.ndarray, " parts"], Int[np.ndarray, " parts"]]:
    """Return the number of every pixel's connected part, the parts' longer sides and areas."""
    _, part, boxes, _ = cv2.connectedComponentsWithStats(marked.view(np.uint8), connectivity=8)
    boxes = np.asarray(boxes, np.int64)
    size = boxes[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
    return np.asarray(part, np.int64), size, boxes[:, cv2.CC_STAT_AREA]


def _roundness(part: Mask) -> float:
    """Return the area of a part without holes over that of a circle as long as its outline."""
    outlines, _ = cv2.findContours(part.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    area, length = cv2.contourArea(outlines[0]), cv2.arcLength(outlines[0], True)
    return 4 * np.pi * area / max(length**2, 1.0)
