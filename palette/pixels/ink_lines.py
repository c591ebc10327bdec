"""Detect contour lines: how far ink covers every pixel, black cloth and hair excepted.

A line is dark and thin. Closing the picture's lightness with a disc a little wider than the line
fills the line and nothing that is thicker; what the closing fills, as a share of the way from the
surroundings' lightness to the ink's, is how far the line covers the pixel. Source: J. Serra, "Image
Analysis and Mathematical Morphology" (1982), the black top-hat.

A line between a light and a dark colour is filled only up to the dark one; its soft pixels on the
light side are measured against their lightest neighbour. Along cloth as black as the ink no line
can be seen: where the figure has an outline nearly all round, it goes on there with its own width.
Lines lighter than both sides are not found.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from toonset.palette.pixels.enlarged import find_grid
from toonset.palette.pixels.grain import remove_grain
from toonset.palette.pixels.labels import BAND_PX
from toonset.palette.pixels.opacity import opaque_inside

Morphology = Callable[..., np.ndarray]  # cv2.dilate or cv2.erode

SLACK, ROOM_PX = 1.6, 1.5  # the disc's diameter over the line's width: corners and crossings fit in
LEAST_DEPTH = 24  # levels below the surroundings: less is shading or noise
LEAST_FILLED = 10  # levels: less covers nothing
INK = 20  # percentile of the lightness in lines: thin lines' cores are not pure
DARK = 0.25  # of the way from ink to white: as dark as ink
OUTLINED = 0.7  # of the rim that must be dark for an outline all round
SURE = 0.9  # of a layer of the rim that must be dark for its line to be measured there first
SEEN = 0.3  # of the rim that must be a line by itself, for the rest to go on
ROUND = 0.5  # of the rim that must be a line for its width to be told
DARKEST = 100  # lightness of 255: a lighter rim is not ink
WIDEST = 0.04  # of the figure's height: wider is a limb
SOFT = 0.004  # of the figure's height: so far inside a blurred rim its line may be dark only
MEASURED_PX = 800  # height of a figure on which its line's width is measured
SQUARE = np.ones((3, 3), dtype=np.uint8)
CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], dtype=np.uint8)


def find_contour(
    rgba: UInt8[np.ndarray, "height width 4"], line_width_px: float | None = None
) -> UInt8[np.ndarray, "height width"]:
    """Return how far the drawn lines cover every pixel, 0 to 255; 128 and more is a line's.

    Time grows with pixels times line width; about 7 bytes per pixel are used.

    Args:
        rgba: sRGB with straight alpha; what is transparent counts as white paper.
        line_width_px: of the outline, 0 = there is none; None measures it along the figure's rim.
    """
    light = lightness_of(rgba)
    mask = rgba[..., 3] >= 128
    none = np.zeros(mask.shape, dtype=np.uint8)
    width = outline_line_px(light, mask) if line_width_px is None else line_width_px
    if width <= 0 or not mask.any():
        return none
    closed = _closed(light, _reach(width))
    filled = closed - light
    if filled.max() < LEAST_DEPTH:
        return none
    ink = _ink(light, filled)
    cover = _coverage(light, closed, ink)
    _soften(cover, light, closed, ink)
    rim = mask & ~_eroded(mask, 1)
    dark = light <= ink + DARK * (255 - ink)
    if dark[rim].mean() > OUTLINED and (cover[rim] >= 128).mean() > SEEN:
        cover[mask & ~_eroded(mask, round(width)) & dark] = 255
    return cover


def find_contours(
    pictures: Sequence[UInt8[np.ndarray, "height width 4"]],
) -> list[UInt8[np.ndarray, "height width"]]:
    """Return how far the drawn lines cover every pixel of a sheet's drawings, grain taken off."""
    solid = [opaque_inside(picture) for picture in pictures]
    return [_in_blocks(picture) for picture in remove_grain(solid)]


def _in_blocks(rgba: UInt8[np.ndarray, "height width 4"]) -> UInt8[np.ndarray, "height width"]:
    """Return the lines of a drawing; of one that was enlarged without smoothing, by blocks."""
    grid = find_grid(rgba)
    if grid is None:
        return find_contour(rgba)
    return grid.enlarged(find_contour(np.ascontiguousarray(grid.reduced(rgba))))


def outline_line_px(
    light: UInt8[np.ndarray, "height width"], mask: Bool[np.ndarray, "height width"]
) -> float:
    """Return the width of the dark line round the figure: 0 where less than half of it has one.

    The line is as wide as the disc that just fails to fill it. Large figures are measured on a
    smaller copy: time grows with the square of the height up to there only. What was scanned or
    enlarged has a soft rim: its line is dark a little further in.

    Args:
        light: lightness over white paper.
        mask: the figure.
    """
    tall = int(mask.any(axis=1).sum())
    if tall > MEASURED_PX:
        shrink = tall / MEASURED_PX
        size = max(1, round(light.shape[1] / shrink)), max(1, round(light.shape[0] / shrink))
        small = cv2.resize(light, size, interpolation=cv2.INTER_AREA)
        covered = cv2.resize(mask.view(np.uint8), size, interpolation=cv2.INTER_AREA) > 0
        return shrink * outline_line_px(small, covered)
    rims = _dark_rims(light, mask, int(SOFT * tall))
    widths = (_width_at(light, rim, int(WIDEST * tall / 2) + 1) for rim in rims)
    return next((width for width in widths if width > 0), 0.0)


