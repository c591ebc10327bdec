"""Segment the dark lines of a drawing: its outline, and the strokes within the figure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.palette.pixels.ink_lines import find_contour, lightness_of, outline_line_px
from toonset.raster import depth_inside, nearest, parts

FEWEST_OUTLINED = 0.5  # of a sheet's views must have an outline, for the sheet to have one
INK_QUANTILE = 0.2  # darkest part of the rim: the rest is mixed with what it surrounds
INK = 128  # coverage from which a pixel is a line's
SOFT = 16  # coverage from which a pixel beside a line holds some of it
FIGURE = 128  # alpha
CLEAR = 60  # levels from paint to ink, Euclidean, for a pixel's share of ink to be told
SQUARE = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class Lines:
    """The lines of one drawing.

    Attributes:
        width_px: of the outline.
        cover: (height, width) how far lines cover every pixel, 0 to 255.
        outline: (height, width) the band along the rim that the outline takes.
        inner: (height, width) line pixels within the figure, drawn features too.
        figure: (height, width) what the figure covers by at least half.
    """

    width_px: float
    cover: UInt8[np.ndarray, "height width"]
    outline: Bool[np.ndarray, "height width"]
    inner: Bool[np.ndarray, "height width"]
    figure: Bool[np.ndarray, "height width"]


def outline_width(rgba: UInt8[np.ndarray, "height width 4"]) -> float:
    """Return the width in pixels of the dark line round the figure, 0 without one."""
    return outline_line_px(lightness_of(rgba), rgba[..., 3] >= FIGURE)


def ink_color(rims: Iterable[UInt8[np.ndarray, "n 3"]]) -> tuple[int, int, int]:
    """Return the median of the darkest pixels of all drawings' rims."""
    colors = np.concatenate(list(rims)).astype(np.float64)
    light = colors.mean(axis=1)
    red, green, blue = np.median(colors[light <= np.quantile(light, INK_QUANTILE)], axis=0)
    return round(float(red)), round(float(green)), round(float(blue))


def lines_of(rgba: UInt8[np.ndarray, "height width 4"], width_px: float) -> Lines:
    """Return the lines of a drawing whose outline has a known width."""
    cover = find_contour(rgba, width_px)
    figure = rgba[..., 3] >= FIGURE
    depth = depth_inside(figure)
    outline = (rgba[..., 3] > 0) & (depth < width_px + 0.5)
    inner = (cover >= INK) & figure & ~outline
    return Lines(width_px, cover, outline, inner, figure)


@dataclass(frozen=True, eq=False)
class Strokes:
    """The inner line pixels of a drawing, cut where their skeleton branches.

    Attributes:
        number: (height, width) the stroke of every inner line pixel, 0 elsewhere.
        skeleton: (height, width) the strokes' middle lines.
        count: highest number + 1.
    """

    number: Int[np.ndarray, "height width"]
    skeleton: Bool[np.ndarray, "height width"]
    count: int


def strokes_of(lines: Lines) -> Strokes:
    """Return the strokes within the figure."""
    from skimage.morphology import skeletonize  # 0.3 s, which pictures of a run do not need

    skeleton = skeletonize(lines.inner)
    neighbours = cv2.filter2D(skeleton.astype(np.uint8), -1, SQUARE)
    middle = skeleton & (neighbours <= 3)  # itself and the two beside it
    stroke = parts(middle)
    count = int(stroke.max()) + 1
    if middle.any():
        rows, columns = nearest(middle)
        stroke = np.where(lines.inner, stroke[rows, columns], 0)
    return Strokes(stroke, middle, count)


def mean_width(
    pictures: Iterable[tuple[np.ndarray, np.ndarray]],
    regions: Iterable[Bool[np.ndarray, "height width"]],
    length_px: float,
    ink: tuple[int, int, int],
) -> float:
    """Return the mean width of lines: how much ink there is over how long they are.

    A pixel's share of ink is how far its colour lies from the paint's towards the ink's. Where the
    paint is nearly as dark as the ink nothing is told; it counts as all the rest.

    Args:
        pictures: every drawing, and the same with paint under its lines; both RGBA.
        regions: pixels that may hold ink of the lines measured.
        length_px: of these lines in all drawings; 0 gives 0.
        ink: its colour.
    """
    inked = told = area = 0.0
    for (drawn, paint), region in zip(pictures, regions, strict=True):
        alpha = drawn[region][:, 3] / 255.0
        room = paint[region][:, :3].astype(np.float64) - ink
        above = ((drawn[region][:, :3].astype(np.float64) - ink) * room).sum(axis=1)
        square = (room**2).sum(axis=1)
        clear = square > CLEAR**2
        share = (1 - above / np.maximum(square, 1)).clip(0, 1)
        inked += float((share * alpha)[clear].sum())
        told += float(alpha[clear].sum())
        area += float(alpha.sum())
    return inked / told * area / length_px if told and length_px else 0.0
