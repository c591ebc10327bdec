"""Find the features of a drawing: eyes, mouths, buttons, badges; and its paint without them.

A feature is a small blot, darker or lighter than all round it, with the line about it. What it
becomes in a view: `stamps`.

Source: blots are what a small area opening or closing takes away, Vincent 1993.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, Int16, UInt8

from toonset.raster import depth_inside, dilate, distance_to, erode, nearest, sized_parts

LOOKED_AT_PX = 360.0  # height of the figure: features are found in a copy no larger
LARGEST, LONGEST = 6e-3, 0.2  # of the squared height; of the height
SMALLEST = 6e-5  # of the squared height
CONTRAST, LEVELS = 26, 12  # of 255: blots differ so much from what is round them; steps
ROUND = 1.2  # times the pen's width: the line round a blot is its
INK_LIKE = 90  # of 255: such a colour is a line, which is no paint to go on with
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
        apart = np.abs(drawn * 255 - np.array(pen[1], np.float32)).max(axis=2)
        lined = dilate(apart < INK_LIKE)
    bare = inside & (whole == 0)
    kept = bare & ~lined if (bare & ~lined).any() else bare
    if not kept.any() or not whole.any():
        return Features(np.zeros_like(whole), paint, labels, (), beside)
    at = nearest(kept)
    off = whole > 0
    plain = np.where(off[..., None], paint[at], paint)
    differs = np.abs(drawn - np.where(off[..., None], drawn[at], drawn)).max(axis=2)
    matte = ((differs - MATTE[0]) / MATTE[1]).clip(0, 1)
    matte = cv2.GaussianBlur(cv2.dilate(matte, np.ones((3, 3), np.uint8)), (0, 0), 0.6) * off
    return _numbered(drawn, whole, matte, plain, np.where(off, labels[at], labels), beside)


def _numbered(
    drawn: Picture,
    parts: Numbers,
    matte: Float[np.ndarray, "height width"],
    plain: Picture,
    labels: UInt8[np.ndarray, "height width"],
    beside: Mask,
) -> Features:
    from scipy.ndimage import find_objects

    found, numbers = [], np.zeros(int(parts.max()) + 1, np.int16)
    for one, box in enumerate(find_objects(parts), start=1):
        if box is None:
            continue
        own = matte[box] * (parts[box] == one)
        area = float(own.sum())
        if area < 1:
            continue
        y, x = np.mgrid[box]
        middle = np.array([(own * x).sum(), (own * y).sum()]) / area
        rgb = (drawn[box] * own[..., None]).sum(axis=(0, 1)) / area
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