def _width_at(light: np.ndarray, rim: np.ndarray, widest: int) -> float:
    """Return the width of the line under a layer of pixels; 0 where less than half has one."""
    dark = light[rim] <= DARKEST
    before = 0.0
    for reach in range(1, widest + 1):
        filled = _closed(light, reach)[rim] - light[rim]
        share = float((dark & (filled >= LEAST_DEPTH)).mean())
        if share >= ROUND:  # between the last disc, 2 reach - 1 px wide, and this one
            return 2 * reach - 2 + 2 * (ROUND - before) / (share - before)
        before = share
    return 0.0


def _dark_rims(light: np.ndarray, mask: np.ndarray, deepest: int) -> list[np.ndarray]:
    """Return the mask's outermost layers that are dark enough for a line, sure ones first."""
    inside = [_eroded(mask, reach) for reach in range(deepest + 2)]
    layers = [outer & ~inner for outer, inner in itertools.pairwise(inside)]
    shares = [(light[layer] <= DARKEST).sum() / max(int(layer.sum()), 1) for layer in layers]
    dark = [i for i, share in enumerate(shares) if share >= ROUND]
    return [layers[i] for i in sorted(dark, key=lambda i: shares[i] < SURE)]


def lightness_of(rgba: np.ndarray) -> UInt8[np.ndarray, "height width"]:
    """Return luma over white paper."""
    light = cv2.cvtColor(np.ascontiguousarray(rgba), cv2.COLOR_RGBA2GRAY)
    for rows in _bands(light):
        alpha = rgba[rows, :, 3].astype(np.uint16)
        light[rows] = (light[rows] * alpha + 255 * (255 - alpha) + 127) // 255
    return light


def _reach(width: float) -> int:
    """Return the radius of the disc that fills lines of a width."""
    return max(1, int(np.ceil(SLACK * width + ROOM_PX)) // 2)


def _closed(light: np.ndarray, reach: int) -> np.ndarray:
    """Return the closing with an octagon of a radius, on paper that goes on round the picture."""
    room = 2 * reach + 1
    paper = cv2.copyMakeBorder(light, room, room, room, room, cv2.BORDER_CONSTANT, value=255)
    for change in (cv2.dilate, cv2.erode):
        paper = _octagon(change, paper, reach)
    inside = slice(room, -room)
    return paper[inside, inside]


def _octagon(change: Morphology, picture: np.ndarray, reach: int) -> np.ndarray:
    """Return the dilation or erosion with an octagon: a square's, then a diamond's."""
    square = round(reach * (np.sqrt(2) - 1))
    picture = change(picture, np.ones((2 * square + 1, 2 * square + 1), dtype=np.uint8))
    return change(picture, CROSS, None, (-1, -1), reach - square)


def _eroded(mask: np.ndarray, reach: int) -> np.ndarray:
    bordered = np.pad(mask, 1).astype(np.uint8)
    return _octagon(cv2.erode, bordered, reach)[1:-1, 1:-1] > 0


def _ink(light: np.ndarray, filled: np.ndarray) -> float:
    """Return the ink's lightness: a low percentile where the closing has filled most."""
    counts = np.bincount(filled[filled >= LEAST_DEPTH], minlength=256)
    deep = int(np.searchsorted(counts.cumsum(), 0.9 * counts.sum()))
    return float(np.percentile(light[filled >= max(LEAST_DEPTH, deep // 2)], INK))


def _coverage(light: np.ndarray, closed: np.ndarray, ink: float) -> np.ndarray:
    """Return the filled part as a share of the way from the surroundings to the ink."""
    cover = np.zeros_like(light)
    for rows in _bands(light):
        filled = closed[rows] - light[rows]
        share = _share(closed[rows], light[rows], ink)
        cover[rows] = np.where(filled >= LEAST_FILLED, share, 0)
    return cover


def _soften(cover: np.ndarray, light: np.ndarray, closed: np.ndarray, ink: float) -> None:
    """Measure the soft pixels of lines beside a dark colour against their lightest neighbour."""
    beside = cv2.dilate((cover >= 128).astype(np.uint8), SQUARE)
    lightest, darkest = cv2.dilate(light, SQUARE), cv2.erode(closed, SQUARE)
    for rows in _bands(light):
        soft = (beside[rows] > 0) & (cover[rows] < 128) & (light[rows] > darkest[rows])
        share = _share(lightest[rows], light[rows], ink)
        cover[rows] = np.where(soft, np.maximum(cover[rows], share), cover[rows])


def _share(above: np.ndarray, light: np.ndarray, ink: float) -> np.ndarray:
    """Return how far `light` lies from `above` towards the ink, in 255ths."""
    room = np.maximum(above - np.float32(ink), LEAST_FILLED)
    return np.rint(255 * np.clip((above - light) / room, 0, 1)).astype(np.uint8)


def _bands(picture: np.ndarray) -> Iterator[slice]:
    height, width = picture.shape
    step = max(1, BAND_PX // max(width, 1))
    return (slice(top, top + step) for top in range(0, height, step))
