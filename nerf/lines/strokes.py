"""The dark lines of one drawing: its outline, and the strokes within the figure one by one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8
from skimage.measure import perimeter
from skimage.morphology import skeletonize

from toonset.nerf.lines.nearest import depth_inside, nearest, parts
from toonset.palette.pixels.ink_lines import find_contour, rim_line_px

FEWEST_OUTLINED = 0.5  # of a sheet's views must have an outline, for the sheet to have one
INK_QUANTILE = 0.2  # darkest part of the rim: the rest is mixed with what it surrounds
INK = 128  # coverage from which a pixel is a line's
SOFT = 16  # coverage from which a pixel beside a line holds some of it
FIGURE = 128  # alpha
DIAGONAL = 1.1  # mean length of a skeleton's step over all directions
IMPURE = 0.1  # of the way from ink to paint: a stroke's middle may be so far off
LEVELS = 12  # levels that middles may be off the ink in any case
CORE = 0.25  # quantile of a stroke's middle pixels that must be pure
CLEAR = 60  # levels from paint to ink, Euclidean, for a pixel's share of ink to be told
LONGER = 2.5  # times its width: a shorter stroke is a dot
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
        rim: (height, width) its outermost pixels.
    """

    width_px: float
    cover: UInt8[np.ndarray, "height width"]
    outline: Bool[np.ndarray, "height width"]
    inner: Bool[np.ndarray, "height width"]
    figure: Bool[np.ndarray, "height width"]
    rim: Bool[np.ndarray, "height width"]

    def under(self, contour: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
        """Return all pixels that hold ink of the outline or of `contour`, soft ones and crumbs too.

        A crumb is a dot of other ink that touches them: where a line is a little wider.
        """
        ink = contour | self.outline
        part = parts(self.inner & ~ink, connectivity=4)
        dots = (np.bincount(part.ravel()) <= LONGER * max(self.width_px, 1.0))[part] & (part > 0)
        touched = np.unique(part[_grown(ink) & dots])
        ink = ink | (dots & np.isin(part, touched))
        return ink | (_grown(ink) & (self.cover >= SOFT))


def outline_width(rgba: UInt8[np.ndarray, "height width 4"]) -> float:
    """Return the width in pixels of the dark line round the figure, 0 = there is none."""
    alpha = rgba[..., 3:].astype(np.float32) / 255
    over_white = (rgba[..., :3] * alpha + 255 * (1 - alpha) + 0.5).astype(np.uint8)
    light = cv2.cvtColor(over_white, cv2.COLOR_RGB2GRAY)
    return rim_line_px(light, rgba[..., 3] >= FIGURE)


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
    return Lines(width_px, cover, outline, inner, figure, figure & (depth < 1))


@dataclass(frozen=True, eq=False)
class Strokes:
    """The inner line pixels of a drawing, cut where their skeleton branches.

    Attributes:
        number: (height, width) the stroke of every inner line pixel, 0 elsewhere.
        skeleton: (height, width) the strokes' middle lines.
        count: highest number + 1.
        dots: (count,) which strokes belong to a spot no longer than a line is wide.
    """

    number: Int[np.ndarray, "height width"]
    skeleton: Bool[np.ndarray, "height width"]
    count: int
    dots: Bool[np.ndarray, " count"]

    def only(self, chosen: Bool[np.ndarray, " count"]) -> Strokes:
        """Return the strokes without those not chosen; their numbers stay."""
        kept = np.where(chosen[self.number], self.number, 0)
        return Strokes(kept, self.skeleton & (kept > 0), self.count, self.dots)


def strokes_of(lines: Lines) -> Strokes:
    """Return the strokes within the figure."""
    skeleton = skeletonize(lines.inner)
    neighbours = cv2.filter2D(skeleton.astype(np.uint8), -1, SQUARE)
    middle = skeleton & (neighbours <= 3)  # itself and the two beside it
    stroke, spot = parts(middle), parts(lines.inner)
    count = int(stroke.max()) + 1
    short = np.bincount(spot[skeleton], minlength=int(spot.max()) + 1) <= LONGER * lines.width_px
    dots = np.zeros(count, dtype=bool)
    dots[stroke[middle]] = short[spot[middle]]
    if middle.any():
        rows, columns = nearest(middle)
        stroke = np.where(lines.inner, stroke[rows, columns], 0)
    return Strokes(stroke, middle, count, dots)


def drawn_by_pen(
    strokes: Strokes,
    lines: Lines,
    drawn: UInt8[np.ndarray, "height width 4"],
    paint: UInt8[np.ndarray, "height width 4"],
    ink: tuple[int, int, int],
) -> Bool[np.ndarray, " count"]:
    """Return which strokes are as dark in their middles as a line of the ink would be.

    Args:
        strokes: of the drawing.
        lines: of the drawing.
        drawn: the drawing.
        paint: the drawing with paint under all its lines.
        ink: the outline's colour.
    """
    pen = np.zeros(strokes.count, dtype=bool)
    own = np.where(strokes.skeleton, strokes.number, 0)
    covered = np.bincount(strokes.number.ravel(), lines.cover.ravel() / 255.0, strokes.count)
    for number in range(1, strokes.count):
        at = own == number
        above = [(picture[at][:, :3].astype(float) - ink).max(axis=1) for picture in (drawn, paint)]
        width = covered[number] / (DIAGONAL * at.sum())
        thin = max(0.0, 1 - width)  # a thinner line fills no pixel
        allowed = max(LEVELS, (IMPURE + thin) * float(np.median(above[1])))
        pen[number] = np.quantile(above[0], CORE) <= allowed
    return pen


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


def rims_px(lines: Iterable[Lines]) -> float:
    """Return the length of all silhouettes."""
    return sum(float(perimeter(line.figure)) for line in lines)


def strokes_px(strokes: Iterable[Bool[np.ndarray, "height width"]]) -> float:
    """Return the length of all strokes."""
    return sum(DIAGONAL * float(skeletonize(stroke).sum()) for stroke in strokes)


def _grown(mask: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    return cv2.dilate(mask.astype(np.uint8), SQUARE) > 0
