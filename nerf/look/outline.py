"""Draw a figure's silhouette as a pen does: a crisp border, and the line along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8
from skimage.measure import find_contours

from toonset.dataset.silhouettes.mask import mask_of
from toonset.nerf.look.strokes import FEWEST_OUTLINED, ink_color, mean_width, outline_width
from toonset.raster import depth_inside, nearest, sized_parts

FINER, COARSER, LARGE_PX = 3, 2, 520.0  # samples per pixel and axis; of figures from this height on
SMOOTH = 0.7 / 260  # sigma over the figure's height: what is finer in a field's opacity is noise
CRUMB_PX = 30  # area of parts and holes that are noise, in a figure of CRUMB_AT px
CRUMB_AT = 260.0
BAND_PX = 2.0  # beyond the outline, in which its soft side lies

Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True)
class Outline:
    """The line round a sheet's figures.

    Attributes:
        rgb: the ink, sRGB.
        width_px: pixels of the drawings.
    """

    rgb: tuple[int, int, int]
    width_px: float


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


def _rim_px(alpha: UInt8[np.ndarray, "height width"]) -> float:
    """Return the length of a silhouette; counting steps between pixels says 4 % too much."""
    rims = find_contours(np.pad(alpha / 255.0, 1), 0.5)
    return float(sum(np.linalg.norm(np.diff(rim, axis=0), axis=1).sum() for rim in rims))


def crisp_outline(
    alpha: Float[np.ndarray, "height width"],
    border: float,
    width_px: float,
    figure_px: float,
    hole_px: float = CRUMB_PX,
) -> tuple[Float[np.ndarray, "height width"], Float[np.ndarray, "height width"]]:
    """Return a crisp coverage, and how far a line along its inner side covers every pixel.

    Args:
        alpha: a soft coverage.
        border: the coverage at the border.
        width_px: of the line; 0: none.
        figure_px: height of the figure.
        hole_px: smaller holes are noise: area in a figure of CRUMB_AT px.
    """
    height, width = alpha.shape
    finer = FINER if figure_px < LARGE_PX else COARSER
    size = (finer * width, finer * height)
    fine = cv2.resize(alpha.astype(np.float32), size, interpolation=cv2.INTER_CUBIC)
    inside = cv2.GaussianBlur(fine, (0, 0), SMOOTH * figure_px * finer) >= border
    samples = (figure_px / CRUMB_AT) ** 2 * finer**2
    inside = without_crumbs(inside, CRUMB_PX * samples, hole_px * samples)
    ink = np.zeros_like(alpha, dtype=np.float32)
    if width_px > 0:
        depth = depth_inside(inside).astype(np.float32)
        line = np.clip(finer * width_px + 0.5 - depth, 0, 1) * inside
        ink = cv2.resize(line, (width, height), interpolation=cv2.INTER_AREA)
    cover = cv2.resize(inside.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    return cover, np.minimum(ink, cover)


def without_crumbs(
    mask: Bool[np.ndarray, "height width"], least_px: float, hole_px: float | None = None
) -> Bool[np.ndarray, "height width"]:
    """Return a mask without patches of fewer pixels, and holes of fewer than `hole_px`."""
    for value, least in ((True, least_px), (False, least_px if hole_px is None else hole_px)):
        part, areas = sized_parts(mask if value else ~mask, connectivity=4)
        small = areas < least
        small[0] = False
        if small.any():
            mask = mask ^ np.take(small, part)
    return mask
