"""Segment the dark lines of a drawing: its outline, and the strokes within the figure."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from toonset.palette.pixels.ink_lines import find_contour
from toonset.raster import depth_inside, nearest, parts

INK = 128  # coverage from which a pixel is a line's
SOFT = 16  # coverage from which a pixel beside a line holds some of it
FIGURE = 128  # alpha
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
