"""Smooth the surface that a view shows, so that what is carried over it keeps its lines.

A field's surface is rough by a hundredth of the figure's height, and a drawing looked up over it
frays. It is smoothed as a bilateral grid does: depths are sorted into levels, every level is
blurred by itself, and a pixel takes its own level's mean. Steps between two parts of the figure
stay, and nothing is moved farther than one level.

Source: Chen, Paris and Durand 2007, "Real-time edge-aware image processing with the bilateral
grid".
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from toonset.nerf.look.drawings import crisp
from toonset.raster import nearest, taken

# Of the figure's height: depths this far apart belong to two surfaces, in one round after another
LEVELS = (0.0375, 0.05, 0.075)
ACROSS, DOWN = 0.025, 0.04  # of the height: sigmas of the blur; rows are rougher than columns
COARSE = 2.0  # cells per sigma
ONE = np.ones(1)  # blurs nothing
BEYOND = 0.01  # of the height: sigma by which the surface goes on beyond the figure

Depth = Float[np.ndarray, "h w"]


def smooth_surface(depth: Depth, height: float, figure_px: float) -> Float[np.ndarray, "h w"]:
    """Return a view's depth, smoothed over every surface and gone on beyond the figure.

    Args:
        depth: world units, nan beyond the figure.
        height: of the figure, world units.
        figure_px: the same in pixels.
    """
    there = np.isfinite(depth)
    if not there.any():
        return np.zeros(depth.shape, np.float32)
    at = nearest(there)
    depth, grid = crisp(taken(depth, at).astype(np.float32)), _Grid.of(there, figure_px)
    for level in LEVELS:
        depth = grid.smoothed(depth, level * height)
    if not there.all():
        far = cv2.GaussianBlur(taken(depth, at).astype(np.float32), (0, 0), BEYOND * figure_px)
        depth = np.where(there, depth, far)
    return depth.astype(np.float32)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Cells of a view's pixels.

    Attributes:
        there: (h, w) pixels that count.
        cells: (n,) the cell, row after row, of each of these.
        size: rows and columns of cells.
        at: (h, w) column and row of every pixel between the cells' centres.
        blurs: (k, 1) along columns and along rows of cells.
    """

    there: Bool[np.ndarray, "h w"]
    cells: Int[np.ndarray, " n"]
    size: tuple[int, int]
    at: tuple[Depth, Depth]
    blurs: tuple[Float[np.ndarray, "k 1"], Float[np.ndarray, "j 1"]]

    @classmethod
    def of(cls, there: Bool[np.ndarray, "h w"], figure_px: float) -> _Grid:
        """Return the cells of a view whose figure is `figure_px` tall."""
        cell = max(1, round(ACROSS * figure_px / COARSE))
        y, x = (np.arange(size) for size in there.shape)
        rows, columns = (-(-size // cell) for size in there.shape)
        cells = (y // cell * columns)[:, None] + x // cell
        v, u = (
            ((at + 0.5) / cell - 0.5).clip(0, most - 1).astype(np.float32)
            for at, most in ((y, rows), (x, columns))
        )
        across, down = (sigma * figure_px / cell for sigma in (ACROSS, DOWN))
        kernels = (cv2.getGaussianKernel(round(8 * at + 1) | 1, at) for at in (across, down))
        places = (np.broadcast_to(u, there.shape).copy(), np.broadcast_to(v[:, None], there.shape))
        return cls(there, cells[there], (rows, columns), places, (next(kernels), next(kernels)))

    def smoothed(self, depth: Depth, apart: float) -> Depth:
        """Return depth after one round; surfaces that are `apart` world units apart stay."""
        least = depth[self.there].min()
        level = np.where(self.there, (depth - least) / apart, 0).astype(np.float32) + 1
        own, (rows, columns) = level[self.there], self.size
        low = np.floor(own)
        count, part = int(own.max()) + 3, own - low
        at = low.astype(np.int64) * rows * columns + self.cells
        sums = np.zeros((2, count * rows * columns))
        for step, share in ((0, 1 - part), (1, part)):
            for total, values in zip(sums, (share, share * own), strict=True):
                total += np.bincount(at + step * rows * columns, values, sums.shape[1])
        # both blurs at once of all levels, side by side and then below each other
        wide = sums.astype(np.float32).reshape(2 * count, rows, columns).swapaxes(0, 1)
        across, down = self.blurs
        wide = cv2.sepFilter2D(wide.reshape(rows, -1), -1, ONE, down)
        tall = wide.reshape(rows, 2 * count, columns).swapaxes(0, 1).reshape(-1, columns)
        sums = cv2.sepFilter2D(tall, -1, across, ONE).reshape(2, -1, columns)
        u, v = self.at
        low, below = np.floor(level), level - np.floor(level)
        first = v + low * np.float32(rows)
        weight, total = (
            (1 - below) * cv2.remap(one, u, first, cv2.INTER_LINEAR)
            + below * cv2.remap(one, u, first + np.float32(rows), cv2.INTER_LINEAR)
            for one in sums
        )
        known = self.there & (weight > 1e-6)
        off = (total / np.maximum(weight, 1e-9) - level).clip(-1, 1)
        return (np.where(known, level + off, level) - 1) * apart + least
