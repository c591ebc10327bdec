"""Draw a figure's silhouette as a pen does: a crisp border, and the line along it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8
from pydantic import Field
from skimage.measure import find_contours

from toonset.dataset.silhouettes.mask import mask_of
from toonset.json_file import Byte
from toonset.palette.pixels.ink_lines import lightness_of, outline_line_px
from toonset.raster import depth_inside, depth_near_edge, nearest, sized_parts

FEWEST_OUTLINED = 0.5  # of a sheet's views must have an outline, for the sheet to have one
INK_QUANTILE = 0.2  # darkest part of the rim: the rest is mixed with what it surrounds
FIGURE = 128  # alpha
CLEAR = 60  # levels from paint to ink, Euclidean, for a pixel's share of ink to be told
FINER, COARSER, LARGE_PX = 3, 2, 520.0  # samples per pixel and axis; of figures from this height on
SMOOTH = 0.7 / 260  # sigma over the figure's height: what is finer in a field's opacity is noise
CRUMB_PX = 30  # area of parts and holes that are noise, in a figure of CRUMB_AT px
HOLE_PX = 80  # of holes in a field's outline: hulls of capes are torn
CRUMB_AT = 260.0
BESIDE_PX = 4  # round an outline: enlarging by cubic curves reaches two pixels
BAND_PX = 2.0  # beyond the outline, in which its soft side lies

LONGEST_PX = 4096.0  # a displacement, or how wide a line is, in files
Width = Annotated[float, Field(ge=0, le=LONGEST_PX)]

Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True)
class Outline:
    """The line round a sheet's figures.

    Attributes:
        rgb: the ink, sRGB.
        width_px: pixels of the drawings.
    """

    rgb: tuple[Byte, Byte, Byte]
    width_px: Width


def outline_of(drawings: Sequence[Picture]) -> Outline | None:
    """Return the line round a sheet's figures, None where the artist drew none.

    Its width is how much ink there is over how long the rims are.
    """
    drawings = [rgba for rgba in drawings if mask_of(rgba).any()]
    widths = [outline_width(rgba) for rgba in drawings]
    outlined = [width for width in widths if width > 0]
    if not outlined or len(outlined) < FEWEST_OUTLINED * len(widths):
        return None
    insides = [depth_inside(mask_of(rgba)) for rgba in drawings]
    pairs = list(zip(drawings, insides, strict=True))
    rgb = ink_color(rgba[(inside > 0) & (inside < 1), :3] for rgba, inside in pairs)
    reach = float(np.median(outlined)) + BAND_PX
    pictures, regions, length = [], [], 0.0
    for rgba, inside in pairs:
        if (inside > reach).any():
            pictures.append((rgba, rgba[nearest(inside > reach)]))
            regions.append((inside <= reach) & (rgba[..., 3] > 0))
            length += _rim_px(rgba[..., 3])
    width = mean_width(pictures, regions, length, rgb) or float(np.median(outlined))
    return Outline(rgb, width)


def outline_width(rgba: UInt8[np.ndarray, "height width 4"]) -> float:
    """Return the width in pixels of the dark line round the figure, 0 without one."""
    return outline_line_px(lightness_of(rgba), rgba[..., 3] >= FIGURE)


def ink_color(rims: Iterable[UInt8[np.ndarray, "n 3"]]) -> tuple[int, int, int]:
    """Return the median of the darkest pixels of all drawings' rims."""
    colors = np.concatenate(list(rims)).astype(np.float64)
    light = colors.mean(axis=1)
    red, green, blue = np.median(colors[light <= np.quantile(light, INK_QUANTILE)], axis=0)
    return round(float(red)), round(float(green)), round(float(blue))


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


def _rim_px(alpha: UInt8[np.ndarray, "height width"]) -> float:
    """Return the length of a silhouette; counting steps between pixels says 4 % too much."""
    rims = find_contours(np.pad(alpha / 255.0, 1), 0.5)
    return float(sum(np.linalg.norm(np.diff(rim, axis=0), axis=1).sum() for rim in rims))


def crisp_outline(
    alpha: Float[np.ndarray, "height width"], border: float, width_px: float, figure_px: float
) -> tuple[Float[np.ndarray, "height width"], Float[np.ndarray, "height width"]]:
    """Return a crisp coverage, and how far a line along its inner side covers every pixel.

    Args:
        alpha: a soft coverage.
        border: the coverage at the border.
        width_px: of the line; 0: none.
        figure_px: height of the figure.
    """
    finer = _finer(figure_px)
    size = (finer * alpha.shape[1], finer * alpha.shape[0])
    fine = cv2.resize(alpha.astype(np.float32), size, interpolation=cv2.INTER_CUBIC)
    inside = cv2.GaussianBlur(fine, (0, 0), SMOOTH * figure_px * finer) >= border
    return _drawn(inside, inside.astype(np.float32), width_px, figure_px, CRUMB_PX)


