"""Trace a view in the drawn look: closed smooth paths of filled regions, a colour each.

1. Colours, and every pixel's shares of one or two: `shares`, then `crumbs`.
2. Stack. Regions lie on each other, and go on beneath those above: `stack`.
3. Curves: `bezier`.

Sources: Porter and Duff, "Compositing Digital Images", 1984 (coverage that adds up); Selinger,
"Potrace: a polygon-based tracing algorithm", 2003 (outlines of regions, one upon the other).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import UInt8

from toonset.nerf.look.drawn_view import SOLID, DrawnView
from toonset.nerf.look.outline import Outline
from toonset.nerf.render.crumbs import without_crumbs
from toonset.nerf.render.shares import (
    MIXED,
    NEAR,
    NONE,
    STEP,
    Box,
    Colors,
    Labels,
    Mask,
    Picture,
    Shares,
    explained,
)
from toonset.nerf.render.stack import LINES, Region, Stack
from toonset.raster import connected_to, dilate, distance_to, sized_parts

SAME = 4 / 255  # of a channel: a mean of pixels that is so near to a paint is that paint
MOST_PX = 1600  # longest side: larger views are traced smaller
UNCLEAR = 0.2  # of colours, off a pixel's explanation: its border is smoothed


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
    picture = Picture.of(view, pen)
    colors, shares = explained(picture)
    colors = _as_paints(colors, paints)
    shares = without_crumbs(shares, colors, picture.color)
    of_colors = _paints_of(colors, paints, shares.labels, view.labels)
    shares = _with_borders(shares, colors, picture)
    colors, of_colors, shares = _with_lines(colors, of_colors, shares, picture, pen)
    corner = np.array([box[1].start, box[0].start])
    scale = np.array(smaller) / (width, height)  # in whole pixels
    outline = (shares.ink > shares.cover) & (shares.labels != NONE)
    labels = np.where(outline, len(colors) - 1, shares.labels)
    like_pen = (np.linalg.norm(colors - colors[-1], axis=1) < NEAR) & (pen is not None)
    like_pen[-1] = False
    stack = Stack(colors, tuple(of_colors), like_pen, shares, labels)
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


def _with_borders(shares: Shares, colors: Colors, picture: Picture) -> Shares:
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
    colors: Colors, paints: list[int], shares: Shares, picture: Picture, pen: Outline | None
) -> tuple[Colors, list[int], Shares]:
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
