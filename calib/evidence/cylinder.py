"""Read a figure as a stack of round cross-sections: each pixel's longitude on the turning body.

Every row's widest run of figure pixels is taken for a round cross-section seen from the side: a
pixel at `t` in [-1, 1] across it lies `asin(t)` to the right of the point that faces the viewer.
Rough as it is (a body is not a stack of discs), all cues about the turn read the picture this way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.palette.colors import oklab_from_rgb
from toonset.raster import depth_inside
from toonset.view import View

THIN = 1 / 40  # of the figure's height: what an opening with this radius removes is not a body


@dataclass(frozen=True, eq=False)
class Sections:
    """A figure at a working scale, cropped to its box.

    Attributes:
        lab: (height, width, 3) OKLab.
        across: (height, width) position in the row's cross-section, -1 = left edge, 1 = right edge.
        inside: (height, width) pixels of a cross-section that lie deeper than the contour's ink.
        widths: (height,) of the cross-sections in pixels, 0 where there is none.
    """

    lab: Float[np.ndarray, "height width 3"]
    across: Float[np.ndarray, "height width"]
    inside: Bool[np.ndarray, "height width"]
    widths: Int[np.ndarray, " height"]


def figure_height(views: Sequence[View]) -> float:
    """Return the views' median figure height in pixels."""
    spans = [np.flatnonzero(view.mask.any(axis=1))[[0, -1]] for view in views]
    return float(np.median([last + 1 - first for first, last in spans]))


def read_sections(view: View, factor: float, rim_px: float, height: float) -> Sections:
    """Return the figure's cross-sections.

    Args:
        view: the drawing.
        factor: working pixels per pixel of the view.
        rim_px: working pixels beside the contour line that are left out, too: mixed colours.
        height: of the whole figure in working pixels.
    """
    lab, mask = _resized(view, factor)
    radius = max(1, round(THIN * height))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    body = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc)
    left, right = _widest_runs(body)
    columns = np.arange(mask.shape[1])
    in_run = (columns >= left[:, None]) & (columns < right[:, None])
    widths = right - left
    middle, half = (left + right)[:, None] / 2, np.maximum(widths, 1)[:, None] / 2
    deep = depth_inside(mask) > view.line_width_px * factor + rim_px - 0.5
    return Sections(lab, (columns + 0.5 - middle) / half, in_run & deep, widths)


def _resized(
    view: View, factor: float
) -> tuple[Float[np.ndarray, "height width 3"], Bool[np.ndarray, "height width"]]:
    """Return OKLab and mask of the figure's box; colours are mixed by coverage."""
    rows, columns = (np.flatnonzero(view.mask.any(axis=axis)) for axis in (1, 0))
    crop = view.rgba[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].astype(np.float32)
    alpha = crop[..., 3:] / 255
    size = (max(1, round(factor * crop.shape[1])), max(1, round(factor * crop.shape[0])))
    way = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    weighed = np.concatenate([crop[..., :3] * alpha, alpha], axis=-1)
    mixed = cv2.resize(weighed, size, interpolation=way)
    rgb = np.rint(mixed[..., :3] / np.maximum(mixed[..., 3:], 1e-3)).clip(0, 255)
    return oklab_from_rgb(rgb.astype(np.uint8)), mixed[..., 3] >= 0.5


def _widest_runs(mask: np.ndarray) -> tuple[Int[np.ndarray, " height"], Int[np.ndarray, " height"]]:
    """Return first column and end of every row's widest run of ones; (0, 0) where there is none."""
    steps = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, first = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    left, right = np.zeros((2, len(mask)), dtype=int)
    order = np.argsort(end - first, kind="stable")  # the widest of a row is written last
    left[row[order]], right[row[order]] = first[order], end[order]
    return left, right
