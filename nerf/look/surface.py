"""Smooth the surface that a view shows, so that what is carried over it keeps its lines.

A field's surface is rough by a hundredth of the figure's height, and a drawing looked up over it
frays. It is smoothed as a bilateral grid does: depths are sorted into levels, every level is
blurred by itself, and a pixel takes its own level's mean. Steps between two parts of the figure
stay, and nothing is moved farther than one level.

Source: Chen, Paris and Durand 2007, "Real-time edge-aware image processing with the bilateral
grid".
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float

from toonset.raster import nearest

# Of the figure's height: depths this far apart belong to two surfaces, in one round after another
LEVELS = (0.0375, 0.05, 0.075)
ACROSS, DOWN = 0.025, 0.04  # of the height: sigmas of the blur; rows are rougher than columns
COARSE = 2.0  # cells per sigma
BEYOND = 0.01  # of the height: sigma by which the surface goes on beyond the figure

Depth = Float[np.ndarray, "h w"]


def smooth_surface(
    depth: Depth, there: Bool[np.ndarray, "h w"], height: float, figure_px: float
) -> Float[np.ndarray, "h w"]:
    """Return a view's depth, smoothed over every surface and gone on beyond the figure.

    Args:
        depth: world units, without gaps.
        there: where it is the figure's; elsewhere it is not read.
        height: of the figure, world units.
        figure_px: the same in pixels.
    """
    if not there.any():
        return depth.astype(np.float32)
    for level in LEVELS:
        depth = _smoothed(depth, there, level * height, figure_px)
    if not there.all():
        far = depth[nearest(there)].astype(np.float32)
        depth = np.where(there, depth, cv2.GaussianBlur(far, (0, 0), BEYOND * figure_px))
    return depth.astype(np.float32)


def _smoothed(
    depth: Depth, there: Bool[np.ndarray, "h w"], apart: float, figure_px: float
) -> Float[np.ndarray, "h w"]:
    """Return depth after one round; surfaces that are `apart` world units apart stay."""
    level = (depth - depth[there].min()) / apart + 1
    count = int(level[there].max()) + 3
    cell = max(1, round(ACROSS * figure_px / COARSE))
    rows, columns = (-(-size // cell) for size in depth.shape)
    y, x = np.nonzero(there)
    own = level[there]
    low = np.floor(own)
    at = (low.astype(np.int64) * rows + y // cell) * columns + x // cell
    sums = np.zeros((2, count * rows * columns), np.float64)
    for step, share in ((0, 1 - own + low), (1, own - low)):
        for total, values in zip(sums, (share, share * own), strict=True):
            total += np.bincount(at + step * rows * columns, values, sums.shape[1])
    sums = sums.astype(np.float32).reshape(2, count, rows, columns)
    sigmas = (ACROSS * figure_px / cell, DOWN * figure_px / cell)
    for grid in sums.reshape(-1, rows, columns):
        cv2.GaussianBlur(grid, (0, 0), sigmas[0], grid, sigmas[1])
    weight, total = (_sliced(grid, np.where(there, level, 0), cell) for grid in sums)
    mean = total / np.maximum(weight, 1e-9)
    mean = np.where(there & (weight > 1e-6), mean, level)
    mean = level + (mean - level).clip(-1, 1)
    return (mean - 1) * apart + depth[there].min()


def _sliced(
    grid: Float[np.ndarray, "levels rows columns"], level: Float[np.ndarray, "h w"], cell: int
) -> Float[np.ndarray, "h w"]:
    """Return a grid's values at every pixel's place and level, linear in all three."""
    rows, columns = level.shape
    y, x = ((np.arange(size, dtype=np.float32) + 0.5) / cell - 0.5 for size in (rows, columns))
    y, x = y.clip(0, grid.shape[1] - 1)[:, None], x.clip(0, grid.shape[2] - 1)[None]
    x = np.broadcast_to(x, level.shape).astype(np.float32)
    tall = grid.reshape(-1, grid.shape[2])
    low = np.floor(level).clip(0, len(grid) - 2)
    found = np.zeros(level.shape, np.float32)
    for step in (0, 1):
        at = (y + (low + step) * grid.shape[1]).astype(np.float32)
        found += (1 - np.abs(level - low - step)) * cv2.remap(tall, x, at, cv2.INTER_LINEAR)
    return found
