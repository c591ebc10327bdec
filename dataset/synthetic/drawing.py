"""Draw contour lines and flat, antialiased colours from labels and depth.

Lines are centred on the edge they draw. All work happens on a picture `supersample` times larger;
colours are averaged there with premultiplied alpha.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.dataset.synthetic.gl_render import LabelPicture
from toonset.dataset.synthetic.shadow import Shade, shaded
from toonset.palette.pixels.labels import UNLABELLED
from toonset.raster import distance_to

INNER_LINE = 0.6  # of the silhouette line's width: inner lines are drawn thinner


@dataclass(frozen=True, eq=False)
class Lines:
    """Distance in pixels from every pixel's centre to the nearest line.

    Attributes:
        silhouette: to the border of the figure.
        inner: to depth jumps and label boundaries within the figure.
    """

    silhouette: Float[np.ndarray, "height width"]
    inner: Float[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class Drawing:
    """A drawn cell.

    Attributes:
        rgba: (height, width, 4) sRGB, straight alpha.
        labels: (height, width) palette index; 255 on background, ink and mixed pixels. A pixel
            whose bytes are its colour's is not mixed, however thinly a line or edge grazes it. In
            shaded paint one that a line grazes is.
        ink: (height, width) coverage of the lines, 0 to 255.
    """

    rgba: UInt8[np.ndarray, "height width 4"]
    labels: UInt8[np.ndarray, "height width"]
    ink: UInt8[np.ndarray, "height width"]


def find_lines(picture: LabelPicture, jump: float, *, label_lines: bool) -> Lines:
    """Return the distances to the lines of a picture.

    Args:
        picture: labels and depth.
        jump: world units; a larger step in depth between two pixels is a line.
        label_lines: draw the boundaries between labels, too.
    """
    figure = picture.labels != UNLABELLED
    depth = np.where(figure, picture.depth, 0.0)
    silhouette, inner = np.zeros_like(figure), np.zeros_like(figure)
    _mark(silhouette, inner, figure, picture.labels, depth, jump, label_lines)
    _mark(silhouette.T, inner.T, figure.T, picture.labels.T, depth.T, jump, label_lines)
    return Lines(_distance(silhouette), _distance(inner))


def draw(
    labels: UInt8[np.ndarray, "height width"],
    lines: Lines,
    palette: UInt8[np.ndarray, "colors 3"],
    outline_px: float | Float[np.ndarray, "height width"],
    supersample: int,
    shade: Shade | None = None,
    line_tint: float = 0.0,
) -> Drawing:
    """Return the finished cell, smaller than its input by `supersample`.

    Args:
        labels: large picture, 255 = background.
        lines: large picture.
        palette: sRGB.
        outline_px: width of the silhouette line in pixels of the result, in all the large picture
            or at each of its pixels; 0 = no lines.
        supersample: samples per pixel and axis.
        shade: large picture, how light its paint is; None: as light as the palette's.
        line_tint: share of the paint's colour in a line over it, 0 = black lines.
    """
    figure = (labels != UNLABELLED).astype(np.float32)
    ink = np.zeros_like(figure)
    if np.any(np.asarray(outline_px) > 0):
        half = outline_px * supersample / 2
        for distance, reach in ((lines.silhouette, half), (lines.inner, INNER_LINE * half)):
            ink = np.maximum(ink, np.clip(np.float32(reach + 0.5) - distance, 0, 1))
    flat = _colors(palette)[labels]
    if shade is not None:
        flat = shaded(flat.astype(np.float32), shade)
    alpha = _shrink(np.maximum(figure, ink), supersample)
    colors = _shrink(flat * (figure * (1 - (1 - line_tint) * ink))[..., None], supersample)
    straight = colors / np.where(alpha > 0, alpha, 1)[..., None]
    rgba = _bytes(np.concatenate([straight, 255 * alpha[..., None]], axis=-1))
    coverage = _bytes(255 * _shrink(ink, supersample))
    sampled = labels[::supersample, ::supersample]
    whole = rgba[..., 3] == 255
    if shade is None:
        whole &= (rgba[..., :3] == _colors(palette)[sampled]).all(axis=-1) & (coverage < 128)
    else:
        whole &= coverage == 0
    pure = _unmixed(labels, supersample) & whole
    return Drawing(rgba, np.where(pure, sampled, UNLABELLED), coverage)


def _colors(palette: np.ndarray) -> UInt8[np.ndarray, "256 3"]:
    """Return a colour for every label; those without one are black."""
    return np.concatenate([palette, np.zeros((256 - len(palette), 3), np.uint8)])


def _mark(
    silhouette: np.ndarray,
    inner: np.ndarray,
    figure: np.ndarray,
    labels: np.ndarray,
    depth: np.ndarray,
    jump: float,
    label_lines: bool,
) -> None:
    """Mark, in the first two, both pixels of every pair of rows with a line between them."""
    border = figure[:-1] != figure[1:]
    both = figure[:-1] & figure[1:]
    line = both & (_excess_step(depth) > jump)
    if label_lines:
        line |= both & (labels[:-1] != labels[1:])
    for rows in (slice(None, -1), slice(1, None)):
        silhouette[rows] |= border
        inner[rows] |= line


def _excess_step(depth: np.ndarray) -> np.ndarray:
    """Return how much each step between rows exceeds those beside it: next to 0 on slopes."""
    step = np.abs(np.diff(depth, axis=0))
    padded = np.pad(step, ((1, 1), (0, 0)), mode="edge")
    return step - np.maximum(padded[:-2], padded[2:])


def _distance(marked: Bool[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Return the distance to the line that runs between the marked pixels of its two sides."""
    if not marked.any():
        return np.full(marked.shape, np.float32(max(marked.shape)))
    return distance_to(marked).astype(np.float32) + np.float32(0.5)


def _shrink(picture: np.ndarray, factor: int) -> np.ndarray:
    """Return the mean of every block of pixels."""
    height, width = picture.shape[:2]
    return cv2.resize(picture, (width // factor, height // factor), interpolation=cv2.INTER_AREA)


def _unmixed(labels: np.ndarray, factor: int) -> np.ndarray:
    """Return in which blocks all labels are the same."""
    first = labels[::factor, ::factor]
    same = np.ones(first.shape, dtype=bool)
    for row in range(factor):
        for column in range(factor):
            same &= labels[row::factor, column::factor] == first
    return same


def _bytes(values: np.ndarray) -> np.ndarray:
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)
