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

from toonset.nerf.look.crisp_depth import crisp
from toonset.raster import in_rows, nearest, taken

# Of the figure's height: depths this far apart belong to two surfaces, in one round after another
LEVELS = (0.0375, 0.05, 0.075)
ACROSS, DOWN = 0.025, 0.04  # of the height: sigmas of the blur; rows are rougher than columns
COARSE = 2.0  # cells per sigma
ONE = np.ones(1)  # blurs nothing
BEYOND = 0.01  # of the height: sigma by which the surface goes on beyond the figure

Depth = Float[np.ndarray, "h w"]
Depths = Float[np.ndarray, "n row"]


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
    whole, grid = crisp(taken(depth, at).astype(np.float32)), _Grid.of(there, figure_px)
    found = whole.take(grid.pixels)
    for level in LEVELS:
        found = grid.smoothed(found, level * height)
    whole.reshape(-1)[grid.pixels] = found
    if not there.all():
        far = cv2.GaussianBlur(taken(whole, at), (0, 0), BEYOND * figure_px)
        whole = np.where(there, whole, far)
    return whole


@dataclass(frozen=True, eq=False)
class _Grid:
    """Cells of a view's pixels.

    Attributes:
        pixels: (n, row) numbers of those that count: see `toonset.raster.in_rows`.
        cells: (m,) the cell, row after row, of each of these, once.
        size: rows and columns of cells.
        at: (n, row) column and row of every pixel between the cells' centres.
        blurs: (k, 1) along columns and along rows of cells.
    """

    pixels: Int[np.ndarray, "n row"]
    cells: Int[np.ndarray, " m"]
    size: tuple[int, int]
    at: tuple[Depths, Depths]
    blurs: tuple[Float[np.ndarray, "k 1"], Float[np.ndarray, "j 1"]]

    @classmethod
    def of(cls, there: Bool[np.ndarray, "h w"], figure_px: float) -> _Grid:
        """Return the cells of a view whose figure is `figure_px` tall."""
        cell = max(1, round(ACROSS * figure_px / COARSE))
        size = tuple(-(-side // cell) for side in there.shape)
        count, pixels = np.count_nonzero(there), in_rows(np.flatnonzero(there))
        y, x = np.divmod(pixels, there.shape[1])
        cells = y // cell * size[1] + x // cell
        v, u = (
            ((at + 0.5) / cell - 0.5).clip(0, most - 1).astype(np.float32)
            for at, most in ((y, size[0]), (x, size[1]))
        )
        across, down = (sigma * figure_px / cell for sigma in (ACROSS, DOWN))
        kernels = (cv2.getGaussianKernel(round(8 * at + 1) | 1, at) for at in (across, down))
        return cls(
            pixels,
            cells.reshape(-1)[:count],
            (size[0], size[1]),
            (u, v),
            (next(kernels), next(kernels)),
        )

    def smoothed(self, depth: Depths, apart: float) -> Depths:
        """Return depths after one round; surfaces that are `apart` world units apart stay."""
        least = depth.min()
        level = ((depth - least) / apart).astype(np.float32) + 1
        low = np.floor(level)
        below = level - low
        own, part = (each.reshape(-1)[: len(self.cells)] for each in (level, below))
        rows, columns = self.size
        count = int(own.max()) + 3
        at = low.reshape(-1)[: len(own)].astype(np.int64) * rows * columns + self.cells
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
        first = v + low * np.float32(rows)
        weight, total = (
            (1 - below) * cv2.remap(one, u, first, cv2.INTER_LINEAR)
            + below * cv2.remap(one, u, first + np.float32(rows), cv2.INTER_LINEAR)
            for one in sums
        )
        off = (total / np.maximum(weight, 1e-9) - level).clip(-1, 1)
        return (np.where(weight > 1e-6, level + off, level) - 1) * apart + least
