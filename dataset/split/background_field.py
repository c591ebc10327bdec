"""Fit backgrounds whose colour changes over the sheet: gradients, vignettes, uneven paper.

Both fields are fitted on a small copy of the sheet, by robust least squares on the border first and
then on everything inside that agrees: figures are outliers.
Source: normalised convolution, H. Knutsson, C.-F. Westin (1993), for the smooth field.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from toonset.view import Box

SMALL_PX = 192  # longest side of the copy that the field is fitted on
ROUNDS = 8  # of fitting and choosing what agrees
WIDEST_LEVELS = 40.0  # pixels that agree in the first round
NARROWEST_LEVELS = 8.0  # and in the last
SMOOTHNESS = 0.06  # of the longest side: width of the smooth field's kernel
ZONE_SCALES = 5  # widths of a zone's kernels, each half of the last
ENOUGH = 0.1  # of a kernel: so much of the zone in it tells the colour


@dataclass(frozen=True, eq=False)
class Field:
    """A colour for every place of a sheet, known on a grid and linear in between.

    Attributes:
        grid: (rows, columns, 3) sRGB levels at the centres of equal cells.
        size_wh: of the sheet in pixels.
    """

    grid: Float[np.ndarray, "rows columns 3"]
    size_wh: tuple[int, int]

    @property
    def typical(self) -> tuple[int, int, int]:
        """Return the median colour."""
        red, green, blue = (round(float(x)) for x in np.median(self.grid, axis=(0, 1)))
        return red, green, blue

    def colors(self, box: Box) -> UInt8[np.ndarray, "height width 3"]:
        """Return the colours in a window (x, y, width, height) of the sheet."""
        rows, columns = self.grid.shape[:2]
        x, y, width, height = box
        u = ((np.arange(x, x + width) + 0.5) * columns / self.size_wh[0] - 0.5).astype(np.float32)
        v = ((np.arange(y, y + height) + 0.5) * rows / self.size_wh[1] - 0.5).astype(np.float32)
        u, v = np.clip(u, 0, columns - 1), np.clip(v, 0, rows - 1)
        tall = _between(self.grid.astype(np.float32), v)  # (height, columns, 3)
        left = np.minimum(u.astype(int), columns - 2)
        share = (u - left)[:, None]
        wide = tall[:, left] * (1 - share) + tall[:, left + 1] * share
        return np.rint(np.clip(wide, 0, 255)).astype(np.uint8)

    def sampled(self, places: tuple[np.ndarray, np.ndarray]) -> Float[np.ndarray, "n 3"]:
        """Return the field's colours at the pixels (rows, columns) of the sheet."""
        rows, columns = self.grid.shape[:2]
        width, height = self.size_wh
        u = (places[1] + 0.5) * columns / width - 0.5
        v = (places[0] + 0.5) * rows / height - 0.5
        source = self.grid.astype(np.float32)
        maps = [m.astype(np.float32)[None] for m in (u, v)]
        shorter = 30_000  # OpenCV's remap takes no longer rows
        parts = [
            cv2.remap(
                source,
                maps[0][:, i : i + shorter],
                maps[1][:, i : i + shorter],
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )[0]
            for i in range(0, len(u), shorter)
        ]
        return np.concatenate(parts)


def fit_gradient(rgba: UInt8[np.ndarray, "height width 4"], inset: float = 0.0) -> Field:
    """Return the quadratic gradient that border and inside agree on.

    Args:
        rgba: the sheet.
        inset: share of the shorter side at which the border begins, inside of a frame.
    """
    small, size_wh = _small(rgba)
    basis = _quadratics(*small.shape[:2])
    flat = small.reshape(-1, 3)
    trusted = _border(small.shape[0], small.shape[1], inset).ravel().astype(np.float64)
    coefficients = np.zeros((basis.shape[1], 3))
    for width in np.geomspace(WIDEST_LEVELS, NARROWEST_LEVELS, ROUNDS):
        weight = np.sqrt(trusted)[:, None]
        coefficients = np.linalg.lstsq(basis * weight, flat * weight, rcond=None)[0]
        off = np.abs(flat - basis @ coefficients).max(axis=1)
        trusted = 1 / (1 + (off / width) ** 2) ** 2  # Geman-McClure: figures fade out
    return Field((basis @ coefficients).reshape(small.shape), size_wh)


def fit_smooth(rgba: UInt8[np.ndarray, "height width 4"], start: Field) -> Field:
    """Return the smooth field around a gradient that the pixels near it show."""
    small, size_wh = _small(rgba)
    sigma = SMOOTHNESS * max(small.shape[:2])
    field = start.grid
    for width in np.geomspace(WIDEST_LEVELS, NARROWEST_LEVELS, ROUNDS):
        off = (small - field).astype(np.float32)
        trusted = (np.abs(off).max(axis=2) <= width).astype(np.float32)
        total = cv2.GaussianBlur(trusted, (0, 0), sigma)
        step = cv2.GaussianBlur(off * trusted[..., None], (0, 0), sigma)
        field = field + step / np.maximum(total, 1e-3)[..., None]
    return Field(field, size_wh)


def fit_zone(
    rgb: UInt8[np.ndarray, "height width 3"], mask: Bool[np.ndarray, "height width"]
) -> Field:
    """Return the smooth field that a part of a picture shows; beyond it, as at its nearest."""
    small, size_wh = _small(np.dstack([rgb, mask.view(np.uint8)]))
    cover, _ = _small(np.repeat(255 * mask.view(np.uint8)[..., None], 3, axis=2))
    known = (cover[..., 0] == 255).astype(np.float32)
    colors = small.astype(np.float32) * known[..., None]
    field = np.full_like(colors, colors.sum(axis=(0, 1)) / max(float(known.sum()), 1.0))
    for halvings in range(ZONE_SCALES):  # the finest that has something to go by
        sigma = max(small.shape[:2]) / 2 ** (halvings + 1)
        total = cv2.GaussianBlur(known, (0, 0), sigma)[..., None]
        mean = cv2.GaussianBlur(colors, (0, 0), sigma) / np.maximum(total, 1e-6)
        trust = np.clip(total / ENOUGH, 0, 1)
        field = trust * mean + (1 - trust) * field
    return Field(field.astype(np.float64), size_wh)


def _small(rgba: np.ndarray) -> tuple[Float[np.ndarray, "rows columns 3"], tuple[int, int]]:
    height, width = rgba.shape[:2]
    shrink = min(1.0, SMALL_PX / max(height, width))
    size = max(2, round(width * shrink)), max(2, round(height * shrink))
    step = max(1, int(0.25 / shrink))  # a few pixels per cell tell as much as all
    picture = cv2.resize(
        np.ascontiguousarray(rgba[::step, ::step, :3]), size, interpolation=cv2.INTER_AREA
    )
    return picture.astype(np.float64), (width, height)


def _border(rows: int, columns: int, inset: float) -> Bool[np.ndarray, "rows columns"]:
    begin = round(inset * min(rows, columns))
    border = np.zeros((rows, columns), dtype=bool)
    border[begin : rows - begin, begin : columns - begin] = True
    border[begin + 3 : rows - begin - 3, begin + 3 : columns - begin - 3] = False
    return border


def _quadratics(rows: int, columns: int) -> Float[np.ndarray, "cells 6"]:
    grids = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    y, x = (grid.ravel() for grid in grids)
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)


def _between(grid: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the grid's rows at fractional places."""
    above = np.minimum(v.astype(int), len(grid) - 2)
    share = (v - above)[:, None, None]
    return grid[above] * (1 - share) + grid[above + 1] * share