def inked_outline(
    inside_px: Float[np.ndarray, "height width"], width_px: float, figure_px: float
) -> tuple[Float[np.ndarray, "height width"], Float[np.ndarray, "height width"]]:
    """Return coverage and line as `crisp_outline` does, of an outline that is known exactly.

    Args:
        inside_px: how far within the outline pixels lie, < 0 beyond it.
        width_px: of the line; 0: none.
        figure_px: height of the figure.
    """
    finer, box = _finer(figure_px), _box_of(inside_px)
    part = np.ascontiguousarray(inside_px[box])
    size = (finer * part.shape[1], finer * part.shape[0])
    fine = cv2.resize(part, size, interpolation=cv2.INTER_CUBIC)
    fine *= finer
    solid = fine > 0
    fine += 0.5
    found = _drawn(solid, np.clip(fine, 0, 1, out=fine), width_px, figure_px, HOLE_PX)
    cover, ink = (np.zeros(inside_px.shape, np.float32) for _ in found)
    cover[box], ink[box] = found
    return cover, ink


def _box_of(inside_px: Float[np.ndarray, "height width"]) -> tuple[slice, slice]:
    """Return the rows and columns of all that is near or within an outline, with room all round.

    It is the whole picture if the figure comes near its edge.
    """
    near = inside_px > -BESIDE_PX
    sides = []
    for axis in (1, 0):
        found = np.flatnonzero(near.any(axis=axis))
        if not len(found) or found[0] < BESIDE_PX or found[-1] + BESIDE_PX >= near.shape[1 - axis]:
            return slice(None), slice(None)
        sides.append(slice(int(found[0]) - BESIDE_PX, int(found[-1]) + 1 + BESIDE_PX))
    return sides[0], sides[1]


def without_noise(
    alpha: Float[np.ndarray, "height width"], border: float, figure_px: float
) -> Float[np.ndarray, "height width"]:
    """Return a soft coverage with its border at a half, without crumbs and pinholes."""
    solid = alpha >= border
    noise = (figure_px / CRUMB_AT) ** 2
    kept = without_crumbs(solid, CRUMB_PX * noise, HOLE_PX * noise)
    low, high = 0.5 * alpha / border, 0.5 + 0.5 * (alpha - border) / (1 - border)
    cover = np.where(solid, high, np.minimum(low, 0.499))
    return np.where(kept == solid, cover, kept).astype(np.float32)


def _finer(figure_px: float) -> int:
    return FINER if figure_px < LARGE_PX else COARSER


def _drawn(
    solid: Bool[np.ndarray, "rows columns"],
    cover: Float[np.ndarray, "rows columns"],
    width_px: float,
    figure_px: float,
    hole_px: float,
) -> tuple[Float[np.ndarray, "height width"], Float[np.ndarray, "height width"]]:
    """Return coverage and line at a view's own pixels."""
    finer = _finer(figure_px)
    size = (solid.shape[1] // finer, solid.shape[0] // finer)
    noise = (finer * figure_px / CRUMB_AT) ** 2
    inside = without_crumbs(solid, CRUMB_PX * noise, hole_px * noise)
    if inside is not solid:
        cover = np.where(inside == solid, cover, inside).astype(np.float32)
    ink = np.zeros(size[::-1], np.float32)
    if width_px > 0:
        reach = finer * width_px + 0.5
        depth = np.maximum(depth_near_edge(inside, math.ceil(reach + 0.5)), 0)
        line = np.subtract(np.float32(reach), depth, out=depth)
        line = np.clip(line, 0, 1, out=line)
        line *= cover
        ink = cv2.resize(line, size, interpolation=cv2.INTER_AREA)
    return cv2.resize(cover, size, interpolation=cv2.INTER_AREA), ink


def without_crumbs(
    mask: Bool[np.ndarray, "height width"], least_px: float, hole_px: float | None = None
) -> Bool[np.ndarray, "height width"]:
    """Return a mask without patches of fewer pixels, and holes of fewer than `hole_px`."""
    for value, least in ((True, least_px), (False, least_px if hole_px is None else hole_px)):
        if least <= 1:  # no part is smaller
            continue
        part, areas = sized_parts(mask if value else ~mask, connectivity=4)
        small = areas < least
        small[0] = False
        if small.any():
            mask = mask ^ np.take(small, part)
    return mask
